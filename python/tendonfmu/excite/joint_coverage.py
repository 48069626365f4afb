"""How each joint moves in a training motion: strokes, reversals and rests."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.excite.excitation import SLOW, Excitation, Stroke


@dataclass(frozen=True)
class JointCoverage:
    """How one joint moves."""

    lowest: float  # angles (rad)
    highest: float
    fastest: float  # greatest speed (rad/s)
    strokes: int  # their numbers
    reversals: int
    slow_reversals: int  # number of reversals between two strokes of at most `SLOW` of the greatest speed
    rests: int  # number of rests between strokes
    resting: float  # time at rest between strokes (s)


def joint_coverage(motion: Excitation, max_speed: float) -> list[JointCoverage]:
    """Return the coverage of every joint. max_speed: rad/s, of the plan."""
    return [
        _joint(strokes, motion.joint_position[:, j], motion.joint_velocity[:, j], max_speed)
        for j, strokes in enumerate(motion.strokes)
    ]


def _joint(strokes: list[Stroke], position: Numbers, velocity: Numbers, max_speed: float) -> JointCoverage:
    turns = [
        (before, after)
        for before, after in pairwise(strokes)
        if (before.target - before.start) * (after.target - after.start) < 0
    ]
    rests = [after.begin - before.end for before, after in pairwise(strokes) if after.begin > before.end]
    return JointCoverage(
        lowest=float(position.min()),
        highest=float(position.max()),
        fastest=float(np.abs(velocity).max()),
        strokes=len(strokes),
        reversals=len(turns),
        slow_reversals=sum(max(before.speed, after.speed) <= SLOW * max_speed for before, after in turns),
        rests=len(rests),
        resting=float(sum(rests)),
    )
