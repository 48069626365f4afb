"""What a motion covers: how long each friction effect slides to either side, and how long it sticks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import Effect, effects, sliding_velocity, velocity_threshold, working_point_weights


@dataclass(frozen=True)
class Times:
    """Times of an effect in s: velocity above v_min, below −v_min, and between."""

    positive: float
    negative: float
    stuck: float

    @property
    def total(self) -> float:
        return self.positive + self.negative + self.stuck


@dataclass(frozen=True)
class EffectCoverage:
    """How long a motion makes one effect slide or stick."""

    effect: Effect  # friction effect of the description
    threshold: float  # v_min (m/s or rad/s)
    times: Times  # times of the effect (s)
    # [k] times by working point (s), each sample weighted by the share of the point in the interpolated value
    points: list[Times]
    # least and greatest |v| while it slides (m/s or rad/s), for the positive and the negative side
    slowest: tuple[float | None, float | None]
    fastest: tuple[float | None, float | None]


def durations(time: Numbers) -> Numbers:
    """Compute the time that each sample stands for, by the trapezoidal rule."""
    # time: [N] (s); returns [N] (s); the sum is the duration of the motion
    step = np.diff(time)
    result = np.zeros(len(time))
    result[:-1] += step / 2
    result[1:] += step / 2
    return result


def coverage_of(
    data: Mapping[str, Any], joint_position: Numbers, joint_velocity: Numbers, share: Numbers
) -> list[EffectCoverage]:
    """Compute how long a motion makes every effect of a finger slide or stick."""
    # joint_position, joint_velocity: [N, n]; share: [N] (s)
    return [_cover(data, effect, joint_position, joint_velocity, share) for effect in effects(data)]


def with_laws_of(data: Mapping[str, Any], coverage: Sequence[EffectCoverage]) -> list[EffectCoverage]:
    """Combine the coverage of a motion with the laws of another description of the same structure."""
    by_path = {effect.path: effect for effect in effects(data)}
    return [replace(cover, effect=by_path[cover.effect.path]) for cover in coverage]


def _cover(
    data: Mapping[str, Any], effect: Effect, joint_position: Numbers, joint_velocity: Numbers, share: Numbers
) -> EffectCoverage:
    velocity = sliding_velocity(data, effect, joint_velocity)
    threshold = velocity_threshold(data, effect)
    sides = (velocity > threshold, velocity < -threshold)
    masks = np.column_stack([*sides, ~(sides[0] | sides[1])]) * share[:, None]
    points = working_point_weights(effect, joint_position).T @ masks
    speed = np.abs(velocity)
    return EffectCoverage(
        effect=effect,
        threshold=threshold,
        times=Times(*masks.sum(axis=0).tolist()),
        points=[Times(*row) for row in points.tolist()],
        slowest=_ends(speed, sides, np.min),
        fastest=_ends(speed, sides, np.max),
    )


def _ends(speed: Numbers, sides: tuple[Any, Any], end: Any) -> tuple[float | None, float | None]:
    positive, negative = (float(end(speed[side])) if side.any() else None for side in sides)
    return positive, negative
