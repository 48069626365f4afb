"""Recordings of fingers by seed for contact detection: free motion and labelled pushes, each with its truth.

The fingers are those of evidence/families in MuJoCo. A push is a force on a link, at right angles to it, of 0.1 to 2 N,
uniform in the logarithm, that begins anywhere in a slot of 6 s. What is there is kept.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd

from evidence.cases import write
from evidence.families import cases, elastic
from evidence.families.finger import Array, Finger, Hidden, describe, record
from evidence.families.motion import random_motion
from tendonfmu.files import whole_file

PRETENSIONS = (15.0, 30.0)  # N, each breathing by 30 %
EVERY = 2  # of the samples: 250 Hz
SECONDS = {"free": 240.0, "more": 240.0, "push": 240.0}  # s, of one recording; "more" is free, too
FREE, PUSHED = ("free", "more"), ("push",)
SLOT = 6.0  # s, of one push
EARLIEST, LATEST = 0.5, 4.4  # s into its slot that a push begins
FORCE = (0.1, 2.0)  # N
RISE, HOLD = (0.01, 0.05), (0.3, 1.0)  # s; it falls as it rises
SEEDS = {"more": 1, "free": 2, "push": 3}  # of a kind of recording


@dataclasses.dataclass(frozen=True)
class Push:
    begin: float  # s
    end: float
    force: float  # N, along the positive angle or against it
    link: int  # from 0
    rise: float  # s

    def at(self, t: float) -> float:
        """N: a cosine up, a hold, a cosine down."""
        part = min(t - self.begin, self.end - t) / self.rise
        return 0.0 if part <= 0.0 else self.force * 0.5 * (1.0 - float(np.cos(np.pi * min(part, 1.0))))


class Pushed(elastic.Mechanism):
    """A finger that is pushed."""

    def __init__(self, finger: Finger, hidden: Hidden, pushes: list[Push]) -> None:
        super().__init__(finger, hidden)
        self.pushes = pushes
        self.torques: list[Array] = []  # [n] N·m of the push at every tick

    def outside(self, t: float, angle: Array) -> Array:
        torque = np.zeros(self.model.nv)
        push = next((push for push in self.pushes if push.begin <= t <= push.end), None)
        if push is not None:
            body = int(self.model.joint(f"joint_{push.link}").bodyid[0])
            turned = self.data.xmat[body].reshape(3, 3)
            point = self.data.xpos[body] + turned @ np.array([elastic.LINK / 2, 0.0, 0.0])
            force = turned @ np.array([0.0, 0.0, push.at(t)])
            mujoco.mj_applyFT(self.model, self.data, force, np.zeros(3), point, body, torque)
        self.torques.append(torque[self.hinges])
        return super().outside(t, angle) + self.torques[-1]


def planned(rng: np.random.Generator) -> list[Push]:
    """One push in each slot."""
    pushes = []
    for k in range(int(SECONDS["push"] // SLOT)):
        begin = k * SLOT + rng.uniform(EARLIEST, LATEST)
        rise = rng.uniform(*RISE)
        force = float(np.exp(rng.uniform(*np.log(FORCE)))) * (1.0 if rng.random() < 0.5 else -1.0)
        end = begin + rng.uniform(*HOLD) + 2.0 * rise
        pushes.append(Push(begin, end, force, int(rng.integers(elastic.JOINTS)), rise))
    return pushes


def recorded(number: int, kind: str, pretension: float) -> pd.DataFrame:
    """A recording; of a pushed finger with `contact` and `external_torque`, as the tendons bear it."""
    made, hidden, _ = cases.machine("elastic", number)
    draws = np.random.default_rng([number, SEEDS[kind], round(pretension)])
    motion = random_motion(elastic.JOINTS, pretension, draws)
    pushes = planned(draws) if kind in PUSHED else []
    mechanism = Pushed(made, hidden, pushes)
    table = record(elastic.moved(mechanism, motion, SECONDS[kind]), hidden, draws)
    if pushes:
        rows = round(SECONDS[kind] / elastic.TICK)
        torque = -np.array(mechanism.torques[-rows :: round(1.0 / (elastic.RATE * elastic.TICK))])
        table["contact"] = np.any([table["time"].between(push.begin, push.end) for push in pushes], axis=0).astype(
            float
        )
        for j in range(elastic.JOINTS):
            table[f"external_torque[{j + 1}]"] = torque[:, j]
    sampled: pd.DataFrame = table.iloc[::EVERY]
    return sampled


def place(folder: Path, number: int, kind: str, pretension: float) -> Path:
    """File of a recording."""
    return folder / f"finger_{number:02d}_{kind}_{pretension:g}.parquet"


def description_file(folder: Path, number: int) -> Path:
    """The rough description of a finger, without what is hidden."""
    return folder / f"finger_{number:02d}.json"


def make(folder: Path, number: int, kinds: tuple[str, ...] = FREE + PUSHED) -> None:
    """All recordings of a seed's finger that are missing."""
    write(description_file(folder, number), describe(*cases.machine("elastic", number)))
    for kind in kinds:
        for pretension in PRETENSIONS:
            file = place(folder, number, kind, pretension)
            if not file.exists():
                with whole_file(file) as temporary:
                    recorded(number, kind, pretension).to_parquet(temporary, index=False)
