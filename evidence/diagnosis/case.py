"""A case of `diagnose`: what the command is given, what is true of it, and what it answers."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from evidence.cases import tendonfmu
from evidence.diagnosis.judge import Truth


@dataclass(frozen=True)
class Case:
    finger: Mapping[str, Any]
    recording: pd.DataFrame
    truth: Truth
    test: pd.DataFrame | None = None
    reference: pd.DataFrame | None = None
    kinematics: int = 1  # 2: the recorded joint angles

    def write(self, folder: Path) -> list[str]:
        """Write finger.json and the recordings; return the arguments of `tendonfmu diagnose` in that folder."""
        (folder / "finger.json").write_text(json.dumps(self.finger), encoding="utf-8")
        self.recording.to_parquet(folder / "recording.parquet", index=False)
        arguments = ["finger.json", "recording.parquet"]
        for option, frame in (("test", self.test), ("reference", self.reference)):
            if frame is not None:
                frame.to_parquet(folder / f"{option}.parquet", index=False)
                arguments += [f"--{option}", f"{option}.parquet"]
        return [*arguments, "--kinematics", str(self.kinematics)]


def diagnosed(case: Case) -> tuple[dict[str, Any], float]:
    """diagnosis.json of the command as a user calls it, in a folder of its own, and its processor time [s]."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seconds = tendonfmu("diagnose", *case.write(folder), "-o", "report", "--no-progress", folder=folder)
        report = json.loads((folder / "report" / "diagnosis.json").read_text(encoding="utf-8"))
    return report, seconds
