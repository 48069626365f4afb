"""Whether the reported size of a named effect has the true one within its 95 % interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evidence.diagnosis.judge import Cause, Truth, is_at_place, places
from evidence.families.finger import Finger, Hidden, true_arms

# Last key of the number in a description that says how large an effect is.
NUMBERS = {
    "friction_drift": "amplitude",
    "cover_stiffness": "stiffness",
    "cover_hardening": "stiffness",
    "joint_coupling": "stiffness",
    "force_gain": "correction",
    "time_delay": "delay",
    "tendon_nonlinearity": "hardening",
    "joint_load_friction": "coulomb",
    "preload_friction": "coulomb",
    "encoder_offset": "",
    "zero": "zero",
}


def true_numbers(made: Finger, hidden: Hidden) -> dict[str, float]:
    """By the last key of a number; empty where the description's numbers have another meaning than the simulator's."""
    size = hidden.size
    if hidden.effect == "gravity":
        return {"sine": size * float(np.cos(hidden.second)), "cosine": size * float(np.sin(hidden.second))}
    if hidden.effect == "cover_stiffness":  # the description has none at all
        size += float(made.cover[hidden.j])
    if hidden.effect == "moment_arm":  # as a sensor's correction, or as an arm of the description
        return {
            "correction": size,
            f"moment_arms[{hidden.j + 1}]": float(true_arms(made.arms, hidden)[hidden.i, hidden.j]),
        }
    return {NUMBERS[hidden.effect]: size} if hidden.effect in NUMBERS else {}


def are_covered(causes: Sequence[Cause], truth: Truth, true: Mapping[str, float]) -> bool | None:
    """Whether all true numbers lie within the intervals of the cause that is right; None: nobody can say."""
    for cause in causes:
        if cause["effect"] not in truth.effects or not is_at_place(cause, truth):
            continue
        intervals = {**_intervals(cause), **{k: v for place in places(cause) for k, v in _intervals(place).items()}}
        known = {last(path): interval for path, interval in intervals.items() if last(path) in true}
        if known:
            return all(low <= true[key] <= high for key, (low, high) in known.items())
    return None


def _intervals(part: Cause) -> Mapping[str, Sequence[float]]:
    found: Mapping[str, Sequence[float]] = part.get("intervals") or {}
    return found


def last(path: str) -> str:
    """The last key of a path: `amplitude` of `extensions[1].amplitude`; nothing of a column, `joint_position[2]`."""
    return path.rsplit(".", 1)[1] if "." in path else ""
