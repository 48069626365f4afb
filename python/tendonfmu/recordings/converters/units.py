"""Which units a map of columns may name, each with its exact factor to SI: si = factor · value.

A metre of a sliding axis stands for a radian of a joint (see `one_joint`); no unit is both a length and an angle.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

POUND_FORCE = 4.4482216152605  # N, by definition
INCH = 0.0254  # m, by definition

TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": POUND_FORCE}
TORQUE = {
    "N.m": 1.0,
    "mN.m": 1e-3,
    "kN.m": 1e3,
    "N.mm": 1e-3,
    "N.cm": 1e-2,
    "kgf.cm": 9.80665e-2,
    "lbf.in": POUND_FORCE * INCH,
}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": INCH}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "turn": 2 * math.pi}
SPEED = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "m/min": 1.0 / 60}
ANGULAR_SPEED = {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": math.pi / 180, "rpm": 2 * math.pi / 60, "turn/s": 2 * math.pi}
NONE = {"1": 1.0}

# units in which each column of a recording may be given
OF_COLUMN = {
    "time": TIME,
    "tendon_force": FORCE,
    "tendon_position": LENGTH,
    "joint_position": ANGLE,
    "joint_velocity": ANGULAR_SPEED,
    "external_torque": TORQUE,
    "contact": NONE,
}


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the known names for a message, the most similar first, at most six."""
    names = list(known)
    folded = {each.casefold(): each for each in names}
    alike = [folded[each] for each in difflib.get_close_matches(name.casefold(), folded, n=3, cutoff=0.5)]
    listed = [*alike, *(each for each in names if each not in alike)]
    return ", ".join(listed[:6]) + (", ..." if len(listed) > 6 else "")
