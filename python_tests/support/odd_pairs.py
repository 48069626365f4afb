"""Pairs of a finger description and recordings that do not belong together well, by seed, and faults of what is said.

A random finger, and free motion by a few lines of numpy that share nothing with the package: antagonistic tendons,
friction of their own, noise. `QUIRKS` spoil them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_fingers import random_extended, random_finger
from tendonfmu.files.tables import write_table

Array = NDArray[np.float64]
Columns = dict[str, Array]  # `time` [N], groups [N, k], `contact` [N]
Description = dict[str, Any]
# of Python, not of a user's language
CODE = re.compile(
    r"\b\w+(Error|Exception|Warning)\b|Traceback|internal|object at 0x|numpy|\bNone\b|<class|\bNoneType\b"
)


@dataclass
class Pair:
    description: Description
    recordings: list[Columns]
    tests: list[Columns]
    quirk: str
    kinematics: int = 1

    @property
    def all(self) -> list[Columns]:
        return [*self.recordings, *self.tests]

    def write(self, folder: Path) -> tuple[Path, list[Path], list[Path]]:
        """Write description, recordings and tests to files."""
        folder.mkdir(parents=True, exist_ok=True)
        finger = folder / "finger.json"
        finger.write_text(json.dumps(self.description), encoding="utf-8")
        recordings = [_write(folder / f"train_{k}.parquet", each) for k, each in enumerate(self.recordings)]
        tests = [_write(folder / f"test_{k}.parquet", each) for k, each in enumerate(self.tests)]
        return finger, recordings, tests


def _write(file: Path, columns: Columns) -> Path:
    table: dict[str, Any] = {}
    for name, values in columns.items():
        single = {name: values} if values.ndim == 1 else {}
        table |= single or {f"{name}[{k + 1}]": values[:, k] for k in range(values.shape[1])}
    write_table(file, table)
    return file


def faults_of_refusal(message: str, given: list[Path]) -> Iterator[str]:
    """What is wrong with the sentence that refuses files."""
    if not any(file.name in message for file in given):
        yield f"names no file: {message}"
    if "expected" not in message and "; probably " not in message:  # a recording that does not belong: what to write
        yield f"does not say what was expected: {message}"
    if "\n" in message or CODE.search(message):
        yield f"is not one line of plain words: {message}"


# --- what is recorded -------------------------------------------------------------------------------------------------


def finger(rng: np.random.Generator) -> Description:
    """A random finger of one or two joints; half of them have extensions."""
    while True:
        seed = int(rng.integers(1, 10_000))
        found = random_finger(seed)
        if len(found["joints"]) < 3:
            return random_extended(seed, found) if rng.random() < 0.5 else found


def moved(rng: np.random.Generator, description: Description, seconds: float, rate: float) -> Columns:
    """A recording of free motion: sines of several speeds, pretension in steps, friction that grows with the force."""
    arms = np.array([tendon["moment_arms"] for tendon in description["tendons"]], dtype=float)
    joints = arms.shape[1]
    time = np.arange(round(seconds * rate)) / rate
    angle = np.zeros((len(time), joints))
    for j, part in product(range(joints), range(3)):
        speed = rng.uniform(0.3, 1.5) * (part + 1)
        angle[:, j] += rng.uniform(0.1, 0.4) * np.sin(speed * time + rng.uniform(0.0, 6.0))
    velocity = np.gradient(angle, time, axis=0)
    level = rng.uniform(5.0, 20.0, 4)[np.minimum((4 * time / seconds).astype(int), 3)]
    size = rng.uniform(0.002, 0.02, joints) + rng.uniform(0.0, 5e-4, joints) * level[:, None]
    torque = size * np.tanh(velocity / rng.uniform(0.01, 0.05)) + rng.uniform(0.0, 0.03, joints) * angle
    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    force = np.maximum(level[:, None] + torque @ np.linalg.pinv(arms), 0.0)
    force = force + 0.02 * rng.normal(size=force.shape)
    position = angle @ arms.T + force / stiffness + 1e-6 * rng.normal(size=force.shape)
    measured = angle + 1e-4 * rng.normal(size=angle.shape)
    groups = {"tendon_force": force, "tendon_position": position}
    return {"time": time, **groups, "joint_position": measured, "joint_velocity": velocity}


# --- what can be odd, by name -----------------------------------------------------------------------------------------

Quirk = Callable[[np.random.Generator, Pair], Any]
SENSORS = ("tendon_force", "tendon_position")
ENCODERS = ("joint_position", "joint_velocity")
QUIRKS: dict[str, Quirk] = {"nothing_odd": lambda rng, pair: None}


def quirk(change: Quirk) -> Quirk:
    QUIRKS[change.__name__] = change
    return change


def in_columns(change: Callable[[np.random.Generator, Columns], None]) -> None:
    """A quirk of every recording and test."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        for columns in pair.all:
            change(rng, columns)

    QUIRKS[change.__name__] = spoil


def scaled(*names: str, by: float, kinematics: int = 1) -> Quirk:
    """Columns in another unit, or with the other sign."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        pair.kinematics = kinematics
        for columns, name in product(pair.all, names):
            columns[name] *= by

    return spoil


def recorded(seconds: float, rate: float) -> Quirk:
    """One recording of another length and rate."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        pair.recordings, pair.tests = [moved(rng, pair.description, seconds, rate)], []

    return spoil


