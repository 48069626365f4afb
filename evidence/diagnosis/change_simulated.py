"""Changes of simulated fingers whose truth is exact, from simulators that share no code with the product.

`then` and `now` are the same finger with one number changed in between, or none: README.md. Motion and noise have seeds
of their own. The description is the simulator's, fitted to `then`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast
from unittest import mock

import numpy as np
import pandas as pd

from evidence.diagnosis.case import Case
from evidence.diagnosis.change_measured import UNCHANGED, Makers, fitted, thinned
from evidence.diagnosis.measured import Array, Columns
from evidence.fingers import (
    foreign,
    mujoco_cases,
    mujoco_run,
    numpy_boucwen,
    numpy_capstan,
    numpy_cases,
    numpy_karnopp,
    numpy_maxwell,
    numpy_tanh,
)
from evidence.fingers.matched_strength import averaged
from evidence.fingers.mujoco_model import Physics
from evidence.judge import Truth
from evidence.runner import write
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.signal_choice import choose
from tendonfmu.diagnosis.view import look
from tendonfmu.files.tables import write_table
from tendonfmu.model import read_finger
from tendonfmu.recordings import Held, prepare, read_recording
from tendonfmu.statistics.splines import residual_of

RATE = 250.0  # Hz, of the recordings: means of what the simulator samples
SEED = 1414
FORCE_NOISE = 0.02  # N, MuJoCo
POSITION_STEP, ANGLE_STEP = 1e-6, 1e-4  # m, rad, MuJoCo
SECONDS, SHORT = 30.0, 12.0
PULLED = 1.3  # of the usual pretension
STEPS = (0.03, 0.1, 0.3, 1.0, 3.0)
SIMULATORS: Mapping[str, ModuleType | None] = {
    "tanh": numpy_tanh,
    "karnopp": numpy_karnopp,
    "maxwell": numpy_maxwell,
    "boucwen": numpy_boucwen,
    "capstan": numpy_capstan,
    "mujoco": None,
}
MUJOCO = mujoco_cases.Plan("none", 2, rate=RATE)  # two joints, four tendons of constant arms


# --- recordings -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recorded:
    columns: Columns
    measured: Array  # [N, n] N·m, torque of the noiseless forces as the sensors scale them


@dataclass(frozen=True)
class How:
    """What a recording is taken under."""

    motion: int  # seed
    noise: int  # seed
    seconds: float
    pretension: float = 1.0  # of the usual, MuJoCo only


@dataclass(frozen=True)
class Difference:
    """What differs between then and now."""

    numbers: Callable[[Any], Mapping[str, Any]] = lambda simulator: {}  # of the simulator
    hidden: str = "none"  # a word that a numpy simulator knows
    offset: tuple[int, float] | None = None  # N on the sensor of a tendon (from 1)


NONE = Difference()


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


def record(simulator: ModuleType | None, difference: Difference, how: How) -> Recorded:
    """Means of as many samples as make RATE of the simulator's rate."""
    frame, measured, arms = _mujoco(difference, how) if simulator is None else _numpy(simulator, difference, how)
    columns = {str(name): frame[name].to_numpy(dtype=np.float64) for name in frame}
    if difference.offset is not None:
        tendon, force = difference.offset
        columns[f"tendon_force[{tendon}]"] = columns[f"tendon_force[{tendon}]"] + force
        measured = measured + force * arms[tendon - 1]
    to_one = round(1.0 / (RATE * float(np.median(np.diff(columns["time"])))))
    return Recorded(thinned(columns, to_one), averaged(measured, to_one))


def _numpy(simulator: ModuleType, difference: Difference, how: How) -> tuple[Any, Array, Array]:
    streams = Streams(how, normals_of_motion=1 if simulator is numpy_maxwell else 0)
    with mock.patch.dict(vars(simulator), difference.numbers(simulator)):  # the module's constants
        made = simulator.simulate(difference.hidden, how.seconds, cast(np.random.Generator, streams))
    return numpy_cases.recording(made), made["measured"], simulator.ARMS


def _mujoco(difference: Difference, how: How) -> tuple[Any, Array, Array]:
    physics = mujoco_finger()
    physics = dataclasses.replace(physics, **difference.numbers(physics))
    motion = mujoco_run.random_motion(MUJOCO.joints, np.random.default_rng([SEED, how.motion]))
    motion = dataclasses.replace(motion, pretension=how.pretension * motion.pretension)
    trace = mujoco_run.run(physics, foreign.Truth("none", MUJOCO.joints), motion, how.seconds, RATE)
    force = foreign.noisy(trace.force, FORCE_NOISE, np.random.default_rng([SEED, how.noise, 1]))
    position = foreign.quantised(trace.position, POSITION_STEP)
    frame = foreign.frame(trace.time, force, position, foreign.quantised(trace.angle, ANGLE_STEP))
    return frame, trace.force @ physics.arms, physics.arms


def mujoco_finger() -> Physics:
    return mujoco_cases.finger(MUJOCO, np.random.default_rng([SEED, 2]))


