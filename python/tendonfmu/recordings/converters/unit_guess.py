"""Which unit a signal is in: by what the log states, by its name, or by its range; and how sure that is."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tendonfmu.recordings.converters import units

SURE, LIKELY, GUESS, UNDECIDED = "sure", "likely", "guess", "undecided"


@dataclass(frozen=True)
class Guess:
    """A unit."""

    unit: str  # its name, or "?"
    sure: str  # SURE, LIKELY, GUESS or UNDECIDED
    why: str  # in words


# largest magnitude -> unit; what a finger's signals have in each unit. Between the ranges several units fit.
FORCE = [(0.2, 700.0, "N", "lbf and kgf would fit too")]
LENGTH = [
    (0.0005, 0.2, "m", "a finger's tendon moves by centimetres"),
    (0.5, 300.0, "mm", "a finger's tendon moves by centimetres"),
]
ANGLE = [(0.05, 3.3, "rad", "degrees would be hardly a motion"), (10.0, 400.0, "deg", "too much for radians")]
TORQUE = [(0.005, 80.0, "N.m", "the usual unit")]
ANGULAR_SPEED = [
    (0.05, 15.0, "rad/s", "degrees per second would be hardly a motion"),
    (40.0, 2000.0, "deg/s", "too fast for radians"),
]
RANGES = {"force": FORCE, "length": LENGTH, "angle": ANGLE, "torque": TORQUE, "angular speed": ANGULAR_SPEED}
ROS = {"angle": "rad", "angular speed": "rad/s", "torque": "N.m", "force": "N", "length": "m"}

EPOCHS = {"epoch_s": 1.0, "epoch_ms": 1e3, "epoch_us": 1e6, "epoch_ns": 1e9}
FROM_1990, TO_2100 = 631_152_000.0, 4_102_444_800.0  # s
# median step -> unit, for clocks that start anywhere; logs have some 10 to 10,000 samples per second
STEPS = [(1e-5, 0.12, "s"), (0.5, 120.0, "ms"), (500.0, 120e3, "us"), (500e3, 120e6, "ns")]


def stated(name: str, unit: str) -> tuple[str, str, str] | None:
    """Return (unit, quantity, where) that a log states for a field, or None."""
    if unit and (found := units.quantity(unit.strip(" []()"))):
        return (*found, f"the log states {unit!r}")
    for text in re.findall(r"[\[(]\s*([^\])]+?)\s*[\])]", name):
        if found := units.quantity(text):
            return (*found, f"the name says [{text}]")
    for text in reversed(re.split(r"[_ /]|(?<=[a-z])\.(?=[a-z])", name)[1:]):
        found = units.quantity(text)
        # single letters and words such as "in" and "min" mean many things; N and s at the end of a name do not
        if found and (len(text) > 1 or text in ("N", "s", "m")) and text not in ("in", "min", "us", "s2"):
            return (*found, f"the name ends in {text}") if name.endswith(text) else None
    return None


def unit_of(name: str, unit: str, quantity: str, low: float, high: float, ros: bool) -> Guess:
    """Return the unit of a signal of a known quantity."""
    said = stated(name, unit)
    if said and said[1] == quantity:
        return Guess(said[0], SURE, said[2])
    span = f"{low:.4g} to {high:.4g}"
    if said:
        return Guess("?", UNDECIDED, f"{said[2]}, which is no {quantity}")
    largest = max(abs(low), abs(high))
    fits = [(name_, why) for least, most, name_, why in RANGES[quantity] if least <= largest <= most]
    if ros:
        usual = ROS[quantity]
        odd = bool(RANGES[quantity]) and usual not in [each for each, _ in fits]
        doubt = f", though {span} is unusual for it" if odd and largest > 0 else ""
        return Guess(usual, GUESS if doubt else LIKELY, f"the unit of ROS messages (REP 103){doubt}")
    if len(fits) == 1:
        weak = quantity in ("force", "torque")
        return Guess(fits[0][0], GUESS if weak else LIKELY, f"{span} fits {fits[0][0]}; {fits[0][1]}")
    return Guess("?", UNDECIDED, f"{span} fits none of {', '.join(units.QUANTITIES[quantity])} alone")


def unit_of_time(name: str, unit: str, first: float, step: float) -> Guess:
    """Return the unit of a clock, by its first reading and median step."""
    for stamp, per_second in EPOCHS.items():
        if FROM_1990 <= first / per_second <= TO_2100:
            return Guess(
                stamp, SURE if step > 0 else LIKELY, f"{first:.0f} is a date of our time in {stamp[6:]} since 1970"
            )
    said = stated(name, unit)
    if said and said[1] == "time":
        return Guess(said[0], SURE, said[2])
    for (
        least,
        most,
        unit_,
    ) in STEPS:
        if least <= step <= most:
            return Guess(unit_, LIKELY, f"a median step of {step:.4g} would be {_rate(step, unit_)} samples per second")
    return Guess("?", UNDECIDED, f"a median step of {step:.4g} fits none of s, ms, us, ns")


def _rate(step: float, unit: str) -> str:
    return f"{1.0 / (step * units.TIME[unit]):.4g}"
