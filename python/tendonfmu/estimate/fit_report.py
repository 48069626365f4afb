"""The report of a fit, "tendonfmu-fit-1": all results as JSON, with null for what is not a number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.core_runs import CoreRuns, SlowDrift
from tendonfmu.estimate.estimation import Unknown
from tendonfmu.estimate.learning import Learned
from tendonfmu.estimate.verdicts import CAUSES, Fitted
from tendonfmu.files import counted
from tendonfmu.json_types import Count, Index, Number, Schema, Size, Values
from tendonfmu.model import Effect, Finger, Law, finger_of, without_friction
from tendonfmu.recordings import (
    FitRecording,
    Model,
    Nis,
    RecordingEntry,
    RoutingEntry,
    Whiteness,
    consistency,
    rms,
    whiteness,
)
from tendonfmu.statistics import effective_samples

if TYPE_CHECKING:
    from typing_extensions import NotRequired


class FittedNumber(TypedDict):
    path: str
    unit: str
    start: float
    value: float
    standard_error: Size | None
    # Whether the standard error is at most 30 % of the value and half of what was known before.
    identified: bool
    at_bound: Annotated[str, Schema(enum=["lower", "upper"])] | None
    reason: (
        Annotated[str, Schema(enum=["side", "working_point", "slow", "noise", "combination", "never_moves", "kept"])]
        | None
    )
    explanation: str | None
    advice: str | None  # Motion, load or option that would identify the number.


class Correlation(TypedDict):
    paths: list[str]  # Paths of the unknowns: .drop is static - coulomb, .rate is 1/stribeck_velocity.
    standard_errors: list[Size | None]  # Standard errors of the unknowns.
    matrix: list[list[Annotated[float, Schema(minimum=-1.001, maximum=1.001)]]]


class GivenNumbers(TypedDict):
    """What became of the numbers that the fit was given."""

    start: Annotated[str, Schema(enum=["guessed", "estimated"])]  # estimated: they are the prior.
    kept: bool  # Whether all of them are kept, because fitted ones need not do better.
    moved: Count  # Values that moved by more than their standard error.
    stayed: list[str]  # Paths of the others.
    paragraph: str  # The same in words, with the reasons.


class MemoryEntry(TypedDict):
    angles: str  # Source of the joint angles that the numbers were fitted to.
    left: Values  # N.m by joint; rms without a learning bias, with these angles.
    left_delivered: Values  # N.m by joint; the same with the kinematics of the delivered finger.
    left_out: list[str]  # Paths of the numbers that the motion does not show.


class Identified(TypedDict):
    count: Count
    of: Index


class ResidualRms(TypedDict):
    """N.m by joint, before the bias learns from the sample."""

    rms: Values
    start_rms: Values
    bias_only_rms: Values
    model_only_rms: Values
    torque_rms: Values


class Comparison(RecordingEntry):
    """A recording to compare with, and its residuals as those of the training."""

    label: str
    rms: NotRequired[Values]
    start_rms: NotRequired[Values]
    bias_only_rms: NotRequired[Values]
    model_only_rms: NotRequired[Values]
    torque_rms: NotRequired[Values]


class Residual(TypedDict):
    train: ResidualRms
    held_out: ResidualRms | None
    comparisons: list[Comparison]


class Effective(TypedDict):
    """By joint: samples trained on, and the number of independent samples that they are worth."""

    samples: list[float]
    worth: list[float]


class Innovations(TypedDict):
    nis: Nis
    whiteness: Whiteness
    effective: Effective


class FitReport(TypedDict):
    """Report of `tendonfmu fit --report`. SI units; null stands for a value that is not a number."""

    format: Literal["tendonfmu-fit-1"]
    finger: str  # Name of the finger.
    method: Annotated[str, Schema(enum=["batch", "ekf"])]
    converged: bool
    finished: Literal[True]
    iterations: Count
    passes: Count  # Passes over the data, coarse ones included.
    seconds: Size  # s; time of the estimation.
    cost: Number  # Half the sum of the squared standardised innovations, plus the part of the prior.
    options: Mapping[str, Any]
    warnings: list[str]
    recordings: Annotated[list[RecordingEntry], Schema(minItems=1)]
    parameters: Annotated[list[FittedNumber], Schema(minItems=1)]
    correlation: Correlation
    routing: NotRequired[RoutingEntry | None]
    given_numbers: NotRequired[GivenNumbers]
    memory: NotRequired[MemoryEntry | None]  # How friction that remembers (presliding) was fitted; null without it.
    identified: Identified
    residual: Residual
    innovations: Innovations


# --- one recording under a finger -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Evaluation:
    """A recording under the fitted finger."""

    recording: FitRecording  # prepared recording
    model: Model  # of the fitted finger, and of that of the start
    start: Model
    bias_only: Model  # with the same bias filter and no friction at all
    model_only: Numbers  # [N, n] y − T less a constant per part (N·m)


def evaluate(start: Finger, fitted: Finger, recording: FitRecording) -> Evaluation:
    """Judge a fitted finger on a recording."""
    model = recording.run(fitted)
    rest = recording.target - model.torque
    for part in recording.parts:
        chosen = recording.train[part] if recording.train[part].any() else recording.tracked[part]
        if chosen.any():
            rest[part] -= rest[part][chosen].mean(axis=0)
    bare = finger_of(without_friction(fitted.data))
    return Evaluation(recording, model, recording.run(start), recording.run(bare), rest)


def residual_entry(evaluations: Sequence[Evaluation], which: str) -> ResidualRms | None:
    """Compute the rms [n] by joint over the samples of a flag ("train" or "held_out"); None without any."""
    chosen = [np.asarray(getattr(evaluation.recording, which)) for evaluation in evaluations]
    if not any(flags.any() for flags in chosen):
        return None
    flags = np.concatenate(chosen)
    unknown = np.isnan(np.concatenate([evaluation.model.residual for evaluation in evaluations]))

    def of(series: Callable[[Evaluation], Numbers]) -> Values:
        values = np.concatenate([series(evaluation) for evaluation in evaluations])
        return [*rms(np.where(unknown, np.nan, values), flags)]

    return {
        "rms": of(lambda evaluation: evaluation.model.residual),
        "start_rms": of(lambda evaluation: evaluation.start.residual),
        "bias_only_rms": of(lambda evaluation: evaluation.bias_only.residual),
        "model_only_rms": of(lambda evaluation: evaluation.model_only),
        "torque_rms": of(lambda evaluation: evaluation.recording.target),
    }


LEAST_NIS, MOST_NIS, MOST_LAG_ONE = 0.5, 2.0, 0.3  # values outside give a warning
_MORE_PASSES = ": allow more (--passes), or estimate fewer numbers (--only, --fix, --share)"


def parameter_entry(number: Fitted, finger: Finger) -> FittedNumber:
    """Return what the report says of a number."""
    return {
        "path": number.number.path,
        "unit": finger.numbers[number.number.path].unit,
        "start": number.start,
        "value": number.value,
        "standard_error": number.standard_error,
        "identified": number.identified,
        "at_bound": number.at_bound,
        "reason": number.cause or None,
        "explanation": number.reason or None,
        "advice": number.advice or None,
    }


def innovations_of(innovations: Sequence[Numbers], weights: Sequence[Numbers]) -> Innovations:
    """Describe the residuals of the samples trained on, and how many independent samples they are worth."""
    samples, worth = effective_samples(innovations, weights)
    share = float(worth.sum() / samples.sum()) if samples.sum() else 1.0
    return {
        "nis": consistency(innovations, share),
        "whiteness": whiteness(innovations),
        "effective": {"samples": samples.tolist(), "worth": worth.tolist()},
    }


def comparison_entry(evaluation: Evaluation) -> Comparison:
    """Return what the report says of a recording that is judged only."""
    recording, left = evaluation.recording, residual_entry([evaluation], "train")
    return cast("Comparison", {"label": recording.path.stem, **recording.entry(), **(left or {})})


def correlation_of(covariance: Numbers) -> list[list[float]]:
    """Return the correlations [u, u] of a covariance."""
    error = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    matrix = covariance / np.outer(error, error)
    return [[float(f"{value:.4g}") for value in row] for row in matrix.tolist()]


# --- in words --------------------------------------------------------------------------------------------------------


def fit_sentences(learned: Learned, numbers: Sequence[Fitted]) -> list[str]:
    """Return the warnings of the estimation, and the numbers that ended at a bound."""
    more = "" if learned.converged else _MORE_PASSES
    sentences = [f"{sentence}{more}" for sentence in learned.warnings]
    at_bound = [number for number in numbers if number.at_bound]
    if at_bound:
        some = ", ".join(number.number.path for number in at_bound[:3])
        more = f" and {len(at_bound) - 3} more" if len(at_bound) > 3 else ""
        sentences.append(f"{counted(len(at_bound), 'number')} ended at a bound: {some}{more}")
    return sentences


def noise_sentences(innovations: Innovations) -> list[str]:
    """Warn if the residuals contradict the noise settings, since the standard errors depend on these."""
    nis, lag_one = innovations["nis"]["mean"], innovations["whiteness"]["lag_one"]
    sentences = []
    times = "-" if nis is None else f"{nis:.2g}" if nis < 100 else f"{nis:.0f}"
    if nis is not None and not LEAST_NIS <= nis <= MOST_NIS:
        sentences.append(
            f"the residuals' variance is {times} times that of bias.noise_std, noise_std_per_force, noise_time and "
            "drift_variance: standard errors follow these settings, not the data"
        )
    far = max((abs(value) for value in lag_one if value is not None), default=0.0)
    if far > MOST_LAG_ONE:
        samples, worth = sum(innovations["effective"]["samples"]), sum(innovations["effective"]["worth"])
        count = f"{samples:.0f} samples count as {worth:.0f}" if worth < samples else "each sample counts as new"
        sentences.append(
            f"residuals are not white (autocorrelation {far:.2f} from one sample to the next): the model lacks an "
            f"effect, or the noise is correlated; {count}, treat the standard errors with caution"
        )
    return sentences


# --- the given numbers ------------------------------------------------------------------------------------------------


FAR, MOST_NAMED = 2.0, 4  # a factor by which a number moves far, and such numbers named at most


def unseen_square(finger: Finger, recordings: Sequence[FitRecording]) -> float:
    """Return Σ r² over the samples held out and all joints, (N·m)², without a learning bias; 0 without any."""
    unseen = [replace(recording, train=recording.held_out) for recording in recordings if recording.held_out.any()]
    if not unseen:
        return 0.0
    runs = CoreRuns(finger, unseen)
    return float(np.sum(SlowDrift(runs.time, runs.stretch, runs.used).without(runs.residual()) ** 2))


def is_worse(training: Sequence[Evaluation]) -> bool:
    """Return whether fitted numbers leave more of the samples held out than the given ones."""
    held = residual_entry(training, "held_out")
    if held is None:
        return False
    fitted, given = (np.array(each, dtype=np.float64) for each in (held["rms"], held["start_rms"]))
    return float(np.sum(fitted**2)) > float(np.sum(given**2))


def movement(numbers: Sequence[Fitted], estimated: bool, kept: bool) -> GivenNumbers:
    """Return how many numbers moved, which stayed, and why, for the report."""
    moved = [number for number in numbers if abs(number.value - number.start) > number.standard_error]
    stayed = [number for number in numbers if abs(number.value - number.start) <= number.standard_error]
    return {
        "start": "estimated" if estimated else "guessed",
        "kept": kept,
        "moved": len(moved),
        "stayed": [number.number.path for number in stayed],
        "paragraph": " ".join([*_sentences(len(moved), stayed, estimated, kept), *_far(moved)]),
    }


def _far(moved: Sequence[Fitted]) -> list[str]:
    """Name the numbers that moved by more than a factor, the farthest first."""
    ratios = [
        (max(number.value / number.start, number.start / number.value), number)
        for number in moved
        if number.start > 0.0 and number.value > 0.0 and abs(number.value - number.start) > 3.0 * number.standard_error
    ]
    far = sorted((each for each in ratios if each[0] > FAR), key=lambda each: -each[0])
    if not far:
        return []
    named = [f"{each.number.path} {each.start:.3g} → {each.value:.3g}" for _, each in far[:MOST_NAMED]]
    more = f" and {len(far) - MOST_NAMED} more" if len(far) > MOST_NAMED else ""
    return [f"Moved by more than a factor of {FAR:g}: {'; '.join(named)}{more}."]


def _sentences(moved: int, stayed: Sequence[Fitted], estimated: bool, kept: bool) -> list[str]:
    if kept:
        return ["The given numbers are kept: fitted ones leave a larger error on the held-out samples."]
    sentences = ["The given numbers were estimated before."] if estimated else []
    sentences.append(f"{counted(moved, 'number')} moved by more than their standard errors")
    reasons = Counter(number.cause for number in stayed)
    why = [f"{count}: {CAUSES[cause]}" for cause, count in reasons.most_common() if cause]
    if reasons[""]:
        why.append(f"{reasons['']}: the data agree with the given value{'s' * (reasons[''] > 1)}")
    sentences[-1] += f"; {len(stayed)} stayed ({'; '.join(why)})." if stayed else "."
    return sentences


# --- pictures ---------------------------------------------------------------------------------------------------------
# There is one `FitSeries` per recording: those trained on (role "training"; held-out blocks of time have `used` False),
# and whole recordings that were held out or given to compare with (role "comparison", such as the motion at four times
# the pretension).


Role = Literal["training", "comparison"]
CONFIDENCE = 1.96  # standard errors: 95 %
_LAST = {"coulomb": "coulomb", "drop": "static", "rate": "stribeck_velocity", "viscous": "viscous", "static": "coulomb"}


@dataclass(frozen=True)
class FitSeries:
    """One recording under the fitted model; all arrays have one row per sample, in SI units."""

    label: str  # name for people, such as "free motion" or the name of the file
    role: Role  # "training" or "comparison"
    mean_force: float  # mean of all tendon forces over all samples (N)
    time: Numbers  # [N] (s)
    torque: Numbers  # [N, n] torque that the model has to explain: τ, or τ − external_torque where that was used (N·m)
    # [N, n] τ − T_eff before the bias update (`Estimator.innovations(...)[0]`); NaN for the first sample (N·m)
    residual: Numbers
    model_torque: Numbers  # [N, n] T of eq. (10) (N·m)
    joint_angle: Numbers  # [N, n] the kinematics in use (rad, rad/s)
    joint_speed: Numbers
    used: NDArray[np.bool_]  # [N] bool: trained on
    held_out: NDArray[np.bool_] | None = None  # [N] bool: held out of training and judged


@dataclass(frozen=True)
class FitPicture:
    """A finished fit: all that its figures and its page are made of."""

    # "tendonfmu-fit-1" as written by `--report`. If residual.train and residual.held_out have "start_rms" [n] beside
    # "rms" (the residual with the parameters of the start), it is shown
    report: FitReport
    start: Finger
    fitted: Finger
    unknowns: Sequence[Unknown]  # [p] unknowns of the estimation
    z: Numbers  # [p] their estimate
    covariance: Numbers  # [p, p] of z, prior included
    series: Sequence[FitSeries]  # recordings, training first, in the order given


# --- laws with their confidence bands ---------------------------------------------------------------------------------
#
# A curve runs over velocity, or over the angle where a law has working points. The band is 1.96 standard errors of the
# curve, by the delta method in the unknowns of the fit (coulomb, drop = static − coulomb, rate = 1/stribeck_velocity,
# viscous). The curve is exactly linear in all but the rate. The band is cut off at 0, since friction is not negative.


@dataclass(frozen=True)
class LawCurve:
    """Friction of one side of a law, with its confidence band."""

    fitted: Numbers  # [N] friction with the fitted numbers, in the unit of the law
    low: Numbers  # [N] ends of the band
    high: Numbers
    start: Numbers  # [N] friction with the numbers of the start


def side_of(law: Law, sign: int) -> Law:
    """Return the side of a law for a direction of sliding, +1 or −1."""
    if law.get("positive") is None:
        return law
    side: Law = law["positive" if sign > 0 else "negative"]
    return side


def side_path(path: str, law: Law, sign: int) -> str:
    """Return the path of that side: the law's own path if it is symmetric."""
    if law.get("positive") is None:
        return path
    return f"{path}.{'positive' if sign > 0 else 'negative'}"


