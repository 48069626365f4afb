"""Cases of four simulators as users write them, a screen of numpy each; only noise and quantisation are shared."""

from __future__ import annotations

import dataclasses
from types import ModuleType

import numpy as np
import pandas as pd

from evidence.fingers import numpy_capstan, numpy_karnopp, numpy_maxwell, numpy_tanh
from evidence.fingers.foreign import TEST_SECONDS, TRAIN_SECONDS, Array, Case, Truth, frame

# What a simulator has although no description can say it in its laws; naming that is not false. Presliding is never
# false, in any case (evidence/diagnosis).
ALSO = {
    # Friction that fades in with tanh(v / vs) is the Stribeck effect of a negative amplitude.
    numpy_tanh: ("stribeck",),
    # Links have mass, 1 to 2 mN·m rms at a joint.
    numpy_karnopp: ("inertia",),
    # exp(−μφ) and exp(μφ) lose and gain different shares.
    numpy_capstan: ("asymmetric_friction",),
}


@dataclasses.dataclass(frozen=True)
class Plan:
    """One case: a simulator, what it hides, and where (from 1)."""

    simulator: ModuleType
    hidden: str
    joint: int | None = None
    tendon: int | None = None
    survives: float | None = None


PLANS = {  # by number; the missing ones were of a simulator that is gone
    1: Plan(numpy_tanh, "none"),
    2: Plan(numpy_karnopp, "none"),
    3: Plan(numpy_maxwell, "none"),
    5: Plan(numpy_capstan, "none"),
    6: Plan(numpy_tanh, "gravity", joint=1),
    7: Plan(numpy_karnopp, "gravity", joint=2, survives=0.00),
    8: Plan(numpy_maxwell, "edge_friction", joint=2, tendon=5),
    10: Plan(numpy_capstan, "viscous_friction"),
    11: Plan(numpy_tanh, "cover_hardening", joint=2),
    12: Plan(numpy_karnopp, "joint_friction", joint=2),
    13: Plan(numpy_maxwell, "friction_drift"),
    15: Plan(numpy_capstan, "force_gain", tendon=2),
    16: Plan(numpy_tanh, "time_delay"),
    17: Plan(numpy_karnopp, "unknown_hum", joint=1),
    18: Plan(numpy_maxwell, "joint_coupling", joint=2),
    20: Plan(numpy_capstan, "joint_load_friction", joint=1, survives=0.07),
    21: Plan(numpy_tanh, "none"),
    22: Plan(numpy_capstan, "unknown_catch", joint=2),
}
NUMBERS = tuple(PLANS)
SEED = 4200  # of motion and noise; the finger is that of its simulator


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    plan = PLANS[number]
    simulator = plan.simulator
    train = simulator.simulate(plan.hidden, TRAIN_SECONDS, np.random.default_rng((SEED, number, 1)))
    test = simulator.simulate(plan.hidden, TEST_SECONDS, np.random.default_rng((SEED, number, 2)))
    truth = Truth(plan.hidden, plan.joint, plan.tendon, ALSO.get(simulator, ()), plan.survives)
    return Case(simulator.describe(plan.hidden), recording(train), recording(test), truth)


def recording(made: dict[str, Array]) -> pd.DataFrame:
    return frame(made["time"] - made["time"][0], made["force"], made["position"], made.get("angle"))
