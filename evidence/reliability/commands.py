"""R16 and R17: commands that are killed, and machines that have no room left."""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from evidence.reliability.row import Measure, Outcome, Run, with_wrong
from evidence.runner import EXAMPLES

DEMO = EXAMPLES / "demo_recording"
COMMAND = [sys.executable, "-m", "tendonfmu.cli"]
SECONDS = 12.0  # of motion: commands have to end within seconds

COMMANDS: dict[str, list[str]] = {
    "build": ["build", "finger.json", "-o", "out/finger.fmu"],
    "run": ["run", "finger.json", "free.parquet", "-o", "out/free.csv"],
    "run to Parquet": ["run", "finger.json", "free.parquet", "-o", "out/free.parquet"],
    "excite": ["excite", "finger.json", "-o", "out/motion.csv", "--duration", "20"],
    "fit": ["fit", "finger.json", "free.parquet", "-o", "out/fitted.json", "--report", "out/report.json"],
    "diagnose": ["diagnose", "finger.json", "free.parquet", "-o", "out/diagnosis"],
    "calibrate": ["calibrate", "finger.json", "free.parquet", "-o", "out/calibrated"],
}
KILLED = ("build", "fit", "diagnose", "calibrate")


def inputs(folder: Path) -> None:
    """The demo's small finger and seconds of its motion."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    shutil.copy(DEMO / "two_joints.json", folder / "finger.json")
    frame = pd.read_parquet(DEMO / "two_joints_training.parquet")
    frame[frame["time"] < frame["time"].iloc[0] + SECONDS].to_parquet(folder / "free.parquet")


# --- is a file whole? -------------------------------------------------------------------------------------------------


def is_whole(file: Path) -> bool:
    content = file.read_bytes()
    if file.suffix == ".json":
        try:
            json.loads(content)
        except ValueError:
            return False
    elif file.suffix in (".fmu", ".npz"):
        try:
            with zipfile.ZipFile(file) as archive:
                return archive.testzip() is None
        except zipfile.BadZipFile:
            return False
    elif file.suffix == ".html":
        return content.rstrip().endswith(b"</html>")
    elif file.suffix == ".png":
        return content.endswith(b"IEND\xaeB`\x82")
    elif file.suffix == ".parquet":
        return content.startswith(b"PAR1") and content.endswith(b"PAR1")
    return bool(content)


def entries(folder: Path) -> list[Path]:
    """All in a folder. Others may remove some of it meanwhile, which `rglob` does not bear."""
    return [Path(inside, name) for inside, folders, files in os.walk(folder) for name in (*folders, *files)]


def results(folder: Path) -> dict[str, Path]:
    """Files that a user sees: no part of the name begins with a dot."""
    files = {path.relative_to(folder): path for path in entries(folder) if path.is_file()}
    return {str(name): path for name, path in files.items() if not any(part.startswith(".") for part in name.parts)}


def hidden(folder: Path) -> list[Path]:
    return [path for path in entries(folder) if any(part.startswith(".") for part in path.relative_to(folder).parts)]


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


def kills(run: Run) -> Outcome:
    chance = random.Random(1)
    kills_of_each = run.count(50, 2)
    total = 0
    wrong: list[str] = []
    left = 0
    for name in KILLED:
        words, folder = COMMANDS[name], run.work / name
        inputs(folder)
        began = time.monotonic()
        status = start(folder, words).wait()
        took = time.monotonic() - began
        whole = set(results(folder / "out"))
        if status or not whole:
            wrong.append(f"{name}: {(folder / 'said.txt').read_text()[-300:]}")
            continue
        shutil.rmtree(folder / "out")
        (folder / "out").mkdir()
        for k in range(kills_of_each):
            total += killed(folder, words, chance, took, at_a_write=k % 2 == 0)
            halves = [file for file, path in results(folder / "out").items() if not is_whole(path)]
            wrong += [f"{name}: half of {file}" for file in halves]
        if start(folder, words).wait():
            wrong.append(f"{name}: does not go on: {(folder / 'said.txt').read_text()[-300:]}")
        elif set(results(folder / "out")) != whole:
            wrong.append(f"{name}: other files than without a kill: {sorted(set(results(folder / 'out')) ^ whole)[:4]}")
        left += len(hidden(folder / "out"))
    number = f"kill -9 {total} times in {', '.join(KILLED)}: at random, and as a file is being written"
    result = f"no half file, and every command goes on; {left} hidden temporary files left"
    return Outcome(number, with_wrong(result, wrong), not wrong)


# --- no room ----------------------------------------------------------------------------------------------------------


def refused(folder: Path, name: str, command: list[str], limit: Callable[[], None] | None = None) -> str:
    """ "" when the command fails in one line and leaves no half file; "ended" when there was room enough; "lost" when a
    library ended the process, or waits for threads that it could not start (OpenBLAS), or Python could not begin."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    of_memory = limit is not None and "memory" in name
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, preexec_fn=limit, env=environment, timeout=120
        )
    except subprocess.TimeoutExpired:
        return "lost" if of_memory else f"{name}: not ended after 120 s"
    halves = [file for file, path in results(folder / "out").items() if not is_whole(path)]
    if halves:
        return f"{name}: half of {halves[0]}"
    if done.returncode == 0:
        return "ended"
    if of_memory and done.returncode not in (2, 3):
        return "lost"
    lines = done.stderr.strip().splitlines()
    if done.returncode != 2 or len(lines) != 1 or not lines[0].startswith("tendonfmu: "):
        return f"{name}: status {done.returncode}: {len(lines)} lines: {' / '.join(lines)[:300]}"
    return ""


