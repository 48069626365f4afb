"""The bed `simulated`: fingers whose truth is exact, from simulators that share no code with the product.

`then` and `now` are the same finger (change_fingers.py) with one number changed in between, or none. `now` repeats the
motion exactly (other noise), is another motion, is shorter, or has another pretension. The description is the
simulator's, fitted to `then`.

Strength: variance of the torque that the change adds (the same `now` simulated with and without it, less the slow bias)
over that of what the description leaves of the unchanged `now`, at the joint where that is largest, rounded down to a
step of STEPS (change_visibility.py). Below the first of them nobody is asked to see it.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import change_fingers as fingers
import numpy_boucwen
import numpy_capstan
import numpy_karnopp
import numpy_maxwell
import numpy_tanh
from change_case import NOTHING, Case, Columns, Truth
from change_fingers import NO_CHANGE, Change, How, Recorded
from change_visibility import visible
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.files.tables import write_table

BED, MODEL = "simulated", "fitted"
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


@dataclass(frozen=True)
class Plan:
    """One case. effect: its name, nothing where none changes. size: of the change, in unit. others: names that
    are the truth as well."""

    simulator: str
    conditions: str
    effect: str = NOTHING
    joint: int | None = None
    tendon: int | None = None
    size: float = 0.0
    unit: str = ""
    change: Change = NO_CHANGE
    others: tuple[str, ...] = ()
    nameable: bool = True

    @property
    def sign(self) -> int:
        return int(np.sign(self.size))


def scaled(name: str, factor: float, *at: int, shape: tuple[int, ...] = ()) -> Change:
    """A number of the simulator times a factor, at one place of it (from 0). shape: where it is one for all places."""

    def numbers(simulator: Any) -> Mapping[str, Any]:
        values = np.array(getattr(simulator, name), dtype=np.float64) * np.ones(shape)
        values[at] *= factor
        return {name: values}

    return Change(numbers)


def put(**numbers: Any) -> Change:
    return Change(lambda simulator: numbers)


SHARE = "of what it was"
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
    Plan("tanh", "motion", "edge_friction", 1, 1, 0.3, SHARE, scaled("ENTRY", 1.3, 0, shape=(4,))),
    Plan("tanh", "repeat", "edge_friction", 1, 1, 0.1, SHARE, scaled("ENTRY", 1.1, 0, shape=(4,))),
    Plan("tanh", "repeat", "edge_friction", 2, 3, 0.3, SHARE, scaled("INNER", 1.3, 2, shape=(4,)),
         ("pulley_friction",)),
    Plan("tanh", "motion", "cover_stiffness", 1, None, 0.3, SHARE, scaled("COVER", 1.3, 0, shape=(2,))),
    Plan("tanh", "motion", "gravity", 1, None, 0.06, "N.m", Change(hidden="gravity")),
    Plan("tanh", "motion", "tendon_nonlinearity", None, 2, -0.3, SHARE, scaled("STIFFNESS", 0.7, 1, shape=(4,)),
         nameable=False),
    Plan("tanh", "repeat", "force_offset", None, 3, 1.0, "N", Change(offset=(3, 1.0))),
    Plan("karnopp", "motion", "joint_friction", 1, None, 0.3, SHARE, scaled("DRY", 1.3, 0)),
    Plan("karnopp", "repeat", "joint_friction", 2, None, 0.3, SHARE, scaled("DRY", 1.3, 1)),
    Plan("karnopp", "motion", "joint_load_friction", 1, None, 0.3, SHARE, scaled("LOADED", 1.3, 0), ("load_friction",)),
    Plan("karnopp", "length", "gravity", 2, None, 0.05, "N.m", Change(hidden="gravity")),
    Plan("maxwell", "motion", "edge_friction", 2, 3, 0.3, SHARE, scaled("SHARE", 1.3, 2, 1), ("pulley_friction",)),
    Plan("maxwell", "repeat", "edge_friction", 1, 5, 0.3, SHARE, scaled("SHARE", 1.3, 4, 0)),
    Plan("maxwell", "motion", "joint_coupling", 2, None, 0.05, "N.m/rad", Change(hidden="joint_coupling")),
    Plan("maxwell", "repeat", "friction_drift", None, None, 1.2, "1", Change(hidden="friction_drift"), GROWING),
    Plan("boucwen", "repeat", "edge_friction", 1, 1, 0.3, SHARE, scaled("SHARE", 1.3, 0)),
    Plan("boucwen", "motion", "edge_friction", 1, 3, -0.3, SHARE, scaled("SHARE", 0.7, 2)),
    Plan("boucwen", "motion", "cover_stiffness", 1, None, 0.035, "N.m/rad", Change(hidden="cover_stiffness")),
    Plan("boucwen", "motion", "pulley_eccentricity", 1, 2, 0.0025, "m", Change(hidden="pulley_eccentricity"),
         ("moment_arm_variation",)),
    Plan("capstan", "motion", "edge_friction", None, 2, 0.3, SHARE, scaled("MU", 1.3, 1, shape=(4,))),
    Plan("capstan", "repeat", "viscous_friction", None, None, 0.028, "N.m.s/rad", Change(hidden="viscous_friction")),
    Plan("capstan", "motion", "force_gain", None, 2, 0.12, "1", Change(hidden="force_gain"), ("moment_arm",)),
    Plan("capstan", "motion", "joint_load_friction", 1, None, 3e-4, "m", Change(hidden="joint_load_friction"),
         ("load_friction",)),
    Plan("mujoco", "motion", "joint_friction", 1, None, 0.3, SHARE, scaled("joint_friction", 1.3, 0)),
    Plan("mujoco", "pretension", "edge_friction", 2, 3, 0.3, SHARE, scaled("edge", 1.3, 2, 1), ("pulley_friction",)),
    Plan("mujoco", "repeat", "edge_friction", 1, 1, 0.1, SHARE, scaled("edge", 1.1, 0, 0)),
    Plan("mujoco", "motion", "gravity", 2, None, 0.05, "kg", put(heavy=(2,), load=0.05)),
    Plan("mujoco", "length", "cover_stiffness", 2, None, 0.3, SHARE, scaled("cover", 1.3, 1)),
    Plan("mujoco", "motion", "tendon_nonlinearity", None, 1, -0.3, SHARE, scaled("stiffness", 0.7, 0),
         nameable=False),
    Plan("mujoco", "repeat", "force_offset", None, 2, 1.5, "N", Change(offset=(2, 1.5))),
    Plan("mujoco", "pretension", "viscous_friction", 1, None, 0.01, "N.m.s/rad", put(damping=np.array([0.012, 0.002]))),
    Plan("mujoco", "motion", "cover_hardening", 2, None, 0.35, "N.m/rad3", put(hardening=(2, 0.35))),
)
# fmt: on
PLANS = (*QUIET, *CHANGED)
# what a description cannot say of a simulator, so that its size may differ from one motion to another (foreign README)
ALSO = {"tanh": ("stribeck",), "karnopp": ("inertia",), "capstan": ("asymmetric_friction",), "mujoco": ("inertia",)}


def recorder(plan: Plan) -> Callable[[Change, How], Recorded]:
    simulator = SIMULATORS[plan.simulator]
    if simulator is None:
        return fingers.record_mujoco
    return lambda change, how: fingers.record_numpy(simulator, change, how)


def described(plan: Plan) -> Mapping[str, Any]:
    simulator = SIMULATORS[plan.simulator]
    return fingers.describe_mujoco() if simulator is None else fingers.describe_numpy(simulator)


def ways(number: int, conditions: str) -> tuple[How, How]:
    """How `then` and `now` are recorded."""
    then = How(motion=10 * number, noise=10 * number, seconds=SECONDS)
    other = replace(then, noise=10 * number + 1)
    if conditions == "repeat":
        return then, other
    other = replace(other, motion=10 * number + 1)
    if conditions == "length":
        return then, replace(other, seconds=SHORT)
    return then, replace(other, pretension=PULLED) if conditions == "pretension" else other


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    plan = PLANS[number - 1]
    record = recorder(plan)
    then_how, now_how = ways(number, plan.conditions)
    then, quiet = record(NO_CHANGE, then_how), record(NO_CHANGE, now_how)
    finger = fitted(described(plan), then.columns)
    truth = Truth(
        number,
        BED,
        plan.simulator,
        MODEL,
        plan.effect,
        also=() if plan.conditions == "repeat" else ALSO.get(plan.simulator, ()),
        conditions=plan.conditions,
        samples=f"motion {now_how.motion}, {now_how.seconds:g} s against motion {then_how.motion}",
    )
    if plan.effect == NOTHING:
        return Case(truth, finger, (then.columns,), (quiet.columns,))
    now = record(plan.change, now_how)
    seen = visible(finger, quiet.columns, now.measured - quiet.measured)
    truth = replace(
        truth,
        effects=(plan.effect, *plan.others),
        joint=plan.joint,
        tendon=plan.tendon,
        signs={plan.effect: plan.sign},
        size=plan.size,
        unit=plan.unit,
        by="whole",
        whole=seen.whole,
        survives_now=seen.survives,
        strength=max((step for step in STEPS if step <= seen.whole), default=0.0),
        visible=plan.nameable and seen.whole >= STEPS[0],
    )
    return Case(truth, finger, (then.columns,), (now.columns,))


def fitted(nominal: Mapping[str, Any], columns: Columns) -> Mapping[str, Any]:
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        file = Path(scratch) / "then.parquet"
        write_table(file, dict(columns))
        fit = FrictionFit(nominal, threads=1, uncertainty=False).fit([file])
    found: Mapping[str, Any] = fit.description_.data
    return found


def makers() -> dict[int, Callable[[], Case]]:
    """By number, what makes the case."""
    return {number: partial(make, number) for number in range(1, len(PLANS) + 1)}
