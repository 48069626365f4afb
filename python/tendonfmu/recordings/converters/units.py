"""Which units a map of columns may name, each with its factor to SI: si = factor · value.

The tables hold the common units with their exact factors. Any other name is looked up in pint, which is part of the
extra `logs` and takes most of a second to import; the common units work without it. Angles are kept apart from plain
numbers, and no unit is both a length and an angle. A metre of a sliding axis stands for a radian (see `one_joint`).
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from typing import Any

from tendonfmu.files import require_extra

POUND_FORCE = 4.4482216152605  # N, by definition
INCH = 0.0254  # m, by definition

TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "gf": 9.80665e-3, "lbf": POUND_FORCE}
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

# Units of time that are points in time. `datetime` is a text, or a field that its format declares a time.
STAMPS = {"epoch_s": 10**9, "epoch_ms": 10**6, "epoch_us": 10**3, "epoch_ns": 1, "datetime": 1}  # ns per unit

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

# name in the tables: what loggers and engineers write
_SPELLINGS = {
    "s": "sec secs second seconds [s]",
    "ms": "msec millis millisecond milliseconds",
    "us": "usec micros microsecond µs μs microseconds",
    "ns": "nsec nanoseconds",
    "min": "minutes",
    "N": "newton newtons Newton",
    "kgf": "kg-force",
    "N.m": "Nm N*m N·m N-m",
    "mN.m": "mNm mN*m mN·m",
    "N.mm": "Nmm N*mm N·mm",
    "N.cm": "Ncm N*cm",
    "kgf.cm": "kgfcm kgcm kg.cm",
    "lbf.in": "inlbf in.lbf",
    "m": "meter metre meters metres",
    "mm": "millimeter millimetre millimeters millimetres",
    "um": "µm μm",
    "inch": "in inches",
    "rad": "radian radians",
    "deg": "° degree degrees",
    "turn": "rev revolution revolutions turns",
    "turn/s": "rps rev/s",
    "deg/s": "°/s degree/s degrees/s deg/sec",
    "rad/s": "rad/sec",
    "rpm": "RPM 1/min rev/min",
    "m/s": "mps",
}
ALIASES = {"N m": "N.m"} | {alias: name for name, aliases in _SPELLINGS.items() for alias in aliases.split()}

QUANTITIES = {
    "time": TIME,
    "force": FORCE,
    "torque": TORQUE,
    "length": LENGTH,
    "angle": ANGLE,
    "speed": SPEED,
    "angular speed": ANGULAR_SPEED,
}


def factor(name: str, known: Mapping[str, float]) -> float | None:
    """Return the factor of a unit to SI."""
    usual = ALIASES.get(name, name)
    if usual in known:
        return known[usual]
    if known is NONE or any(usual in table for table in QUANTITIES.values()):
        return None
    return _factor_by_pint(name, si_of(known))


def si_of(known: Mapping[str, float]) -> str:
    """Return the name of the SI unit in a table."""
    return next(unit for unit, value in known.items() if value == 1.0)


def quantity(name: str) -> tuple[str, str] | None:
    """Return (name in the tables, quantity) of a common unit, or None."""
    usual = ALIASES.get(name, name)
    for what, table in QUANTITIES.items():
        if usual in table:
            return usual, what
    return None


def stated(name: str, unit: str) -> tuple[str, str, str] | None:
    """Return (unit, quantity, where) that a log states for a field, in its unit or its name, or None."""
    if unit and (known := quantity(unit.strip(" []()"))):
        return (*known, f"the log states {unit!r}")
    for text in re.findall(r"[\[(]\s*([^\])]+?)\s*[\])]", name):
        if known := quantity(text):
            return (*known, f"the name says [{text}]")
    if (whole := quantity(name.lower())) and whole[1] == "time" and len(name) > 3:
        return (*whole, f"the name is {name}")
    for text in reversed(re.split(r"[_ /]|(?<=[a-z])\.(?=[a-z])", name)[1:]):
        known = quantity(text)
        # single letters and words such as "in" and "min" mean many things; N and s at the end of a name do not
        if known and (len(text) > 1 or text in ("N", "s", "m")) and text not in ("in", "min", "us", "s2"):
            return (*known, f"the name ends in {text}") if name.endswith(text) else None
    return None


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def _factor_by_pint(name: str, reference: str) -> float | None:
    """Return the factor to `reference`, or None. Root units keep the radian, which has no dimension, apart from 1."""
    require_extra("pint", f"unit {name!r}")
    registry = _registry()
    try:
        given = registry.Quantity(1.0, registry.parse_units(name)).to_root_units()
    except Exception:  # pint raises errors of its parser and of Python's tokenizer for texts that are no unit
        return None
    wanted = registry.Quantity(1.0, registry.parse_units(reference.replace(".", "*"))).to_root_units()
    if given.units != wanted.units:
        return None
    value = float(given.magnitude / wanted.magnitude)
    return value if math.isfinite(value) and value > 0.0 else None
