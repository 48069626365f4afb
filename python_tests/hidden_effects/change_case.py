"""What a case of a change is on disk: a folder with finger.json, then_*.parquet, now_*.parquet and truth.json.

`then` is the machine as it was, `now` is the machine with the change, or without one. The recordings of both differ: no
sample of one is in the other. Any tool can be run on such folders; change_judgement.py says what its answer is worth.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

NOTHING = "nothing"
# what a change of speed alone may show of a model that is not exact: not false where `now` is faster or slower
BY_SPEED = ("viscous_friction", "stribeck", "time_delay", "inertia")
HALVES = {1: "odd", 0: "even"}  # of the case's number: odd to develop on, even to report
FINGER, TRUTH = "finger.json", "truth.json"


@dataclass(frozen=True)
class Truth:
    """What a case hides, and which answers count.

    number: of the case in its bed; its parity is the half. bed: hidden (known effects in measured recordings), real
    (other load or speed), simulated. machine: or the simulator. model: diagnosed, plain, or as the simulator's is.
    hidden: name of the effect as its bed calls it, or `nothing`. effects: names of the list that count as the
    truth. also: names that are not false either. joint, tendon: place, from 1; None: any. signs: by effect, of now less
    then; an effect without one is not judged. conditions: how `now` was recorded, against `then`: repeat, part, motion,
    load, speed, excitation, pretension, length.
    strength: asked for. size: of what was put in, in `unit`. survives_now, survives_both, whole: variance of the added
    torque over that of what the model leaves of the unaltered `now`: what refitting the model's numbers to `now` alone
    leaves of it, what one set of numbers for `then` and `now` leaves, all of it less a constant of each recording. by:
    which of these was set to `strength`. visible: False where nobody who sees these data can be expected to name it.
    kinematics: source of the command. samples: where `then` and `now` come from, in words.
    """

    number: int
    bed: str
    machine: str
    model: str
    hidden: str
    effects: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    joint: int | None = None
    tendon: int | None = None
    signs: Mapping[str, int] = field(default_factory=dict)
    conditions: str = "part"
    strength: float = 0.0
    size: float = 0.0
    unit: str = ""
    by: str = ""
    survives_now: float | None = None
    survives_both: float | None = None
    whole: float | None = None
    visible: bool = True
    kinematics: int = 1
    samples: str = ""

    @property
    def half(self) -> str:
        return HALVES[self.number % 2]

    @property
    def name(self) -> str:
        strength = f"_{self.strength:g}" if self.strength else ""
        return f"{self.bed}_{self.number:04d}_{self.machine}_{self.model}_{self.hidden}{strength}_{self.conditions}"


@dataclass(frozen=True)
class Case:
    """finger: description. then, now: recordings by column, as docs/reference/recordings.md has them."""

    truth: Truth
    finger: Mapping[str, Any]
    then: tuple[Columns, ...]
    now: tuple[Columns, ...]


def write_case(case: Case, parent: Path) -> Path:
    """The case's folder below `parent`; it appears when it is complete."""
    parent.mkdir(parents=True, exist_ok=True)
    there = parent / case.truth.name
    with tempfile.TemporaryDirectory(dir=parent, prefix=".") as scratch:
        made = Path(scratch) / "case"
        made.mkdir()
        (made / FINGER).write_text(json.dumps(case.finger, indent=1) + "\n", encoding="utf-8")
        for kind, recordings in (("then", case.then), ("now", case.now)):
            for k, columns in enumerate(recordings, 1):
                pq.write_table(pa.table(dict(columns)), made / f"{kind}_{k}.parquet")
        told = asdict(case.truth) | {"half": case.truth.half, "name": case.truth.name}
        (made / TRUTH).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        os.replace(made, there)
    return there


def read_truth(folder: Path) -> Truth:
    told = json.loads((folder / TRUTH).read_text(encoding="utf-8"))
    known = {each.name for each in fields(Truth)}
    lists = {key: tuple(told[key]) for key in ("effects", "also")}
    return Truth(**{key: value for key, value in told.items() if key in known} | lists)


def recordings_of(folder: Path, kind: str) -> list[Path]:
    """kind: then or now. In the order of their numbers."""
    return sorted(folder.glob(f"{kind}_*.parquet"), key=lambda file: int(file.stem.rpartition("_")[2]))
