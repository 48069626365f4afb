"""Fingers of simulators that share no code with the product, recorded with one number changed.

The simulators are those of python_tests/foreign. Five in numpy: their numbers are the constants of a module, replaced
while it runs. One in MuJoCo: its numbers are a `Physics`. Motion and noise come from streams of their own, so that a
motion can be repeated exactly under other noise.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign"))

import fingers_in_mujoco
import fingers_in_numpy
import foreign_case
import mujoco_run
import numpy_maxwell
from change_case import Array, Columns
from mujoco_model import Physics

RATE = 250.0  # Hz, of the recordings: means of what the simulator samples
SEED = 1414
FORCE_NOISE = 0.02  # N, MuJoCo
POSITION_STEP, ANGLE_STEP = 1e-6, 1e-4  # m, rad, MuJoCo

Numbers = Mapping[str, Any]


@dataclasses.dataclass(frozen=True)
class Recorded:
    """columns: of the recording. measured: [N, n] N·m, torque of the noiseless forces as the sensors scale them."""

    columns: Columns
    measured: Array


@dataclasses.dataclass(frozen=True)
class How:
    """What a recording is taken under. motion, noise: seeds. pretension: of the usual, MuJoCo only."""

    motion: int
    noise: int
    seconds: float
    pretension: float = 1.0


@dataclasses.dataclass(frozen=True)
class Change:
    """numbers: of the simulator, that differ; hidden: a word that a numpy simulator knows. offset: N on the sensor of a
    tendon (from 1)."""

    numbers: Callable[[Any], Numbers] = lambda simulator: {}
    hidden: str = "none"
    offset: tuple[int, float] | None = None


NO_CHANGE = Change()


class Streams:
    """A random generator for a simulator: `uniform` from the motion's stream, noise from the other; the first so many
    normal numbers are motion, too."""

    def __init__(self, how: How, normals_of_motion: int) -> None:
        self.motion = np.random.default_rng([SEED, how.motion])
        self.noise = np.random.default_rng([SEED, how.noise, 1])
        self.normals_of_motion = normals_of_motion

    def uniform(self, *given: Any) -> Any:
        return self.motion.uniform(*given)

    def standard_normal(self, *given: Any) -> Any:
        self.normals_of_motion -= 1
        return (self.motion if self.normals_of_motion >= 0 else self.noise).standard_normal(*given)


@contextmanager
def with_numbers(simulator: ModuleType, numbers: Numbers) -> Iterator[None]:
    """The module's constants are these inside."""
    before = {name: getattr(simulator, name) for name in numbers}
    try:
        for name, value in numbers.items():
            setattr(simulator, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(simulator, name, value)


def record_numpy(simulator: ModuleType, change: Change, how: How) -> Recorded:
    streams = Streams(how, normals_of_motion=1 if simulator is numpy_maxwell else 0)
    with with_numbers(simulator, change.numbers(simulator)):
        made = simulator.simulate(change.hidden, how.seconds, cast(np.random.Generator, streams))
    frame = fingers_in_numpy.recording(made)
    columns = {str(name): frame[name].to_numpy(dtype=np.float64) for name in frame}
    return thinned(with_offset(columns, change), with_offset_torque(made["measured"], simulator.ARMS, change))


def describe_numpy(simulator: ModuleType) -> Mapping[str, Any]:
    return cast(Mapping[str, Any], simulator.describe("none"))


# --- MuJoCo -----------------------------------------------------------------------------------------------------------

PLAN = fingers_in_mujoco.Plan("none", 2, rate=RATE)


def mujoco_finger() -> Physics:
    """Two joints, four tendons of constant arms."""
    return fingers_in_mujoco.finger(PLAN, np.random.default_rng([SEED, 2]))


def describe_mujoco() -> Mapping[str, Any]:
    return cast(Mapping[str, Any], fingers_in_mujoco.describe(mujoco_finger(), PLAN, np.random.default_rng([SEED, 3])))


def record_mujoco(change: Change, how: How) -> Recorded:
    physics = mujoco_finger()
    physics = dataclasses.replace(physics, **change.numbers(physics))
    motion = mujoco_run.random_motion(PLAN.joints, np.random.default_rng([SEED, how.motion]))
    motion = dataclasses.replace(motion, pretension=how.pretension * motion.pretension)
    trace = mujoco_run.run(physics, foreign_case.Truth("none", PLAN.joints), motion, how.seconds, RATE)
    noise = np.random.default_rng([SEED, how.noise, 1])
    force = foreign_case.noisy(trace.force, FORCE_NOISE, noise)
    position = foreign_case.quantised(trace.position, POSITION_STEP)
    frame = foreign_case.frame(trace.time, force, position, foreign_case.quantised(trace.angle, ANGLE_STEP))
    columns = {str(name): frame[name].to_numpy(dtype=np.float64) for name in frame}
    measured = with_offset_torque(trace.force @ physics.arms, physics.arms, change)
    return thinned(with_offset(columns, change), measured)


# --- sensors ----------------------------------------------------------------------------------------------------------


def with_offset(columns: Columns, change: Change) -> Columns:
    if change.offset is None:
        return columns
    name = f"tendon_force[{change.offset[0]}]"
    return dict(columns) | {name: columns[name] + change.offset[1]}


def with_offset_torque(measured: Array, arms: Array, change: Change) -> Array:
    return measured if change.offset is None else measured + change.offset[1] * arms[change.offset[0] - 1]


def thinned(columns: Columns, measured: Array) -> Recorded:
    """Means of as many samples as make RATE of the simulator's rate."""
    to_one = round(1.0 / (RATE * float(np.median(np.diff(columns["time"])))))
    rows = len(measured) // to_one * to_one

    def mean(values: Array) -> Array:
        return np.asarray(values[:rows].reshape(-1, to_one, *values.shape[1:]).mean(axis=1))

    return Recorded({name: mean(values) for name, values in columns.items()}, mean(measured))
