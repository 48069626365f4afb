"""How well contact is detected on fingers of another physics engine that `tendonfmu calibrate` alone made ready.

    python -m evidence.detection.mujoco -o FOLDER [--fingers 1 3 19 4 6]
    python -m evidence.detection.mujoco -o FOLDER --slow --fingers 3 4

--slow: pushes that rise over 1 to 10 s, found by each finger as `calibrate` has made it, and with `contact.drift` taken
out. Everything is kept in the folder; writes detection_mujoco.md, or slow_pushes.md.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.detection.mujoco_pushes import FREE, PRETENSIONS, PUSHED, description_file, make, place, pushes_of
from evidence.runner import parser, publish, run_cases, write
from evidence.tables import Row
from tendonfmu.detect import score_detection
from tendonfmu.model import read_finger
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import read_recording

FINGERS = (1, 3, 19, 4, 6)
SIZES = (6.0, 3.0)  # times the residual's rms: least sizes of classes
STRONG = 0.5  # N


def calibrated(folder: Path, number: int) -> Path:
    """Folder of the calibration of a finger; `cpu.json` in it is the processor time of the first call, s."""
    into = folder / f"calibrated_{number:02d}"
    if not (into / "cpu.json").exists():
        make(folder, number)
        free, pushed = (
            [str(place(folder, number, kind, pretension)) for kind in kinds for pretension in PRETENSIONS]
            for kinds in (FREE, PUSHED)
        )
        command = [sys.executable, "-m", "tendonfmu.cli", "calibrate", str(description_file(folder, number)), *free]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*command, "--pushes", *pushed, "-o", str(into), "--no-progress"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        write(into / "cpu.json", json.dumps(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
    return into


def calibration(folder: Path, number: int) -> Row:
    """What `calibrate` reports of a finger."""
    into = calibrated(folder, number)
    report = json.loads((into / "calibration.json").read_text(encoding="utf-8"))
    pushes = report["pushes"]
    return {
        "finger": number,
        "sizes": {f"{size['from']:g}": (size["found"], size["events"]) for size in pushes["sizes"]},
        "alarms": pushes["false_alarms"],
        "after": pushes["false_alarms_after_events"],
        "promised": report["detection"]["held_out"]["limit"],
        "minutes": pushes["free_minutes"],
        "delay": pushes["median_delay_s"],
        "cpu": json.loads((into / "cpu.json").read_text(encoding="utf-8")),
    }


def report(rows: Sequence[Row]) -> str:
    def line(name: str, group: Sequence[Row]) -> list[str]:
        sizes = [[row["sizes"].get(f"{size:g}", (0, 0)) for row in group] for size in SIZES]
        cells = [f"{sum(found for found, _ in size)}/{sum(count for _, count in size)}" for size in sizes]
        cells.append(f"{sum(row['alarms'] for row in group)} in {sum(row['minutes'] for row in group):.1f}")
        cells.append(str(sum(row["after"] for row in group)))
        cells.append(", ".join(f"{row['promised'] * row['minutes'] / 60.0:.1f}" for row in group))
        cells.append(", ".join(tables.number(row["delay"], ".0f", 1e3) for row in group))
        return [name, *cells, ", ".join(f"{row['cpu']:.0f}" for row in group)]

    lines = []
    for parity, name in ((1, "odd"), (0, "even")):
        group = [row for row in rows if row["finger"] % 2 == parity]
        lines += [line(str(row["finger"]), [row]) for row in group]
        lines += [line(f"**all {name}**", group)] if len(group) > 1 else []
    head = ["finger", "≥ 6 × rms", "3 to 6", "false alarms in min", "within 2 s after a push", "promised"]
    head += ["median delay, ms", "CPU time, s"]
    return tables.table(head, lines) + "\n"


# --- slow pushes ------------------------------------------------------------------------------------------------------


def slow(folder: Path, number: int) -> Row:
    """What a finger finds of slow pushes, with the rule for them and without."""
    make(folder, number, ("slow",))
    data = dict(read_finger(calibrated(folder, number) / "finger.json").data)
    contact = {key: value for key, value in data["contact"].items() if key != "drift"}
    bare = {**data, "contact": contact}
    lines = [_slow_line(f"{number}, without the rule", bare, folder, number)]
    return {"lines": [*lines, _slow_line(f"**{number}**", data, folder, number)]}


def _slow_line(name: str, data: Mapping[str, Any], folder: Path, number: int) -> list[str]:
    found, force, alarms, minutes = [], [], 0, 0.0
    for pretension in PRETENSIONS:
        recording = read_recording(place(folder, number, "slow", pretension))
        pushes = pushes_of(folder, number, pretension, "slow")
        during = [(recording.time >= push.begin) & (recording.time <= push.end) for push in pushes]
        outputs = run_recording(data, {"time": recording.time, **recording.groups})
        score = score_detection(recording.time, np.any(during, axis=0), outputs["contact"].ravel())
        found += [event.found for event in score.events]
        force += [abs(push.force) for push in pushes]
        alarms, minutes = alarms + len(score.false_alarms), minutes + score.free_seconds / 60
    strong = np.array(found)[np.array(force) >= STRONG]
    return [name, tables.count(found), tables.count(strong), f"{alarms} in {minutes:.1f}"]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--fingers", type=int, nargs="+", default=FINGERS, help="numbers of evidence/fingers")
    options.add_argument("--slow", action="store_true", help="pushes that rise over 1 to 10 s")
    given = options.parse_args()

    def rows_of(function: Callable[..., Row], kind: str) -> list[Row]:
        cases = {f"{kind}_{number:02d}": (given.output, number) for number in given.fingers}
        return run_cases(function, cases, given.output, given.workers, given.scheduler)

    if given.slow:
        lines = [line for row in rows_of(slow, "slow") for line in row["lines"]]
        head = ["finger", "found", f"of {STRONG:g} N and more", "false alarms in min"]
        publish(given.output / "slow_pushes.md", tables.table(head, lines) + "\n")
    else:
        publish(given.output / "detection_mujoco.md", report(rows_of(calibration, "finger")))


if __name__ == "__main__":
    main()
