"""A case of `diagnose`: what it is given, what is true of it, and how it is asked, here or by the command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from evidence.judge import UNKNOWN, Cause, Truth, effects_of
from tendonfmu.diagnosis import Diagnosis, diagnose

LIMIT = 3600.0  # s that the command may take
PROGRAM = (sys.executable, "-c", "from tendonfmu.cli import main; main()")
ALARMS = ("unexplained", "partly explained")  # verdicts


@dataclass(frozen=True)
class Case:
    machine: str  # what made the recordings: matched, numpy, mujoco, recorded, emps, davinci or a simulator's name
    finger: Mapping[str, Any]
    recordings: Sequence[pd.DataFrame]
    kinematics: int = 1
    seed: int = 0
    truths: tuple[Truth, ...] = ()  # one for each hidden effect that the list has
    test: Sequence[pd.DataFrame] = ()
    reference: Sequence[pd.DataFrame] = ()
    unaltered: Sequence[pd.DataFrame] = ()  # the recordings before anything was hidden in them
    gain_recordings: Sequence[pd.DataFrame] = ()  # of other motions, for the true gain of the extended model
    facts: Mapping[str, Any] = field(default_factory=dict)  # columns of the case's row

    def diagnosed(self, *more: pd.DataFrame) -> Diagnosis:
        recordings, test = [*self.recordings, *more], list(self.test)
        return diagnose(self.finger, recordings, test, kinematics=self.kinematics, seed=self.seed)

    def write(self, folder: Path, with_reference: bool = True) -> list[str]:
        """Write finger.json and the recordings; return the arguments of `tendonfmu diagnose` in that folder."""
        (folder / "finger.json").write_text(json.dumps(self.finger), encoding="utf-8")
        parts = {"": self.recordings, "test": self.test, "reference": self.reference if with_reference else ()}
        arguments = ["finger.json"]
        for option, frames in parts.items():
            for number, frame in enumerate(frames, start=1):
                file = f"{option or 'recording'}_{number}.parquet"
                frame.to_parquet(folder / file, index=False)
                arguments += [f"--{option}", file] if option else [file]
        return [*arguments, "--kinematics", str(self.kinematics)]


# --- what a diagnosis says --------------------------------------------------------------------------------------------


def leaves_unnamed(verdict: str, causes: Sequence[Cause]) -> bool:
    """Whether the diagnosis says that something is there that it cannot name."""
    return verdict in ALARMS or any(UNKNOWN in effects_of(cause) for cause in causes[:1])


# --- the command ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """One call of the command. CPU time and memory are those of the process and of what it waited for."""

    exit: int | None  # None if it was ended after the time limit
    message: str  # last line of what it printed
    seconds: float  # CPU
    peak_megabytes: float
    report: dict[str, Any] | None  # diagnosis.json, if it was written
    models: tuple[dict[str, Any], ...] = ()  # nominal.json and extended.json, with it


def run_command(case: Case, with_reference: bool = True, limit: float = LIMIT) -> Run:
    """Run `tendonfmu diagnose` as a user calls it, in a process and a folder of its own."""
    with tempfile.TemporaryDirectory() as name, tempfile.TemporaryFile("w+", errors="replace") as messages:
        folder = Path(name)
        call = [*PROGRAM, "diagnose", *case.write(folder, with_reference), "-o", "report", "--no-progress"]
        process = subprocess.Popen(call, cwd=folder, stdout=messages, stderr=messages)
        late = threading.Event()

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(limit, end)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        messages.seek(0)
        lines = [line.strip() for line in messages if line.strip()]
        written = folder / "report" / "diagnosis.json"
        is_written = process.returncode == 0 and written.is_file()
        files = [written, written.with_name("nominal.json"), written.with_name("extended.json")] if is_written else []
        report, *models = [json.loads(file.read_text(encoding="utf-8")) for file in files] or [None]
    kilobytes = usage.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return Run(
        exit=None if late.is_set() else process.returncode,
        message=f"ended after {limit:g} s" if late.is_set() else (lines or [""])[-1],
        seconds=usage.ru_utime + usage.ru_stime,
        peak_megabytes=kilobytes / 1024,
        report=report,
        models=tuple(models),
    )
