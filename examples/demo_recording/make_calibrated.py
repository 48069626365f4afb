"""Calibrate the index finger on 27 min of its simulated motion: `index_finger_calibrated.json`, see README.md.

Plays 800 s at 10 N and 800 s at tensions of 6 to 20 N on the rig, calibrates the description on both, and prints what
each description makes of the demo's recordings, as README.md has it.

    python make_calibrated.py [-o FOLDER] [--jobs CORES] [--table]
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tendonfmu as tf

HERE = Path(__file__).resolve().parent
GIVEN = HERE.parent / "fingers" / "index_finger.json"
CALIBRATED = HERE / "index_finger_calibrated.json"
DURATION = 800.0  # s, of each recording
FREE = {"free_10": ["--pretension", "10"], "free_vary": ["--vary-tension", "6:20", "--seed", "5"]}
RECORDINGS = {
    "index_finger_free": "free motion, 10 N",
    "index_finger_free_x4": "the same at 40 N",
    "index_finger_pushes": "with pushes, while nobody pushes",
}

Array = NDArray[Any]


def calibrate(folder: Path, jobs: int) -> Path:
    """The calibrated description in a folder, of `tendonfmu calibrate`: a call that is repeated goes on."""
    sys.path.insert(0, str(HERE.parents[1]))
    from evidence.fit.virtual_hand import record

    free = [folder / f"{name}.parquet" for name in FREE]
    for recording, options in zip(free, FREE.values(), strict=True):
        if not recording.is_file():
            record(folder, recording.stem, DURATION, options)
    command = [sys.executable, "-m", "tendonfmu", "calibrate", GIVEN, *free]
    pushes = ["--pushes", HERE / "index_finger_pushes.parquet"]
    output = folder / "calibrated"
    subprocess.run([*command, *pushes, "-o", output, "--jobs", str(jobs), "--progress"], check=True)
    return output / "finger.json"


def rows(finger: Path) -> Iterator[tuple[str, list[str]]]:
    """(what, before → after of each joint in mN·m) of free motion, and of the time in contact."""
    for name, what in RECORDINGS.items():
        recording = tf.read_recording(HERE / f"{name}.parquet")
        outputs = tf.run(finger, recording).outputs
        label = np.zeros(len(recording), bool) if recording.contact is None else recording.contact
        torque, left = outputs["joint_torque"], outputs["compensated_torque"]
        yield f"{what}: τ → compensated", cells(torque[~label], left[~label])
    load = recording.groups["external_torque"]
    words = "with pushes, in contact: `external_torque` → compensated minus that"
    yield words, cells(load[label], (left - load)[label])


def cells(before: Array, after: Array) -> list[str]:
    """Of each joint, rms in mN·m."""
    rms = (1e3 * np.sqrt(np.mean(np.square(values), axis=0)) for values in (before, after))
    return [f"{one:.1f} → {other:.1f}" for one, other in zip(*rms, strict=True)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="folder for motions (70 MB), recordings and calibration")
    parser.add_argument("--jobs", type=int, default=1, help="processor cores")
    parser.add_argument("--table", action="store_true", help="print the table of the file that is there, no more")
    arguments = parser.parse_args()
    if not arguments.table:
        folder = arguments.output or Path(tempfile.mkdtemp())
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(calibrate(folder.resolve(), arguments.jobs), CALIBRATED)
    print("| | | abduction | mcp flexion | pip flexion | dip flexion |")
    print("| --- | --- | ---: | ---: | ---: | ---: |")
    for words, finger in (("as given", GIVEN), ("calibrated", CALIBRATED)):
        for what, found in rows(finger):
            print(f"| {words} | {what} | {' | '.join(found)} |")


if __name__ == "__main__":
    main()
