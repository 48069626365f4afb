"""A description to begin with: which tendon passes which joint in which direction, and numbers of an ordinary finger.

`calibrate` and `fit --routing` find moment arms, stiffness and zeros from joint encoders, and the friction from motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.model.description import finger_from_data

ARM, STIFFNESS = 0.01, 5000.0  # m, N/m
EDGE = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.0}
JOINT = {"static": 0.005, "coulomb": 0.004, "stribeck_velocity": 0.1, "viscous": 0.001}  # N·m, rad/s, N·m·s/rad
THRESHOLD = 0.05  # N·m
EXPECTED = 'expected a name and the joints that it passes, base first, each with + or -, such as "FDP mcp+ pip+"'


def starting_finger(name: str, joints: Sequence[str], tendons: Sequence[str]) -> dict[str, Any]:
    """Make a description from names, joints base first, and a line for each tendon such as "FDP mcp+ pip+"."""
    # +: a pull turns the joint towards positive angles
    for what, names in (("joint", list(joints)), ("tendon", [line.split()[0] for line in tendons if line.split()])):
        twice = next((each for each in names if names.count(each) > 1), None)
        if twice is not None or not names:
            raise InputError(f"{what} {twice!r}: given twice" if names else f"no {what}; expected at least one")
    data = {
        "format": "tendonfmu-finger-1",
        "name": name,
        "joints": [{"name": joint, "friction": dict(JOINT)} for joint in joints],
        "tendons": [_tendon(line, joints) for line in tendons],
        "contact": {"threshold": [THRESHOLD] * len(joints)},
    }
    finger_from_data(data)
    return data


def _tendon(line: str, joints: Sequence[str]) -> dict[str, Any]:
    name, *passed = line.split() or [""]
    arms = [0.0] * len(joints)
    for word in passed:
        joint, sign = word[:-1], {"+": 1.0, "-": -1.0, "−": -1.0}.get(word[-1])
        if sign is None or joint not in joints:
            known = ", ".join(joints)
            raise InputError(f"tendon {line!r}: {word!r} is none of the joints {known} with + or -; {EXPECTED}")
        arms[list(joints).index(joint)] = sign * ARM
    if not passed:
        raise InputError(f"tendon {line!r}: {EXPECTED}")
    last = max(j for j, arm in enumerate(arms) if arm)
    edges = [dict(EDGE) if arm else None for arm in arms[: last + 1]]
    return {"name": name, "stiffness": STIFFNESS, "moment_arms": arms, "edge_friction": edges}
