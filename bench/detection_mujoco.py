"""How well contact is detected on fingers of another physics engine, with constants of `tune` and with others.

Each finger of mujoco_pushes.py is calibrated from a rough description by `tendonfmu diagnose` on its training
recordings, tuned on its free motion with every setting, and scored on 100 labelled pushes that no step before has seen.
A push's size is the largest torque that it makes at a joint, over the rms of the free residual there.

    python bench/detection_mujoco.py -o FOLDER [--fingers 1 3 4 6] [--settings present ...]

Everything is kept in the folder; writes detection_mujoco.md and, with a row for each push, detection_mujoco.csv.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mujoco_pushes import PRETENSIONS, description_file, make, place, pushes_of
from numpy.typing import NDArray

from tendonfmu import detection_bounds
from tendonfmu.description import FingerDescription, read_finger
from tendonfmu.detection_run import Subject, run_track
from tendonfmu.detection_tuning import ContactTuning, TuneWarning
from tendonfmu.recording import read_recording
from tendonfmu.whole_file import whole_file

Numbers = NDArray[np.float64]
SIZES = ((6.0, np.inf), (3.0, 6.0))  # times the residual's rms
FINGERS = (1, 3, 4, 6)
BEFORE, MOVED = 0.1, 1e-3  # s before a push in which a joint moves by so many rad: then the finger moves


@dataclass(frozen=True)
class Setting:
    """What a tuning is given.

    shares: c_H, c_J. bias: keys of the description that are changed. options: of `ContactTuning`. model: "extended", or
    "nominal": the given structure, refitted, which has no presliding.
    """

    shares: tuple[float, float] = (0.4, 0.4)
    bias: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    model: str = "extended"


TIMES = (0.0, 0.06, 0.12, 0.5)  # s, T_H
SHARES = ((0.0, 0.0), (0.2, 0.2), (0.2, 0.4), (0.4, 0.2), (0.4, 0.6), (0.7, 0.7))
SETTINGS = {
    "present": Setting(),
    **{f"T_H {time:g} s": Setting(options={"stuck_time": time}) for time in TIMES},
    **{f"c_H {h:g}, c_J {j:g}": Setting((h, j)) for h, j in SHARES},
    "forgetting by absorption": Setting(bias={"forgetting": "absorption"}),
    "forget_rate 0": Setting(bias={"forget_rate": 0.0}),
    **{f"T {time:g} s": Setting(options={"innovation_time": time}) for time in (0.025, 0.1, 0.2)},
    **{f"T_J {time:g} s": Setting(options={"jump_time": time}) for time in (0.03, 0.12)},
    **{f"bias {time:g} s": Setting(options={"bias_time": time}) for time in (0.2, 1.0)},
    "nominal": Setting(model="nominal"),
    **{f"nominal, T_H {time:g} s": Setting(options={"stuck_time": time}, model="nominal") for time in TIMES},
    **{f"nominal, c_H {h:g}, c_J {j:g}": Setting((h, j), model="nominal") for h, j in SHARES},
    "nominal, forgetting by absorption": Setting(bias={"forgetting": "absorption"}, model="nominal"),
    "nominal, forget_rate 0": Setting(bias={"forget_rate": 0.0}, model="nominal"),
}


@dataclass
class Found:
    """Of one finger and setting. sizes, delays [k] of all pushes (delay NaN: not found), moving [k]: at the onset."""

    sizes: Numbers
    delays: Numbers
    moving: NDArray[np.bool_]
    alarms: int
    minutes: float
    worth: float  # N·m, the lightest push on average, as free motion alone tells


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def calibrated(folder: Path, number: int, model: str) -> Path:
    """The finger as `diagnose` extends or refits it ("extended", "nominal") from the training recordings."""
    into = folder / f"diagnosis_{number:02d}"
    if not (into / "extended.json").exists():
        of = {kind: [str(place(folder, number, kind, each)) for each in PRETENSIONS] for kind in ("train", "test")}
        command = [sys.executable, "-m", "tendonfmu.cli", "diagnose", str(description_file(folder, number))]
        subprocess.run([*command, *of["train"], "--test", *of["test"], "-o", str(into), "--no-progress"], check=True)
    return into / f"{model}.json"


def tuned(folder: Path, number: int, name: str, setting: Setting) -> tuple[FingerDescription, dict[str, Any]]:
    """The tuned finger, and what free motion tells: rms [pretensions, n] N·m and worth N·m. Kept."""
    file = folder / f"tuned_{number:02d}_{name.replace(' ', '_').replace(',', '')}.json"
    known = file.with_suffix(".free.json")
    if not known.exists():
        data = read_finger(calibrated(folder, number, setting.model)).data
        data = {**data, "bias": {**(data.get("bias") or {}), **setting.bias}}
        detection_bounds.SHARES = (setting.shares,)
        tuning = ContactTuning(data, **setting.options)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)
            tuning.tune([place(folder, number, "free", each) for each in PRETENSIONS])
        rms = [np.sqrt(np.mean(run.residual[run.part.counted] ** 2, axis=0)).tolist() for run in tuning.runs_]
        search, bound = tuning.searches_["innovation"], tuning.bounds_["innovation"]
        rows = np.arange(0, len(tuning.cells_.order), 10)
        worth = float(np.exp(np.mean(np.log(detection_bounds.least_load(search.in_the_way(bound, rows))))))
        _kept(file, tuning.description_text())
        _kept(known, json.dumps({"rms": rms, "worth": worth, "warnings": tuning.warnings_}))
    return read_finger(file), json.loads(known.read_text(encoding="utf-8"))


def scored(folder: Path, number: int, finger: FingerDescription, rms: Sequence[Sequence[float]], worth: float) -> Found:
    """rms: [pretensions, n] N·m, that sizes are multiples of."""
    sizes, delays, moving, alarms, seconds = [], [], [], 0, 0.0
    for pretension, spread in zip(PRETENSIONS, rms, strict=True):
        recording = read_recording(place(folder, number, "push", pretension))
        track = run_track(Subject(Path("finger"), finger, packed=False), recording, 1, None)
        score = track.score()
        pushes = pushes_of(folder, number, pretension)
        assert len(pushes) == len(score.events), (number, pretension, len(score.events))
        angle = recording.groups["joint_position"]
        for push, event in zip(pushes, score.events, strict=True):
            before = angle[(recording.time < push.begin) & (recording.time > push.begin - BEFORE)]
            sizes.append(float(np.max(np.abs(push.torque) / np.array(spread))))
            delays.append(event.delay if event.found else np.nan)
            moving.append(bool(np.ptp(before, axis=0).max() > MOVED))
        alarms += len(score.false_alarms)
        seconds += score.free_seconds
    return Found(np.array(sizes), np.array(delays), np.array(moving), alarms, seconds / 60, worth)


def row(finger: str, name: str, each: Found) -> str:
    """One line of the table; found of those that moved in brackets."""
    cells = [finger, name]
    for low, high in SIZES:
        inside = (each.sizes >= low) & (each.sizes < high)
        found, moving = np.isfinite(each.delays) & inside, inside & each.moving
        cells.append(f"{found.sum()}/{inside.sum()} ({(found & moving).sum()}/{moving.sum()})")
    large = each.delays[(each.sizes >= SIZES[0][0]) & np.isfinite(each.delays)]
    delay = f"{1e3 * np.median(large):.0f}" if len(large) else "–"
    cells += [f"{each.alarms} in {each.minutes:.1f}", delay, f"{1e3 * each.worth:.1f}"]
    return f"| {' | '.join(cells)} |"


def together(parts: Sequence[Found]) -> Found:
    """Of several fingers."""
    return Found(
        sizes=np.concatenate([each.sizes for each in parts]),
        delays=np.concatenate([each.delays for each in parts]),
        moving=np.concatenate([each.moving for each in parts]),
        alarms=sum(each.alarms for each in parts),
        minutes=sum(each.minutes for each in parts),
        worth=float(np.exp(np.mean([np.log(each.worth) for each in parts]))),
    )


def report(results: Mapping[str, Mapping[int, Found]]) -> str:
    lines = [
        "| finger | setting | ≥ 6 (moving) | 3–6 (moving) | false alarms in min | median delay, ms | lightest, mN·m |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for parity, which in ((1, "odd"), (0, "even")):
        for name, found in results.items():
            parts = {number: each for number, each in found.items() if number % 2 == parity}
            lines += [row(str(number), name, each) for number, each in parts.items()]
            lines += [row(f"all {which}", f"**{name}**", together(list(parts.values())))] if len(parts) > 1 else []
    return "\n".join(lines) + "\n"


def write_pushes(file: Path, results: Mapping[str, Mapping[int, Found]]) -> None:
    """A row for each push and setting."""
    with whole_file(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["setting", "finger", "size", "delay", "moving"])
        for name, found in results.items():
            for number, each in found.items():
                for size, delay, moving in zip(each.sizes, each.delays, each.moving, strict=True):
                    writer.writerow([name, number, f"{size:.4g}", f"{delay:.4g}", int(moving)])


def _kept(file: Path, text: str) -> None:
    with whole_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of everything")
    parser.add_argument("--fingers", type=int, nargs="+", default=FINGERS, help="numbers of python_tests/foreign")
    parser.add_argument("--settings", nargs="+", default=list(SETTINGS), choices=list(SETTINGS))
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    results: dict[str, dict[int, Found]] = {name: {} for name in given.settings}
    for number in given.fingers:
        make(given.output, number)
        say(f"finger {number}: recorded")
        _, free = tuned(given.output, number, "present", SETTINGS["present"])
        for name in given.settings:
            finger, known = tuned(given.output, number, name, SETTINGS[name])
            results[name][number] = scored(given.output, number, finger, free["rms"], known["worth"])
            say(row(str(number), name, results[name][number]))
        _kept(given.output / "detection_mujoco.md", report(results))
    write_pushes(given.output / "detection_mujoco.csv", results)
    print(report(results))


if __name__ == "__main__":
    main()