def described(simulator: ModuleType | None) -> Mapping[str, Any]:
    if simulator is None:
        return mujoco_cases.describe(mujoco_finger(), MUJOCO, np.random.default_rng([SEED, 3]))
    nominal: Mapping[str, Any] = simulator.describe("none")
    return nominal


# --- cases ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plan:
    """One case."""

    simulator: str
    conditions: str
    effect: str = UNCHANGED  # its name
    joint: int | None = None
    tendon: int | None = None
    size: float = 0.0  # of the change: a share of what it was, or in SI units
    difference: Difference = NONE
    others: tuple[str, ...] = ()  # names that are the truth as well
    nameable: bool = True


def scaled(name: str, factor: float, *at: int, shape: tuple[int, ...] = ()) -> Difference:
    """A number of the simulator times a factor, at one place of it (from 0). shape: where it is one for all places."""

    def numbers(simulator: Any) -> Mapping[str, Any]:
        values = np.array(getattr(simulator, name), dtype=np.float64) * np.ones(shape)
        values[at] *= factor
        return {name: values}

    return Difference(numbers)


def put(**numbers: Any) -> Difference:
    return Difference(lambda simulator: numbers)


GROWING = ("edge_friction", "load_friction")
QUIET = tuple(
    Plan(simulator, conditions)
    for simulator, *several in (
        ("tanh", "repeat", "motion"),
        ("karnopp", "motion", "repeat"),
        ("maxwell", "repeat", "motion"),
        ("boucwen", "motion", "length"),
        ("capstan", "length", "motion"),
        ("mujoco", "motion", "pretension", "repeat", "length"),
    )
    for conditions in several
)
# fmt: off
CHANGED = (
    Plan("tanh", "motion", "edge_friction", 1, 1, 0.3, scaled("ENTRY", 1.3, 0, shape=(4,))),
    Plan("tanh", "repeat", "edge_friction", 1, 1, 0.1, scaled("ENTRY", 1.1, 0, shape=(4,))),
    Plan("tanh", "repeat", "edge_friction", 2, 3, 0.3, scaled("INNER", 1.3, 2, shape=(4,)), ("pulley_friction",)),
    Plan("tanh", "motion", "cover_stiffness", 1, None, 0.3, scaled("COVER", 1.3, 0, shape=(2,))),
    Plan("tanh", "motion", "gravity", 1, None, 0.06, Difference(hidden="gravity")),
    Plan("tanh", "motion", "tendon_nonlinearity", None, 2, -0.3, scaled("STIFFNESS", 0.7, 1, shape=(4,)),
         nameable=False),
    Plan("tanh", "repeat", "force_offset", None, 3, 1.0, Difference(offset=(3, 1.0))),
    Plan("karnopp", "motion", "joint_friction", 1, None, 0.3, scaled("DRY", 1.3, 0)),
    Plan("karnopp", "repeat", "joint_friction", 2, None, 0.3, scaled("DRY", 1.3, 1)),
    Plan("karnopp", "motion", "joint_load_friction", 1, None, 0.3, scaled("LOADED", 1.3, 0), ("load_friction",)),
    Plan("karnopp", "length", "gravity", 2, None, 0.05, Difference(hidden="gravity")),
    Plan("maxwell", "motion", "edge_friction", 2, 3, 0.3, scaled("SHARE", 1.3, 2, 1), ("pulley_friction",)),
    Plan("maxwell", "repeat", "edge_friction", 1, 5, 0.3, scaled("SHARE", 1.3, 4, 0)),
    Plan("maxwell", "motion", "joint_coupling", 2, None, 0.05, Difference(hidden="joint_coupling")),
    Plan("maxwell", "repeat", "friction_drift", None, None, 1.2, Difference(hidden="friction_drift"), GROWING),
    Plan("boucwen", "repeat", "edge_friction", 1, 1, 0.3, scaled("SHARE", 1.3, 0)),
    Plan("boucwen", "motion", "edge_friction", 1, 3, -0.3, scaled("SHARE", 0.7, 2)),
    Plan("boucwen", "motion", "cover_stiffness", 1, None, 0.035, Difference(hidden="cover_stiffness")),
    Plan("boucwen", "motion", "pulley_eccentricity", 1, 2, 0.0025, Difference(hidden="pulley_eccentricity"),
         ("moment_arm_variation",)),
    Plan("capstan", "motion", "edge_friction", None, 2, 0.3, scaled("MU", 1.3, 1, shape=(4,))),
    Plan("capstan", "repeat", "viscous_friction", None, None, 0.028, Difference(hidden="viscous_friction")),
    Plan("capstan", "motion", "force_gain", None, 2, 0.12, Difference(hidden="force_gain"), ("moment_arm",)),
    Plan("capstan", "motion", "joint_load_friction", 1, None, 3e-4, Difference(hidden="joint_load_friction"),
         ("load_friction",)),
    Plan("mujoco", "motion", "joint_friction", 1, None, 0.3, scaled("joint_friction", 1.3, 0)),
    Plan("mujoco", "pretension", "edge_friction", 2, 3, 0.3, scaled("edge", 1.3, 2, 1), ("pulley_friction",)),
    Plan("mujoco", "repeat", "edge_friction", 1, 1, 0.1, scaled("edge", 1.1, 0, 0)),
    Plan("mujoco", "motion", "gravity", 2, None, 0.05, put(heavy=(2,), load=0.05)),
    Plan("mujoco", "length", "cover_stiffness", 2, None, 0.3, scaled("cover", 1.3, 1)),
    Plan("mujoco", "motion", "tendon_nonlinearity", None, 1, -0.3, scaled("stiffness", 0.7, 0), nameable=False),
    Plan("mujoco", "repeat", "force_offset", None, 2, 1.5, Difference(offset=(2, 1.5))),
    Plan("mujoco", "pretension", "viscous_friction", 1, None, 0.01, put(damping=np.array([0.012, 0.002]))),
    Plan("mujoco", "motion", "cover_hardening", 2, None, 0.35, put(hardening=(2, 0.35))),
)
# fmt: on
PLANS = (*QUIET, *CHANGED)
# What a description cannot say of a simulator, so that its size may differ from one motion to another.
ALSO = {"tanh": ("stribeck",), "karnopp": ("inertia",), "capstan": ("asymmetric_friction",), "mujoco": ("inertia",)}


