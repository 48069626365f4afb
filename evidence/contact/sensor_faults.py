"""Is a failing sensor reported as a fault, and not as contact; and is no sound sensor reported?

Fingers in MuJoCo as `tendonfmu calibrate` delivers them. Faults are put into recordings with pushes, which it has not
learned from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import tendonfmu as tf
from evidence import table
from evidence.cases import run_cases
from evidence.part import Figures
from evidence.table import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import read_recording

Arrays = dict[str, Numbers]

FINGERS = (3, 19)
KINDS = ("zero", "frozen", "jump", "position")
SLOT, EARLIEST, LATEST, LASTS = 8.0, 1.0, 2.5, 3.0  # s
JUMP = (2.0, 10.0)  # N
LEAST_WRONG = 1.0  # N; a reading that is nowhere wrong by more needs no report
AROUND = 0.5  # s around contact of the sound recording that is not counted, and after a fault that is


def arrays_of(folder: Path, number: int, kind: str) -> list[Arrays]:
    """A finger's recordings of one kind, without angles."""
    from evidence.contact import pushed_fingers

    recordings = [read_recording(pushed_fingers.place(folder, number, kind, p)) for p in pushed_fingers.PRETENSIONS]
    names = ("tendon_force", "tendon_position")
    return [{"time": one.time, **{name: one.groups[name] for name in names}} for one in recordings]


def with_faults(arrays: Arrays, stiffness: Numbers, seed: Sequence[int]) -> tuple[Arrays, list[Row]]:
    """The recording with a fault in each slot; wrong: N, the largest error of f0, or k times that of x0."""
    random = np.random.default_rng(seed)
    force, position = arrays["tendon_force"].copy(), arrays["tendon_position"].copy()
    time, faults = arrays["time"], []
    for k in range(int((time[-1] - time[0]) // SLOT)):
        begin = float(time[0]) + k * SLOT + random.uniform(EARLIEST, LATEST)
        first, last = np.searchsorted(time, (begin, begin + LASTS))
        i, kind, rows = int(random.integers(force.shape[1])), KINDS[k % len(KINDS)], slice(int(first), int(last))
        size = float(np.exp(random.uniform(*np.log(JUMP)))) * (1.0 if random.random() < 0.5 else -1.0)
        signals = position if kind == "position" else force
        sound = signals[rows, i].copy()
        signals[rows, i] = {"zero": 0.0, "jump": sound + size}.get(kind, signals[rows.start - 1, i])
        wrong = float(np.abs(signals[rows, i] - sound).max()) * (stiffness[i] if kind == "position" else 1.0)
        faults.append({"tendon": i, "begin": time[first], "end": time[last], "wrong": wrong})
    return {"time": time, "tendon_force": force, "tendon_position": position}, faults


def widened(flags: Flags, time: Numbers) -> Flags:
    """[N] true within AROUND of a true one."""
    at = np.r_[-np.inf, time[flags], np.inf]
    near = np.searchsorted(at, time)
    return np.asarray(np.minimum(time - at[near - 1], at[near] - time) <= AROUND)


def judged(data: Mapping[str, Any], arrays: Arrays, seed: Sequence[int]) -> Iterator[Row]:
    """Every fault put into a recording. Contact that the sound recording has too is no error."""
    # delay: s to its report; contact: reported as such while it lasts; other: at another tendon; unwatched: contact
    # without the key
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]], dtype=float)
    faulty, faults = with_faults(arrays, stiffness, seed)
    time, without_key = faulty["time"], {key: value for key, value in data.items() if key != "sensor_fault"}
    known = widened(run_recording(data, arrays)["contact"].ravel().astype(bool), time)
    out, bare = run_recording(data, faulty), run_recording(without_key, faulty)
    for fault in faults:
        during = (time >= fault["begin"]) & (time < fault["end"])
        after = (time >= fault["begin"]) & (time < fault["end"] + AROUND)
        reported = np.flatnonzero(during & out["sensor_fault"][:, fault["tendon"]].astype(bool))
        others = np.delete(out["sensor_fault"], fault["tendon"], axis=1).any(axis=1)
        contact, unwatched = (bool((run["contact"].ravel().astype(bool) & after & ~known).any()) for run in (out, bare))
        yield {
            "wrong": fault["wrong"] >= LEAST_WRONG,
            "delay": float(time[reported[0]] - fault["begin"]) if len(reported) else None,
            "contact": contact,
            "other": bool((others & during).any()),
            "unwatched": unwatched,
        }


def finger_case(folder: Path, number: int) -> Row:
    """Faults put into a finger's recordings with pushes, and those that are reported in the sound ones."""
    from evidence.contact import calibrated

    data = tf.read_finger(calibrated(folder, number) / "finger.json").data
    faults: list[Row] = []
    begins, hours = 0, 0.0
    for k, arrays in enumerate(arrays_of(folder, number, "push")):
        faults += [{"finger": number} | row for row in judged(data, arrays, [number, 1, k])]
        flags = run_recording(data, arrays)["sensor_fault"].astype(int)
        begins += int((np.diff(flags, axis=0, prepend=0) > 0).sum())
        hours += float(arrays["time"][-1] - arrays["time"][0]) / 3600.0
    return {"faults": faults, "sound_faults": begins, "hours": hours}


def judged_faults(folder: Path, workers: int) -> Figures:
    rows = run_cases(finger_case, {f"faults_{number}": (folder, number) for number in FINGERS}, folder, workers)
    faults = [fault for row in rows for fault in row["faults"]]
    wrong = [row for row in faults if row["wrong"]]
    return {
        "share": 100.0 * sum(map(_is_right, wrong)) / len(wrong),
        "lines": table.by(faults, ["finger"], _cells),
        "sound_faults": sum(row["sound_faults"] for row in rows),
        "sound_hours": sum(row["hours"] for row in rows),
    }


def _is_right(row: Row) -> bool:
    return row["delay"] is not None and not row["contact"]


def _cells(rows: Sequence[Row]) -> list[str]:
    wrong = [row for row in rows if row["wrong"]]
    counts = [str(sum(row[key] for row in rows)) for key in ("contact", "other", "unwatched")]
    delay = table.median((row["delay"] for row in wrong), ".0f", 1e3)
    return [str(len(rows)), str(len(wrong)), str(sum(map(_is_right, wrong))), *counts, delay]


HEAD = ["finger", "faults", "wrong by ≥ 1 N", "reported, no contact", "as contact", "at another tendon"]
fault_table = table.of_cells("sensor_faults.lines", [*HEAD, "as contact without the key", "median delay, ms"], 1)
