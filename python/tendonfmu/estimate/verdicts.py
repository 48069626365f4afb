"""How well a fit knows each number of the description, and what would identify the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.estimation import Estimator, Unknown
from tendonfmu.estimate.files import with_estimates
from tendonfmu.estimate.identifiability import CAUSES as CAUSES_OF_A_MOTION
from tendonfmu.estimate.identifiability import LIMIT, PRIOR, EffectCoverage, Verdict, explain, unvisited
from tendonfmu.estimate.learning import Learned
from tendonfmu.estimate.methods import learned_at
from tendonfmu.estimate.structure import Choice, Structure, build_structure, numbers_in
from tendonfmu.model import Finger, Number, friction_numbers, number_of
from tendonfmu.recordings import FitRecording

CAUSES = {
    **CAUSES_OF_A_MOTION,
    "never_moves": "never slides at all",
    "side": "never slides to that side",
    "kept": "better known from the earlier fit than from these recordings",
}
NARROWED = 0.5  # of the prior's standard deviation: what data identify, they know at least so much better
_INSIDE = 1e-6  # step of the finite differences of `slopes`, relative to the size of an unknown
_AT_BOUND = 1e-6


@dataclass(frozen=True)
class Fitted:
    """One number after a fit."""

    number: Number  # the number, with its fitted value
    start: float  # value before the fit
    standard_error: float  # standard error of the value
    at_bound: str | None  # "lower", "upper" or None
    cause: str  # "" if identified, else a key of `CAUSES`
    reason: str  # the cause in words
    advice: str  # motion, load or option that would identify the number

    @property
    def value(self) -> float:
        """Fitted value in the unit of the description."""
        return self.number.value

    @property
    def identified(self) -> bool:
        """Whether the data know it: standard error at most LIMIT of the value and NARROWED of the prior's."""
        return not self.cause


def slopes(estimator: Estimator, z: Numbers) -> Numbers:
    """Compute [p, u] the derivatives of all numbers of the description by the unknowns, for the delta method."""
    # The map is static = coulomb + drop and vs = 1/rate. The derivatives are its finite differences within the bounds.
    base = estimator.values(z)
    columns = []
    for k, unknown in enumerate(estimator.unknowns):
        # a step of a small drop must change static = coulomb + drop, however large coulomb is
        whole = float(np.abs(base[list(unknown.parameters)]).max()) if unknown.role == "drop" else 0.0
        step = _INSIDE * max(abs(float(z[k])), 1e-3 * unknown.scale, whole)
        step = -step if z[k] + step > unknown.upper else step
        moved = z.copy()
        moved[k] += step
        columns.append((estimator.values(moved) - base) / step)
    return np.column_stack(columns)


def judge_numbers(
    structure: Structure, learned: Learned, finger: Finger, coverage: Sequence[EffectCoverage], noise: float
) -> tuple[list[Fitted], Numbers]:
    """Judge every number of a fitted finger by what the motion covers; return the covariance [p, p] of the values."""
    # noise: of the torque (N·m); a bias.initial_torque counts as at least that large
    estimator, z = learned.estimator, learned.z
    numbers, matrix = number_slopes(structure, learned, finger)
    covariance = matrix @ learned.covariance @ matrix.T
    error, before = (
        np.sqrt(np.maximum(np.diag(each), 0.0)) for each in (covariance, matrix @ learned.prior @ matrix.T)
    )
    size = sizes_of(numbers, noise)
    columns, unknowns = _columns(structure, estimator), estimator.unknowns
    representatives = _representatives(numbers, columns, coverage)
    # `error` from all numbers, `error_alone` with all others known
    chosen = covariance[np.ix_(representatives, representatives)]
    deviation = np.sqrt(np.maximum(np.diag(chosen), 1e-300))
    inverse = np.linalg.inv(matrix[representatives])
    seen = np.diag(inverse.T @ learned.information @ inverse) * size[representatives] ** 2
    verdicts = explain(
        [numbers[k] for k in representatives],
        deviation / size[representatives],
        1 / np.sqrt(np.maximum(seen, 0.0) + 1 / PRIOR**2),
        chosen / np.outer(deviation, deviation),
        coverage,
    )
    by_path = {cover.effect.path: cover for cover in coverage}
    judged = []
    for k, (number, given) in enumerate(zip(numbers, structure.numbers, strict=True)):
        verdict = verdicts[columns[k]]
        cover = by_path[number.effect.path] if number.effect is not None else None
        was_known = before[k] < NARROWED * abs(given.value)  # else a guess, of which a value may move away
        kept = "kept" if was_known and error[k] > NARROWED * before[k] else ""
        cause = _cause(verdict, cover) if error[k] > LIMIT * size[k] else kept
        judged.append(
            Fitted(
                number=number,
                start=given.value,
                standard_error=float(error[k]),
                at_bound=_bound(unknowns[columns[k]], float(z[columns[k]])),
                cause=cause,
                reason=CAUSES[kept] if cause == "kept" else verdict.reason if cause else "",
                advice=_advice(cause, verdict, cover, finger) if cause not in ("", "kept") else "",
            )
        )
    return judged, covariance


