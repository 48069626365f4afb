"""How often does `diagnose --reference` name what has changed between two recordings, and how often a wrong change?

One number of a simulated finger has changed between two recordings, or none. The simulators share no code with the
product (evidence/fingers). `then` and `now` are the same finger; motion and noise have seeds of their own. The
description is the simulator's, fitted to `then`. Constants of the product were chosen on the cases of odd number; those
of even number judge it.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any, cast
from unittest import mock

import numpy as np
import pandas as pd

from evidence.cases import run_cases
from evidence.diagnosis.case import Case, diagnosed
from evidence.diagnosis.judge import Truth, judge
from evidence.fingers import foreign, numpy_capstan, numpy_cases, numpy_karnopp, numpy_maxwell, numpy_tanh
from evidence.fingers.foreign import Array
from evidence.part import Figures, Part
from evidence.table import Row, table
from tendonfmu.diagnosis.base import find_base
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.estimate import FitWarning, FrictionFit
from tendonfmu.model import read_finger
from tendonfmu.recordings import Held, prepare, read_recording
from tendonfmu.statistics.intervals import share

RATE = 250.0  # Hz, of the recordings: means of what the simulator samples
SEED = 1414
FORCE_NOISE = 0.02  # N, MuJoCo
POSITION_STEP, ANGLE_STEP = 1e-6, 1e-4  # m, rad, MuJoCo
SECONDS, SHORT = 30.0, 12.0
PULLED = 1.3  # of the usual pretension
STEPS = (0.03, 0.1, 0.3, 1.0, 3.0)  # strengths are rounded down to these
NUMPY = {"tanh": numpy_tanh, "karnopp": numpy_karnopp, "maxwell": numpy_maxwell, "capstan": numpy_capstan}
MUJOCO_JOINTS = 2
UNCHANGED = "nothing"


# --- recordings -------------------------------------------------------------------------------------------------------


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


def scaled(name: str, factor: float, *at: int, shape: tuple[int, ...] = ()) -> Difference:
    """A number of the simulator times a factor, at one place of it (from 0). shape: where it is one for all places."""

    def numbers(simulator: Any) -> Mapping[str, Any]:
        values = np.array(getattr(simulator, name), dtype=np.float64) * np.ones(shape)
        values[at] *= factor
        return {name: values}

    return Difference(numbers)


def put(**numbers: Any) -> Difference:
    return Difference(lambda simulator: numbers)


def by_name(hidden: str) -> Difference:
    return Difference(hidden=hidden)


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


def record(simulator: str, difference: Difference, how: How) -> tuple[pd.DataFrame, Array]:
    """Means of as many samples as make RATE of the simulator's rate: the recording, and [N, n] N·m, the torque of the
    noiseless forces as the sensors scale them."""
    frame, measured, arms = (
        _numpy(NUMPY[simulator], difference, how) if simulator in NUMPY else _mujoco(difference, how)
    )
    if difference.offset is not None:
        tendon, force = difference.offset
        frame[f"tendon_force[{tendon}]"] += force
        measured = measured + force * arms[tendon - 1]
    size = round(1.0 / (RATE * float(frame["time"].diff().median())))
    columns = {str(name): averaged(frame[name].to_numpy(dtype=np.float64), size) for name in frame}
    return pd.DataFrame(columns), averaged(measured, size)


def averaged(series: Array, size: int) -> Array:
    """Means of so many samples each; what is left at the end is left out."""
    blocks = len(series) // size
    return np.asarray(series[: blocks * size].reshape(blocks, size, *series.shape[1:]).mean(axis=1))


def _numpy(simulator: ModuleType, difference: Difference, how: How) -> tuple[pd.DataFrame, Array, Array]:
    streams = Streams(how, normals_of_motion=1 if simulator is numpy_maxwell else 0)
    with mock.patch.dict(vars(simulator), difference.numbers(simulator)):  # the module's constants
        made = simulator.simulate(difference.hidden, how.seconds, cast(np.random.Generator, streams))
    return numpy_cases.recording(made), made["measured"], simulator.ARMS


def _mujoco(difference: Difference, how: How) -> tuple[pd.DataFrame, Array, Array]:
    from evidence.fingers import mujoco_run  # not needed to list the parts

    physics, _ = mujoco_finger()
    physics = dataclasses.replace(physics, **difference.numbers(physics))
    motion = mujoco_run.random_motion(MUJOCO_JOINTS, np.random.default_rng([SEED, how.motion]))
    motion = dataclasses.replace(motion, pretension=how.pretension * motion.pretension)
    trace = mujoco_run.run(physics, motion, how.seconds, RATE)
    force = foreign.noisy(trace.force, FORCE_NOISE, np.random.default_rng([SEED, how.noise, 1]))
    position = foreign.quantised(trace.position, POSITION_STEP)
    frame = foreign.frame(trace.time, force, position, foreign.quantised(trace.angle, ANGLE_STEP))
    return frame, trace.force @ physics.arms, physics.arms


def mujoco_finger() -> tuple[Any, dict[str, Any]]:
    """Two joints, four tendons of constant arms; and its rough description."""
    from evidence.fingers import mujoco_cases

    plan = mujoco_cases.Plan("none", MUJOCO_JOINTS, rate=RATE)
    physics = mujoco_cases.finger(plan, np.random.default_rng([SEED, 2]))
    return physics, mujoco_cases.describe(physics, plan, np.random.default_rng([SEED, 3]))


def fitted(simulator: str, recording: pd.DataFrame) -> dict[str, Any]:
    """The simulator's description fitted to a recording."""
    start = NUMPY[simulator].describe("none") if simulator in NUMPY else mujoco_finger()[1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(start, kinematics=1, threads=1, uncertainty=False).fit([recording])
    return dict(fit.description_.data)


# --- cases ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plan:
    """One case. conditions: how `now` is recorded, against `then` (ways)."""

    simulator: str
    conditions: str
    effect: str = UNCHANGED  # its name
    joint: int | None = None
    tendon: int | None = None
    difference: Difference = NONE
    others: tuple[str, ...] = ()  # names that are the truth as well
    nameable: bool = True  # whether an effect of the list is what has changed


GROWING = ("edge_friction", "load_friction")
# fmt: off
PLANS = {  # by number; the missing ones were of a simulator that is gone
    1: Plan("tanh", "repeat"),
    2: Plan("tanh", "motion"),
    3: Plan("karnopp", "motion"),
    4: Plan("karnopp", "repeat"),
    5: Plan("maxwell", "repeat"),
    6: Plan("maxwell", "motion"),
    9: Plan("capstan", "length"),
    10: Plan("capstan", "motion"),
    11: Plan("mujoco", "motion"),
    12: Plan("mujoco", "pretension"),
    13: Plan("mujoco", "repeat"),
    14: Plan("mujoco", "length"),
    15: Plan("tanh", "motion", "edge_friction", 1, 1, scaled("ENTRY", 1.3, 0, shape=(4,))),
    16: Plan("tanh", "repeat", "edge_friction", 1, 1, scaled("ENTRY", 1.1, 0, shape=(4,))),
    17: Plan("tanh", "repeat", "edge_friction", 2, 3, scaled("INNER", 1.3, 2, shape=(4,)), ("pulley_friction",)),
    18: Plan("tanh", "motion", "cover_stiffness", 1, None, scaled("COVER", 1.3, 0, shape=(2,))),
    19: Plan("tanh", "motion", "gravity", 1, None, by_name("gravity")),
    20: Plan("tanh", "motion", "tendon_nonlinearity", None, 2, scaled("STIFFNESS", 0.7, 1, shape=(4,)), nameable=False),
    21: Plan("tanh", "repeat", "force_offset", None, 3, Difference(offset=(3, 1.0))),
    22: Plan("karnopp", "motion", "joint_friction", 1, None, scaled("DRY", 1.3, 0)),
    23: Plan("karnopp", "repeat", "joint_friction", 2, None, scaled("DRY", 1.3, 1)),
    24: Plan("karnopp", "motion", "joint_load_friction", 1, None, scaled("LOADED", 1.3, 0), ("load_friction",)),
    25: Plan("karnopp", "length", "gravity", 2, None, by_name("gravity")),
    26: Plan("maxwell", "motion", "edge_friction", 2, 3, scaled("SHARE", 1.3, 2, 1), ("pulley_friction",)),
    27: Plan("maxwell", "repeat", "edge_friction", 1, 5, scaled("SHARE", 1.3, 4, 0)),
    28: Plan("maxwell", "motion", "joint_coupling", 2, None, by_name("joint_coupling")),
    29: Plan("maxwell", "repeat", "friction_drift", None, None, by_name("friction_drift"), GROWING),
    34: Plan("capstan", "motion", "edge_friction", None, 2, scaled("MU", 1.3, 1, shape=(4,))),
    35: Plan("capstan", "repeat", "viscous_friction", None, None, by_name("viscous_friction")),
    36: Plan("capstan", "motion", "force_gain", None, 2, by_name("force_gain"), ("moment_arm",)),
    37: Plan("capstan", "motion", "joint_load_friction", 1, None, by_name("joint_load_friction"), ("load_friction",)),
    38: Plan("mujoco", "motion", "joint_friction", 1, None, scaled("joint_friction", 1.3, 0)),
    39: Plan("mujoco", "pretension", "edge_friction", 2, 3, scaled("edge", 1.3, 2, 1), ("pulley_friction",)),
    40: Plan("mujoco", "repeat", "edge_friction", 1, 1, scaled("edge", 1.1, 0, 0)),
    41: Plan("mujoco", "motion", "gravity", 2, None, put(heavy=(2,), load=0.05)),
    42: Plan("mujoco", "length", "cover_stiffness", 2, None, scaled("cover", 1.3, 1)),
    43: Plan("mujoco", "motion", "tendon_nonlinearity", None, 1, scaled("stiffness", 0.7, 0), nameable=False),
    44: Plan("mujoco", "repeat", "force_offset", None, 2, Difference(offset=(2, 1.5))),
    45: Plan("mujoco", "pretension", "viscous_friction", 1, None, put(damping=np.array([0.012, 0.002]))),
    46: Plan("mujoco", "motion", "cover_hardening", 2, None, put(hardening=(2, 0.35))),
}
# fmt: on
# What a description cannot say of a simulator, so that its size may differ from one motion to another.
ALSO = {"tanh": ("stribeck",), "karnopp": ("inertia",), "capstan": ("asymmetric_friction",), "mujoco": ("inertia",)}


def ways(number: int, conditions: str) -> tuple[How, How]:
    """How `then` and `now` are recorded: the same motion, another one, a shorter one, or at another pretension."""
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


def make(number: int) -> tuple[Case, float]:
    """The case of a number, and the strength of its change."""
    plan = PLANS[number]
    then_how, now_how = ways(number, plan.conditions)
    then, _ = record(plan.simulator, NONE, then_how)
    now, unchanged = record(plan.simulator, NONE, now_how)
    finger, strength = fitted(plan.simulator, then), 0.0
    truth = Truth(allowed=() if plan.conditions == "repeat" else ALSO.get(plan.simulator, ()))
    if plan.effect != UNCHANGED:
        quiet = now
        now, changed = record(plan.simulator, plan.difference, now_how)
        ratio = visible(finger, quiet, changed - unchanged)
        strength = max((step for step in STEPS if step <= ratio), default=0.0)
        truth = replace(
            truth,
            effects=(plan.effect, *plan.others),
            joint=plan.joint,
            tendon=plan.tendon,
            visible=plan.nameable and ratio >= STEPS[0],
        )
    return Case(finger, now, truth, reference=then), strength


def visible(finger: Mapping[str, Any], recording: pd.DataFrame, added: Array) -> float:
    """Variance of an added torque [N, n], less its mean, over that of what the finger leaves of the recording, at
    the joint where it is largest; by the product's residual."""
    given = read_finger(finger)
    prepared = prepare(given, read_recording(recording), 1, Held())
    base = find_base(given, [prepared], FitSettings(threads=1), 0.03)
    torque = base.samples.drift.without(base.samples.grid.means([added]))
    return float(
        np.max(torque.var(axis=0) / base.samples.drift.without(base.samples.left(base.model.data)).var(axis=0))
    )


def run_case(number: int) -> Row:
    case, strength = make(number)
    report, seconds = diagnosed(case)
    plan = PLANS[number]
    return {
        "number": number,
        "simulator": plan.simulator,
        "conditions": plan.conditions,
        "effect": plan.effect,
        "strength": strength,
        "named": [cause["effect"] for cause in report["causes"]],
        **judge(report["causes"], case.truth),
        "seconds": round(seconds, 1),
    }


# --- figures and tables -----------------------------------------------------------------------------------------------

LINES: dict[str, Callable[[Row], bool]] = {
    "nothing changed": lambda row: row["effect"] == UNCHANGED,
    "strength 1 and 3": lambda row: row["right"] is not None and row["strength"] >= 1.0,
    "strength 0.3": lambda row: row["right"] is not None and row["strength"] == 0.3,
    "strength 0.03 and 0.1": lambda row: row["right"] is not None and row["strength"] <= 0.1,
    "weaker, or without a name": lambda row: row["effect"] != UNCHANGED and row["right"] is None,
}


def measure(folder: Path, workers: int) -> Figures:
    rows = run_cases(run_case, {f"{number:02d}": (number,) for number in PLANS}, folder, workers)
    even, odd = ([row for row in rows if row["number"] % 2 == half] for half in (0, 1))
    strong = counts(even)["strength 1 and 3"]
    share_named = strong["right"] / strong["cases"]
    return {"strong_named": share_named, "even": counts(even), "odd": counts(odd), "cases": rows}


def counts(rows: Sequence[Row]) -> dict[str, Any]:
    """How many cases a line of the table has, with the true cause (null: nobody asks), and with a wrong one."""
    groups = {name: [row for row in rows if belongs(row)] for name, belongs in LINES.items()}
    return {
        name: {
            "cases": len(members),
            "right": sum(row["right"] for row in members) if any(row["right"] is not None for row in members) else None,
            "wrong": sum(bool(row["wrong"]) for row in members),
        }
        for name, members in groups.items()
    }


def counts_table(figures: Figures) -> str:
    lines = [
        [name, line["cases"], _of(line["right"], line["cases"]), _of(line["wrong"], line["cases"])]
        for name, line in figures["even"].items()
    ]
    return table(["even cases", "cases", "true cause named", "a wrong cause"], lines)


def _of(hits: int | None, cases: int) -> str:
    if hits is None or not cases:
        return ""
    known = share(hits, cases)
    return f"{hits} ({100 * known.low:.0f}–{100 * known.high:.0f} %)"


PARTS = {
    "simulated": Part(
        run=measure,
        minutes=80.0,
        needs=("mujoco",),
        headlines={"even.nothing changed.wrong": (0, 0), "strong_named": (0.8, 1.0)},
        tables={"counts": counts_table},
    )
}