def on_a_small_disk(options: str, then: str, words: list[str]) -> list[str]:
    """The command with a file system of its own at out/: in a mount namespace, gone when the command has ended."""
    script = f'mount -t tmpfs -o {options} tmpfs out && {then} exec "$@"'
    return ["unshare", "-m", "sh", "-c", script, "sh", *COMMAND, *words, "--quiet"]


def can_mount() -> bool:
    trial = ["unshare", "-m", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return shutil.which("unshare") is not None and subprocess.run(trial, capture_output=True).returncode == 0


def limited(kind: int, size: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(kind, (size, size))


def trials(name: str, words: list[str]) -> list[tuple[str, list[str], Callable[[], None] | None]]:
    """What a command is tried with: title, command, limit."""
    plain = [*COMMAND, *words, "--quiet"]
    listed: list[tuple[str, list[str], Callable[[], None] | None]] = [
        (f"{name}, files of at most {size} bytes", plain, limited(resource.RLIMIT_FSIZE, size))
        for size in (0, 1, 4096, 65536)
    ]
    if can_mount():
        sizes = ("4k", "16k", "64k")
        listed += [(f"{name}, disk of {size}", on_a_small_disk(f"size={size}", "", words), None) for size in sizes]
        read_only = on_a_small_disk("size=1m", "mount -o remount,ro out &&", words)
        listed.append((f"{name}, read-only disk", read_only, None))
    return listed + [
        (f"{name}, {size} MiB of memory", plain, limited(resource.RLIMIT_AS, size << 20))
        for size in (250, 350, 500, 700)
    ]


def no_room(run: Run) -> Outcome:
    folder = run.work / "disk"
    tried = ended = lost = 0
    wrong: list[str] = []
    names = list(COMMANDS)[: run.count(len(COMMANDS), 2)]
    for name in names:
        for title, command, limit in trials(name, COMMANDS[name]):
            inputs(folder)
            answer = refused(folder, title, command, limit)
            tried += 1
            ended += answer == "ended"
            lost += answer == "lost"
            wrong += [answer] if answer not in ("", "ended", "lost") else []
    (run.work / "wrong.txt").write_text("\n".join(wrong))
    disks = "full and read-only disks, " if can_mount() else ""
    number = f"{tried} runs of {', '.join(names)} with {disks}short files, little memory"
    result = (
        f"{tried - ended - lost - len(wrong)} refused in one line, {ended} had room enough, {lost} with little memory "
        "ended, or waiting for ever, in a library or in Python itself, no half file"
    )
    return Outcome(number, with_wrong(result, wrong), not wrong)


ROWS: dict[str, Measure] = {"R16": kills, "R17": no_room}