def ways(number: int, conditions: str) -> tuple[How, How]:
    """How `then` and `now` are recorded."""
    then = How(motion=10 * number, noise=10 * number, seconds=SECONDS)
    repeat = replace(then, noise=10 * number + 1)
    other = replace(repeat, motion=10 * number + 1)
    now = {
        "repeat": repeat,
        "motion": other,
        "length": replace(other, seconds=SHORT),
        "pretension": replace(other, pretension=PULLED),
    }
    return then, now[conditions]


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    plan = PLANS[number - 1]
    simulator = SIMULATORS[plan.simulator]
    then_how, now_how = ways(number, plan.conditions)
    then, quiet = record(simulator, NONE, then_how), record(simulator, NONE, now_how)
    finger = fitted(described(simulator), [then.columns])
    now, strength = quiet, 0.0
    truth = Truth(allowed=() if plan.conditions == "repeat" else ALSO.get(plan.simulator, ()))
    if plan.effect != UNCHANGED:
        now = record(simulator, plan.difference, now_how)
        ratio = visible(finger, quiet.columns, now.measured - quiet.measured)
        strength = max((step for step in STEPS if step <= ratio), default=0.0)
        truth = replace(
            truth,
            effects=(plan.effect, *plan.others),
            joint=plan.joint,
            tendon=plan.tendon,
            signs={plan.effect: int(np.sign(plan.size))},
            visible=plan.nameable and ratio >= STEPS[0],
        )
    known = {"machine": plan.simulator, "model": "fitted", "hidden": plan.effect, "conditions": plan.conditions}
    recordings, reference = [pd.DataFrame(now.columns)], [pd.DataFrame(then.columns)]
    facts = known | {"strength": strength}
    return Case(plan.simulator, finger, recordings, truths=(truth,), reference=reference, facts=facts)


def makers() -> Makers:
    return {number: partial(make, number) for number in range(1, len(PLANS) + 1)}


def visible(finger: Mapping[str, Any], recording: Columns, added: Array) -> float:
    """Variance of an added torque [N, n], less the slow bias, over that of what the finger leaves of the recording, at
    the joint where it is largest. The judge's own computation, by the product's residual."""
    given = read_finger(finger)
    prepared = prepare(given, read_recording(pd.DataFrame(recording)), 1, Held())
    chosen = choose(given, [prepared], FitSettings(threads=1))
    view = look(chosen.model.data, chosen.recordings, chosen.grid, chosen.least, candidates=())
    used = view.series.used
    # the recording may begin at another time after its signals are prepared, and has other samples then
    time = chosen.recordings[0].time
    there = np.column_stack([np.interp(time - time[0], recording["time"] - recording["time"][0], c) for c in added.T])
    blocks = np.concatenate([segment.mean(there[segment.part]) for segment in chosen.grid.segments])
    torque = residual_of(replace(view.series, target=blocks), view.splines, view.columns.nominal[:, :, :0])
    return float(np.max(torque[used].var(axis=0) / view.residual[used].var(axis=0)))


# --- a trend: dated recordings of a finger in numpy, the friction of one edge higher from each to the next ------------

DAYS = ("2026-03-01", "2026-03-08", "2026-03-15", "2026-03-22", "2026-04-05", "2026-04-12")
GROWTH = 0.06  # of the friction of tendon 5's edge at joint 1, from one recording to the next


def write_history(folder: Path) -> None:
    """The description fitted to the first recording, and all recordings."""
    for k, day in enumerate(DAYS):
        difference = scaled("SHARE", 1.0 + GROWTH * k, 4, 0) if k else NONE
        columns = record(numpy_maxwell, difference, How(motion=100 + k, noise=200 + k, seconds=SECONDS)).columns
        write_table(folder / f"{day}.parquet", dict(columns))
        if not k:
            write(folder / "finger.json", fitted(described(numpy_maxwell), [columns]))
