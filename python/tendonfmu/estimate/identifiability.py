"""Which numbers of a finger a motion identifies: how long friction slides, standard errors, and why some are large."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import Effect, Number, effects, sliding_velocity, velocity_threshold, working_point_weights

LIMIT = 0.3  # largest relative standard error of an identifiable number
PRIOR = 10.0  # relative standard error of the prior: nearly nothing is known, but every information has an inverse
PARTNERS = 3
COMBINATIONS = 20
_ALIKE = 0.3  # least correlation of errors of a partner
_MEMBER = 0.25  # least share of the largest weight of a member of a combination
_TIME = 1e-9  # s; shorter times are rounding errors


# --- what a motion covers ---------------------------------------------------------------------------------------------


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


# --- what it identifies -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verdict:
    """Whether one number is identifiable, and why not."""

    number: Number  # the number
    # relative standard error when all numbers are estimated, and when all others are known; at most `PRIOR`
    error: float
    error_alone: float
    cause: str  # "" if identifiable, else a key of `CAUSES`
    reason: str  # the cause in words
    partners: list[str]  # paths of the numbers that it can be seen only in combination with

    @property
    def identifiable(self) -> bool:
        """Whether the relative standard error is at most `LIMIT`."""
        return not self.cause


CAUSES = {
    "side": "never slides, or never to that side",
    "working_point": "never slides near that working point",
    "slow": "never slides as slowly as its Stribeck velocity",
    "noise": "too little torque compared with noise and drift, even if all else is known",
    "combination": "visible, but only in combination with others",
}


@dataclass(frozen=True)
class Judgement:
    """What a motion identifies."""

    verdicts: list[Verdict]  # on all numbers, in order
    directions: int  # number of independent combinations of relative changes that are known within `LIMIT`
    # the least known combinations of numbers that are visible on their own: (relative standard error, [(path, weight)])
    combinations: list[tuple[float, list[tuple[str, float]]]]


def judge(numbers: Sequence[Number], information: Numbers, coverage: Sequence[EffectCoverage]) -> Judgement:
    """Judge which numbers a motion identifies. information: [p, p]."""
    if not numbers:
        return Judgement([], 0, [])
    known = information + np.eye(len(numbers)) / PRIOR**2
    covariance = np.linalg.inv(known)
    error = np.sqrt(np.diag(covariance))
    alone = 1 / np.sqrt(np.diag(known))
    verdicts = explain(numbers, error, alone, covariance / np.outer(error, error), coverage)
    directions = int(np.sum(np.linalg.eigvalsh(information) > 1 / LIMIT**2))
    return Judgement(verdicts, directions, _combinations(numbers, known, alone))


def explain(
    numbers: Sequence[Number], error: Numbers, alone: Numbers, correlation: Numbers, coverage: Sequence[EffectCoverage]
) -> list[Verdict]:
    """Explain for each number whether it is identifiable. error, alone: [p]; correlation: [p, p]."""
    by_path = {cover.effect.path: cover for cover in coverage}
    verdicts = []
    for k, number in enumerate(numbers):
        cause, reason, partners = "", "", []
        if not error[k] <= LIMIT:
            cover = by_path[number.effect.path] if number.effect is not None else None
            cause, reason = _cause(number, cover, float(alone[k]))
            if cause == "combination":
                partners = _partners(k, correlation[k], numbers)
                reason += ", ".join(partners)
        verdicts.append(Verdict(number, float(error[k]), float(alone[k]), cause, reason, partners))
    return verdicts


def _cause(number: Number, cover: EffectCoverage | None, alone: float) -> tuple[str, str]:
    reason = unvisited(number, cover) if cover is not None else None
    if reason is not None:
        return reason
    if alone > LIMIT:
        size = f"± {alone:.0%}" if alone < PRIOR / 2 else "nothing is known"
        return "noise", f"{CAUSES['noise']}: {size}"
    return "combination", "only in combination with "


def unvisited(number: Number, cover: EffectCoverage) -> tuple[str, str] | None:
    """Return (cause, reason) if the motion never does what reveals the number, else None."""
    part = number.path.split(".")[-2]
    sides = [part] if part in ("positive", "negative") else ["positive", "negative"]
    time = sum(getattr(cover.times, side) for side in sides)
    if time <= _TIME:
        where = f" to the {part} side" if len(sides) == 1 else ""
        return "side", f"never slides{where}: always within v_min = {cover.threshold:g}" if not where else (
            f"never slides{where}"
        )
    point = cover.points[number.point]
    if sum(getattr(point, side) for side in sides) <= _TIME:
        angle, joint = cover.effect.angles[number.point], cover.effect.joint - 1
        verb = "never slides while joint" if point.total > _TIME else "joint"
        how = "is near" if point.total > _TIME else "never comes near"
        return "working_point", f"{verb} {joint} {how} working point {number.point + 1} at {angle:g} rad"
    stribeck = float(number.side["stribeck_velocity"])
    least = min(
        slow
        for slow, side in zip(cover.slowest, ("positive", "negative"), strict=True)
        if slow is not None and side in sides
    )
    if number.key in ("static", "stribeck_velocity") and number.with_path is None and least > stribeck:
        return "slow", f"never slides slower than {least:.3g}, its stribeck_velocity is {stribeck:g}"
    return None


def _partners(k: int, correlation: Numbers, numbers: Sequence[Number]) -> list[str]:
    """Return the paths of the numbers whose errors correlate most with that of number k, at least one."""
    order = [int(i) for i in np.argsort(-np.abs(correlation)) if i != k]
    near = [i for i in order if abs(correlation[i]) >= _ALIKE][:PARTNERS] or order[:1]
    return [numbers[i].path for i in near]


def _combinations(
    numbers: Sequence[Number], known: Numbers, alone: Numbers
) -> list[tuple[float, list[tuple[str, float]]]]:
    """Find the eigenvectors of least information among the numbers that are visible on their own."""
    seen = np.flatnonzero(alone <= LIMIT)
    values, vectors = np.linalg.eigh(known[np.ix_(seen, seen)])
    result = []
    for value, vector in list(zip(values, vectors.T, strict=True))[:COMBINATIONS]:
        if value > 1 / LIMIT**2:
            break
        vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
        members = [int(i) for i in np.argsort(-np.abs(vector)) if abs(vector[i]) >= _MEMBER * np.max(np.abs(vector))]
        result.append((float(value**-0.5), [(numbers[seen[i]].path, float(vector[i])) for i in members]))
    return result


def counts_by_kind(verdicts: Sequence[Verdict]) -> dict[tuple[str, str], tuple[int, int, int]]:
    """Count the verdicts by kind and key of the number."""
    result: dict[tuple[str, str], tuple[int, int, int]] = {}
    for verdict in verdicts:
        place = (verdict.number.kind, verdict.number.key)
        total, known, alone = result.get(place, (0, 0, 0))
        result[place] = (total + 1, known + verdict.identifiable, alone + (verdict.error_alone <= LIMIT))
    return result


def causes(verdicts: Sequence[Verdict]) -> dict[str, int]:
    """Count the verdicts by cause, the most frequent first."""
    return dict(Counter(verdict.cause for verdict in verdicts if verdict.cause).most_common())


def as_json(judgement: Judgement) -> dict[str, Any]:
    """Return the judgement as an entry of the report."""
    parameters: list[Mapping[str, Any]] = [
        {
            "path": verdict.number.path,
            "value": verdict.number.value,
            "relative_standard_error": verdict.error,
            "relative_standard_error_alone": verdict.error_alone,
            "identifiable": verdict.identifiable,
            "cause": verdict.cause or None,
            "reason": verdict.reason or None,
            "in_combination_with": verdict.partners,
        }
        for verdict in judgement.verdicts
    ]
    return {
        "identifiable_limit": LIMIT,
        "numbers": len(parameters),
        "identifiable": sum(verdict.identifiable for verdict in judgement.verdicts),
        "identifiable_alone": sum(verdict.error_alone <= LIMIT for verdict in judgement.verdicts),
        "known_combinations": judgement.directions,
        "parameters": parameters,
        "least_known_combinations": [
            {
                "relative_standard_error": error,
                "members": [{"path": path, "weight": weight} for path, weight in members],
            }
            for error, members in judgement.combinations
        ],
    }
