"""What happens to commands that are killed?"""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pandas as pd

from evidence.cases import EXAMPLES
from evidence.part import Figures, Part

DEMO = EXAMPLES / "demo_recording"
COMMAND = [sys.executable, "-m", "tendonfmu"]
SECONDS = 12.0  # of motion: commands have to end within seconds
COMMANDS: dict[str, list[str]] = {
    "build": ["build", "finger.json", "-o", "out/finger.fmu"],
    "fit": ["fit", "finger.json", "free.parquet", "-o", "out/fitted.json", "--report", "out/report.json"],
    "diagnose": ["diagnose", "finger.json", "free.parquet", "-o", "out/diagnosis"],
    "calibrate": ["calibrate", "finger.json", "free.parquet", "-o", "out/calibrated"],
}
KILLS = 50  # of each


def prepare(folder: Path) -> None:
    """The demo's small finger and seconds of its motion."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    shutil.copy(DEMO / "two_joints.json", folder / "finger.json")
    frame = pd.read_parquet(DEMO / "two_joints_training.parquet")
    frame[frame["time"] < frame["time"].iloc[0] + SECONDS].to_parquet(folder / "free.parquet")


# --- files ------------------------------------------------------------------------------------------------------------


def is_whole(file: Path) -> bool:
    content = file.read_bytes()
    if file.suffix == ".json":
        with contextlib.suppress(ValueError):
            return json.loads(content) is not None
        return False
    if file.suffix in (".fmu", ".npz"):
        with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(file) as archive:
            return archive.testzip() is None
        return False
    ends = {".html": b"</html>", ".png": b"IEND\xaeB`\x82", ".parquet": b"PAR1"}
    return bool(content) and content.rstrip(b"\n").endswith(ends.get(file.suffix, b""))


def entries(folder: Path) -> list[Path]:
    """All in a folder. Others may remove some of it meanwhile, which `rglob` does not bear."""
    return [Path(inside, name) for inside, folders, files in os.walk(folder) for name in (*folders, *files)]


def results(folder: Path) -> dict[str, Path]:
    """Files that a user sees: no part of the name begins with a dot."""
    files = {path.relative_to(folder): path for path in entries(folder) if path.is_file()}
    return {str(name): path for name, path in files.items() if not any(part.startswith(".") for part in name.parts)}


# --- killed -----------------------------------------------------------------------------------------------------------


def start(folder: Path, words: list[str]) -> subprocess.Popen[bytes]:
    said = (folder / "said.txt").open("wb")
    return subprocess.Popen([*COMMAND, *words, "--quiet"], cwd=folder, stdout=said, stderr=said, start_new_session=True)


def killed(folder: Path, words: list[str], chance: random.Random, longest: float, at_a_write: bool) -> bool:
    """True when it was killed before it had ended. at_a_write: when the first new file appears, else anywhere."""
    process = start(folder, words)
    began, known = time.monotonic(), set(entries(folder / "out"))
    limit = longest * (3.0 if at_a_write else chance.random())
    while process.poll() is None and time.monotonic() - began < limit:
        if at_a_write and set(entries(folder / "out")) - known:
            time.sleep(chance.choice([0.0, 0.001, 0.01, 0.1]))
            break
        time.sleep(0.0005 if at_a_write else 0.01)
    alive = process.poll() is None
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)  # its own session: its helpers go with it
    process.wait()
    return alive


def kills(folder: Path, _workers: int) -> Figures:
    """kill -9 at random, and as a file is being written: no half file, and the command goes on afterwards."""
    chance, total = random.Random(1), 0
    wrong: list[str] = []
    for name in COMMANDS:
        words, work = COMMANDS[name], folder / name
        prepare(work)
        began = time.monotonic()
        if start(work, words).wait():
            raise RuntimeError(f"{name}: {(work / 'said.txt').read_text()[-300:]}")
        took, whole = time.monotonic() - began, set(results(work / "out"))
        shutil.rmtree(work / "out")
        (work / "out").mkdir()
        for k in range(KILLS):
            total += killed(work, words, chance, took, at_a_write=k % 2 == 0)
            halves = [file for file, path in results(work / "out").items() if not is_whole(path)]
            wrong += [f"{name}: half of {file}" for file in halves]
        if start(work, words).wait():
            wrong.append(f"{name}: does not go on: {(work / 'said.txt').read_text()[-300:]}")
        elif set(results(work / "out")) != whole:
            wrong.append(f"{name}: other files than without a kill")
    return {"kills": total, "wrong": wrong, "faults": len(wrong)}


PARTS = {"kills": Part(kills, minutes=11.0, headlines={"faults": (0, 0)})}
