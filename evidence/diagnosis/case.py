"""A case of `diagnose`: what the command is given, what is true of it, and what it answers."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from evidence.diagnosis.judge import Truth

LIMIT = 3600.0  # s that the command may take


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
    """diagnosis.json of the command as a user calls it, in a folder of its own, and its processor time [s].

    Raises RuntimeError with the command's last lines where it fails.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, before = Path(name), _seconds_of_children()
        command = [sys.executable, "-m", "tendonfmu", "diagnose", *case.write(folder), "-o", "report"]
        ended = subprocess.run(
            [*command, "--no-progress"],
            cwd=folder,
            timeout=LIMIT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        if ended.returncode:
            raise RuntimeError(_reason(folder, ended.stdout, ended.returncode))
        report = json.loads((folder / "report" / "diagnosis.json").read_text(encoding="utf-8"))
    return report, _seconds_of_children() - before


def _reason(folder: Path, said: str, status: int) -> str:
    """The last lines of the report of an internal error, else of what the command said."""
    reports = [file.read_text(encoding="utf-8") for file in sorted(folder.glob("tendonfmu-error-*.txt"))]
    return "\n".join((reports[-1] if reports else said).strip().splitlines()[-4:]) or f"exit status {status}"


def _seconds_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
