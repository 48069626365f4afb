"""Recordings for sensor_faults.py: sound ones of several families of fingers, and faults that are put into them.

A fault is put into one tendon in each slot of 8 s, of four kinds in turn: its force reads 0, its force freezes, its
force jumps by 2 to 10 N (uniform in the logarithm, up or down), its position freezes. It begins 1 to 2.5 s into the
slot and lasts 3 s; what a frozen sensor reads is its last sound value, to the last bit.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tendonfmu.files.tables import write_table
from tendonfmu.recordings.recording import Recording, read_recording
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import simulate

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python_tests" / "foreign"))

import fingers_in_numpy  # noqa: E402

Numbers = NDArray[np.float64]

RIG = ROOT / "examples" / "rigs" / "index_finger.json"
FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
SIMULATED_PRETENSIONS = (10.0, 20.0)  # N
SIMULATED_SECONDS = {"train": 60.0, "free": 300.0, "push": 240.0}
PUSH_EVERY = 6.0  # s
KINDS = ("zero", "frozen", "jump", "position")
SLOT, EARLIEST, LATEST, LASTS = 8.0, 1.0, 2.5, 3.0  # s
JUMP = (2.0, 10.0)  # N
INPUTS = ("tendon_force", "tendon_position")


@dataclass(frozen=True)
class Fault:
    """kind: of KINDS. tendon: from 0. begin, end: s. wrong: N, the largest error of f0, or k times that of x0."""

    kind: str
    tendon: int
    begin: float
    end: float
    wrong: float


def arrays_of(recording: Recording) -> dict[str, Numbers]:
    return {"time": recording.time, **{name: recording.groups[name] for name in INPUTS}}


def with_faults(
    arrays: Mapping[str, Numbers], stiffness: Numbers, seed: Sequence[int]
) -> tuple[dict[str, Numbers], list[Fault]]:
    """The recording with a fault in each slot."""
    rng = np.random.default_rng(seed)
    force, position = arrays["tendon_force"].copy(), arrays["tendon_position"].copy()
    time, found = arrays["time"], []
    for k in range(int((time[-1] - time[0]) // SLOT)):
        begin = float(time[0]) + k * SLOT + rng.uniform(EARLIEST, LATEST)
        first, last = np.searchsorted(time, (begin, begin + LASTS))
        i, kind, rows = int(rng.integers(force.shape[1])), KINDS[k % len(KINDS)], slice(int(first), int(last))
        size = float(np.exp(rng.uniform(*np.log(JUMP)))) * (1.0 if rng.random() < 0.5 else -1.0)
        row, column = (position if kind == "position" else force), rows.start - 1
        sound = row[rows, i].copy()
        row[rows, i] = {"zero": 0.0, "jump": sound + size}.get(kind, row[column, i])
        wrong = float(np.abs(row[rows, i] - sound).max()) * (stiffness[i] if kind == "position" else 1.0)
        found.append(Fault(kind, i, float(time[first]), float(time[last]), wrong))
    return {"time": time, "tendon_force": force, "tendon_position": position}, found


def simulated(folder: Path, kind: str, pretension: float) -> Path:
    """A recording of the simulated finger; made where it is missing."""
    file = folder / f"simulated_{kind}_{pretension:g}.parquet"
    if not file.exists():
        seconds, seed = SIMULATED_SECONDS[kind], 8_100_000 + 1000 * list(SIMULATED_SECONDS).index(kind)
        rig = {
            "format": "tendonfmu-rig-1",
            "base": str(RIG),
            "name": file.stem,
            "seed": seed + round(pretension),
            "motion": {"pretension": pretension, "seed": seed + round(pretension), "duration": None},
            "pushes": list(_pushes(seed, seconds)) if kind == "push" else [],
            "recording": {"columns": ["contact"], "duration": seconds},
        }
        rig_file = folder / f"{file.stem}.json"
        rig_file.write_text(json.dumps(rig), encoding="utf-8")
        write_table(file, simulate(read_rig(rig_file)).recording)
    return file


def _pushes(seed: int, seconds: float) -> Iterator[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    for k in range(1, int(seconds // PUSH_EVERY)):
        force, rise = float(np.exp(rng.uniform(*np.log((0.1, 2.0))))), float(rng.uniform(0.01, 0.05))
        times = {"start": k * PUSH_EVERY + rng.uniform(0.0, 3.0), "rise": rise, "hold": rng.uniform(0.3, 1.0)}
        yield {**times, "fall": rise, "force": force, "direction": [0.0, 0.0, 1.0]}


def of_numpy(
    number: int, train_seconds: float, test_seconds: float
) -> tuple[Any, dict[str, Numbers], dict[str, Numbers]]:
    """Description, training and test recording of a finger of python_tests/foreign."""
    case = fingers_in_numpy.make(number, train_seconds, test_seconds)
    return case.nominal, _columns(case.train), _columns(case.test)


def _columns(frame: pd.DataFrame) -> dict[str, Numbers]:
    groups = {name: [each for each in frame.columns if each.startswith(f"{name}[")] for name in INPUTS}
    return {"time": frame["time"].to_numpy(), **{name: frame[each].to_numpy() for name, each in groups.items()}}


def of_files(description: Path, train: Path, test: Path) -> tuple[Any, dict[str, Numbers], dict[str, Numbers]]:
    """The same of a folder of recordings."""
    data = json.loads(description.read_text(encoding="utf-8"))
    return data, arrays_of(read_recording(train)), arrays_of(read_recording(test))