def number_slopes(structure: Structure, learned: Learned, finger: Finger) -> tuple[list[Number], Numbers]:
    """Return the estimated numbers of a fitted finger, and [p, u] their derivatives by the unknowns."""
    numbers = numbers_in(finger, structure.numbers)
    matrix = slopes(learned.estimator, learned.z)
    return numbers, matrix[[structure.index[number.path] for number in numbers]]


def sizes_of(numbers: Sequence[Number], noise: float) -> Numbers:
    """Return [p] what a standard error is relative to: the value, or for a bias at least the noise."""
    return np.array([max(abs(each.value), noise if each.path.startswith("bias.") else 1e-300) for each in numbers])


def with_known_numbers(finger: Finger, recordings: Sequence[FitRecording]) -> Finger:
    """Return a fitted finger with `estimated`: what these recordings tell of its numbers."""
    if not friction_numbers(finger.data):
        return finger
    structure = build_structure(finger, Choice())
    return with_learned_numbers(structure, learned_at(structure, recordings), finger)


def with_learned_numbers(structure: Structure, learned: Learned, finger: Finger) -> Finger:
    """Return a fitted finger with `estimated`: what its fit tells of its numbers."""
    numbers, matrix = number_slopes(structure, learned, finger)
    noise = number_of(finger.data, "bias.noise_std")
    return with_estimates(finger, numbers, matrix @ learned.covariance @ matrix.T, sizes_of(numbers, noise))


def _bound(unknown: Unknown, value: float) -> str | None:
    room = _AT_BOUND * unknown.scale
    if value <= unknown.lower + 1e-3 * room:
        return "lower"
    return "upper" if value >= unknown.upper - room else None


# --- one number for each unknown --------------------------------------------------------------------------------------


def _columns(structure: Structure, estimator: Estimator) -> list[int]:
    """Return [numbers] the unknown of each: for a static friction its drop, for a Stribeck velocity its rate."""
    by_parameter: dict[int, int] = {}
    for column, unknown in enumerate(estimator.unknowns):
        for parameter in unknown.parameters:
            by_parameter.setdefault(parameter, column)
    return [by_parameter[structure.index[number.path]] for number in structure.numbers]


def _representatives(
    numbers: Sequence[Number], columns: Sequence[int], coverage: Sequence[EffectCoverage]
) -> list[int]:
    """Return [unknowns] a number that represents all that share its value, if possible one that the motion visits."""
    by_path = {cover.effect.path: cover for cover in coverage}
    first: dict[int, int] = {}
    for k, (number, column) in enumerate(zip(numbers, columns, strict=True)):
        if number.effect is None or unvisited(number, by_path[number.effect.path]) is None:
            first.setdefault(column, k)
    for k, column in enumerate(columns):
        first.setdefault(column, k)
    return [first[column] for column in sorted(first)]


# --- advice -----------------------------------------------------------------------------------------------------------


def _cause(verdict: Verdict, cover: EffectCoverage | None) -> str:
    """Return the cause of `identifiability`, with a cause of its own for friction that never slides to either side."""
    if cover is not None and verdict.cause == "side" and cover.times.positive + cover.times.negative <= 0:
        return "never_moves"
    return verdict.cause or "combination"


def _advice(cause: str, verdict: Verdict, cover: EffectCoverage | None, finger: Finger) -> str:
    drive = finger.joint_names[cover.effect.drive - 1] if cover is not None else ""
    unit = "m/s" if cover is not None and cover.effect.tendon else "rad/s"
    pulls = not all(tendon.get("bidirectional") for tendon in finger.data["tendons"])  # else it has no pretension
    if cover is not None and cause == "never_moves":
        return f"move joint {drive} and those after it so that it slides faster than {cover.threshold:g} {unit}"
    if cause == "side":
        return f"move joint {drive} both ways"
    if cover is not None and cause == "working_point":
        effect, point = cover.effect, verdict.number.point
        before = finger.joint_names[effect.joint - 2]
        return f"move joint {drive} while joint {before} is near {effect.angles[point]:g} rad"
    if cover is not None and cause == "slow":
        return f"let joint {drive} turn round slowly: strokes at {cover.threshold:g} to {_stribeck(verdict):.3g} {unit}"
    if cause == "noise":
        return _more(verdict, cover, pulls)
    tense = "change the pretension during the recording, or " if pulls else ""
    return f"{tense}--fix or --share it with {', '.join(verdict.partners) or 'others'}"


def _more(verdict: Verdict, cover: EffectCoverage | None, pulls: bool) -> str:
    """Name what raises a number above the noise: load, or time, since errors fall with its square root."""
    load = "" if not pulls or (cover and cover.effect.kind == "friction") else "more pretension (tendon force), or "
    if verdict.error_alone >= PRIOR / 2:
        return f"nothing in these recordings depends on it: {load}remove it from the description, or --fix it"
    longer = (verdict.error_alone / LIMIT) ** 2
    return f"{load}a recording at least {longer:.2g} times as long with the same motion, or less noise"


def _stribeck(verdict: Verdict) -> float:
    return 0.0 if verdict.number.effect is None else float(verdict.number.side["stribeck_velocity"])