def magnitude(side: Law, speed: Numbers) -> Numbers:
    """Compute |F| at the speeds |v| by eq. (1)."""
    drop = float(side["static"]) - float(side["coulomb"])
    viscous = float(side.get("viscous") or 0.0)
    return np.asarray(side["coulomb"] + drop * np.exp(-speed / side["stribeck_velocity"]) + viscous * speed)


def slopes(side: Law, speed: Numbers) -> Mapping[str, Numbers]:
    """Compute the derivatives [N] of |F| by the unknowns, by role."""
    drop, decay = float(side["static"]) - float(side["coulomb"]), np.exp(-speed / side["stribeck_velocity"])
    one = np.ones_like(speed)
    return {"coulomb": one, "static": one, "drop": decay, "rate": -drop * speed * decay, "viscous": speed}


class LawBands:
    """Curves of the laws of a fit, with their confidence bands."""

    def __init__(self, picture: FitPicture) -> None:
        paths = list(picture.fitted.numbers)
        self._covariance = np.asarray(picture.covariance)
        self._column = {
            (paths[k], unknown.role): column
            for column, unknown in enumerate(picture.unknowns)
            for k in unknown.parameters
        }

    def over_speed(self, start: Effect, fitted: Effect, sign: int, speed: Numbers) -> LawCurve:
        """Compute the curve of an effect with a single law over speed. speed: [N]; returns [N] each."""
        weights = np.ones((len(speed), 1))
        return self._curve(start, fitted, sign, speed, weights)

    def over_angle(self, start: Effect, fitted: Effect, sign: int, speed: float, angle: Numbers) -> LawCurve:
        """Compute the curve of an effect with working points over the angle, at one speed."""
        # angle: [N] (rad); returns [N] each
        unit = np.eye(len(fitted.angles))
        weights = np.column_stack([np.interp(angle, fitted.angles, row) for row in unit])
        return self._curve(start, fitted, sign, np.full_like(angle, speed), weights)

    def _curve(self, start: Effect, fitted: Effect, sign: int, speed: Numbers, weights: Numbers) -> LawCurve:
        value = _mixed(fitted, sign, speed, weights)
        error = self._standard_error(fitted, sign, speed, weights)
        low, high = value - CONFIDENCE * error, value + CONFIDENCE * error
        return LawCurve(value, np.maximum(low, 0.0), high, _mixed(start, sign, speed, weights))

    def _standard_error(self, effect: Effect, sign: int, speed: Numbers, weights: Numbers) -> Numbers:
        gradients: dict[int, Numbers] = {}  # column of z -> [N]; the slopes of laws that share a value add up
        for share, law, path in zip(weights.T, effect.laws, effect.law_paths, strict=True):
            prefix = side_path(path, law, sign)
            for role, slope in slopes(side_of(law, sign), speed).items():
                column = self._column.get((f"{prefix}.{_LAST[role]}", role))
                if column is not None:
                    gradients[column] = gradients.get(column, np.zeros_like(speed)) + share * slope
        if not gradients:
            return np.zeros_like(speed)
        columns = np.array(list(gradients))
        slope = np.column_stack(list(gradients.values()))
        variance = np.einsum("ki,ij,kj->k", slope, self._covariance[np.ix_(columns, columns)], slope)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _mixed(effect: Effect, sign: int, speed: Numbers, weights: Numbers) -> Numbers:
    values = [magnitude(side_of(law, sign), speed) for law in effect.laws]
    return np.asarray(np.sum(weights * np.column_stack(values), axis=1))


def asymmetric(effect: Effect) -> bool:
    """Tell whether any law of an effect has two sides."""
    return any(law.get("positive") is not None for law in effect.laws)


def numbers_of(effect: Effect, report: FitReport) -> list[FittedNumber]:
    """Return the entries of the report for the estimated numbers of an effect."""
    return [entry for entry in report["parameters"] if entry["path"].startswith(f"{effect.path}.")]
