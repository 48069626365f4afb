"""Pushes that rise over 1 to 10 s, on the fingers of detection_mujoco.py: found with contact.drift, and without it.

    python bench/slow_pushes.py -o FOLDER --fingers 3 4       # FOLDER: of detection_mujoco.py

Each finger as `tendonfmu calibrate` has made it, and the same with `contact.drift` taken out.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from detection_mujoco import calibrated
from mujoco_pushes import PRETENSIONS, Push, make, place, pushes_of
from tendonfmu.detect.counting import score_detection
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.recording import Recording, read_recording

STRONG = 0.5  # N


def row(name: str, data: Mapping[str, Any], cases: list[tuple[Recording, list[Push]]]) -> str:
    found, force, alarms, minutes = [], [], 0, 0.0
    for recording, pushes in cases:
        pushed = np.zeros(len(recording), dtype=bool)
        for push in pushes:
            pushed |= (recording.time >= push.begin) & (recording.time <= push.end)
        outputs = run_recording(data, {"time": recording.time, **recording.groups})
        score = score_detection(recording.time, pushed, outputs["contact"].ravel())
        found += [event.found for event in score.events]
        force += [abs(push.force) for push in pushes]
        alarms, minutes = alarms + len(score.false_alarms), minutes + score.free_seconds / 60
    strong = np.array(force) >= STRONG
    counts = f"{sum(found)}/{len(found)} | {np.sum(np.array(found) & strong)}/{strong.sum()}"
    return f"| {name} | {counts} | {alarms} in {minutes:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of detection_mujoco.py")
    parser.add_argument("--fingers", type=int, nargs="+", required=True)
    given = parser.parse_args()
    print(f"| finger | found | of {STRONG:g} N and more | false alarms in min |")
    print("| --- | ---: | ---: | ---: |")
    for number in given.fingers:
        make(given.output, number, ("slow",))
        cases = [
            (read_recording(place(given.output, number, "slow", each)), pushes_of(given.output, number, each, "slow"))
            for each in PRETENSIONS
        ]
        data = read_finger(calibrated(given.output, number) / "finger.json").data
        contact = {key: value for key, value in data["contact"].items() if key != "drift"}
        print(row(f"{number}, without the rule", {**data, "contact": contact}, cases))
        print(row(f"**{number}**", data, cases), flush=True)


if __name__ == "__main__":
    main()