def described(**keys: Any) -> Quirk:
    return lambda rng, pair: pair.description.update(keys)


QUIRKS |= {
    "twenty_hertz": recorded(20.0, 20.0),
    "degrees_for_radians": scaled(*ENCODERS, by=180.0 / np.pi, kinematics=3),
    "forces_in_millinewtons": scaled("tendon_force", by=1e3),
    "absurdly_small": scaled("tendon_force", by=1e-200),
    "wrong_signs": scaled("tendon_position", by=-1.0),
    "threshold_zero": described(velocity_threshold={"tendon": 0.0, "joint": 0.0}),
    "noise_zero": described(bias={"noise_std": 0.0, "noise_std_per_force": 0.0}),
    "bias_eager": described(bias={"drift_variance": 1e3, "forget_rate": 0.0, "noise_time": 0.001}),
}


@quirk
def viscous_alone(rng: np.random.Generator, pair: Pair) -> None:
    law = {"static": 0.0, "coulomb": 0.0, "stribeck_velocity": 0.1, "viscous": 0.5}
    for joint in pair.description["joints"]:
        joint["friction"] = law


@quirk
def presliding_is_there(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["extensions"] = [
        {"effect": "presliding", "joint": 1, "displacement": 0.01},
        {"effect": "presliding", "tendon": 1, "displacement": 1e-4},
    ]


@quirk
def other_tendon_count(rng: np.random.Generator, pair: Pair) -> None:
    for columns, name in product(pair.all, SENSORS):
        columns[name] = np.hstack([columns[name]] * 2)


@quirk
def joints_not_measured(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = int(rng.integers(1, 4))
    for columns, name in product(pair.all, ENCODERS):
        columns.pop(name)


@in_columns
def slack_tendons(rng: np.random.Generator, columns: Columns) -> None:
    force = columns["tendon_force"]
    force[:, 0] -= 1.2 * np.median(force[:, 0])
    force[:, -1] *= rng.integers(0, 2)


@quirk
def stuck_sensor(rng: np.random.Generator, pair: Pair) -> None:
    name = str(rng.choice(["tendon_force", "tendon_position", "joint_position"]))
    for columns in pair.recordings:
        part = slice(len(columns["time"]) // 4, int(len(columns["time"]) * rng.uniform(0.4, 0.95)))
        columns[name][part, 0] = columns[name][part.start, 0]


@in_columns
def labelled_contact(rng: np.random.Generator, columns: Columns) -> None:
    columns["contact"] = (columns["time"] % 3.0 < 0.8).astype(float)
    columns["tendon_force"][:, 0] += 8.0 * columns["contact"]


@quirk
def hardly_free(rng: np.random.Generator, pair: Pair) -> None:
    """Free motion in moments only, or never."""
    for columns in pair.recordings:
        columns["contact"] = (columns["time"] % 1.0 > rng.choice([0.07, -1.0])).astype(float)


@in_columns
def late_clock_with_gaps(rng: np.random.Generator, columns: Columns) -> None:
    """A few of up to 100 s, or so many that some parts between them are too short to use."""
    columns["time"] += 1e9
    for start in np.unique(rng.integers(1, len(columns["time"]), rng.choice([3, 12]))):
        columns["time"][start:] += rng.choice([1.0, 100.0])


@quirk
def time_goes_back(rng: np.random.Generator, pair: Pair) -> None:
    time = pair.recordings[0]["time"]
    time[len(time) // 2] = time[len(time) // 2 - 1] - rng.choice([0.0, 0.5])


@quirk
def few_samples(rng: np.random.Generator, pair: Pair) -> None:
    count = int(rng.choice([1, 2, 5, 19, 20, 21, 40, 100]))
    pair.recordings = [{name: values[:count] for name, values in pair.recordings[0].items()}]


@quirk
def two_rates(rng: np.random.Generator, pair: Pair) -> None:
    pair.recordings.append(moved(rng, pair.description, 6.0, 400.0))


@quirk
def another_finger_in_the_test(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, finger(rng), 8.0, 100.0)]


@quirk
def a_tendon_that_moves_nothing(rng: np.random.Generator, pair: Pair) -> None:
    arms = [0.0] * len(pair.description["joints"])
    pair.description["tendons"].append({"name": "spare", "stiffness": 5000.0, "moment_arms": arms})
    for columns, name in product(pair.all, SENSORS):
        columns[name] = np.hstack([columns[name], columns[name][:, :1]])


def make_pair(name: str, seed: int = 0) -> Pair:
    """The pair of a quirk and a seed, always the same."""
    rng = np.random.default_rng([seed, list(QUIRKS).index(name), 20])
    description = finger(rng)
    rate = float(rng.choice([100.0, 200.0]))
    recordings = [moved(rng, description, rng.uniform(6.0, 16.0), rate)]
    tests = [moved(rng, description, rng.uniform(5.0, 10.0), rate)] if rng.random() < 0.5 else []
    pair = Pair(description, recordings, tests, name)
    QUIRKS[name](rng, pair)
    return pair
