"""The answer to both questions, what a description lacks and what has changed: what their reports share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.diagnosis.effects import BY_NAME, Place, Where, title_of
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.gain import Gain
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.result import Cause, Diagnosis, Evidence, ResidualView, Unexplained
from tendonfmu.diagnosis.samples import Series
from tendonfmu.diagnosis.selection import SIGNIFICANCE, Judged
from tendonfmu.statistics import Interval, make_folds
from tendonfmu.tasks import Phases

BINS = 24
SHOWN = 4.0  # ratio of the bins' squared means without and with the cause, for a picture that shows it
FEWEST = 10  # blocks in a bin
POINTS = 1200  # of a curve over time
LONGEST_LAG = 1.0  # s
MOST_LONGER = 10.0  # times the duration: beyond, another motion is the better advice
MARGIN = 1.2  # times the duration at which the interval would just end at 0
OTHER_MOTION = "repeat the test with another motion, at two pretensions"

# --- a cause ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Compared:
    """What a model leaves without and with a cause, N·m [B, n]."""

    series: Series
    before: Numbers
    after: Numbers
    added: Numbers  # torque of the cause
    judged: Flags  # blocks that are looked at [B]
    reference: Flags | None = None  # blocks of the reference [B], for a change


def evidence(effect: str, places: Sequence[Place], compared: Compared) -> tuple[Evidence, ...]:
    """Return a picture of the residual at the joint where the cause changes most."""
    joint = int(np.argmax(np.sum(compared.added[compared.judged] ** 2, axis=0)))
    place = next((place for place in places if place.joint == joint + 1), places[0])
    coordinate = BY_NAME[effect].coordinate if effect in BY_NAME else "velocity"
    picture = _binned_evidence(compared, _coordinate_of(place, coordinate, compared.series, joint), joint)
    if picture and _shows(picture[0]):
        return picture
    what = "cause" if compared.reference is None else "change"
    torque = (f"torque of this {what} at joint {joint + 1}", "N·m", compared.added[:, joint])
    return _binned_evidence(compared, torque, joint) or picture


def _shows(evidence: Evidence) -> bool:
    """Return whether the cause removes most of the bins' mean residual."""
    return float(np.sum(evidence.before**2)) >= SHOWN * float(np.sum(evidence.after**2))


def _binned_evidence(compared: Compared, over: tuple[str, str, Numbers], joint: int) -> tuple[Evidence, ...]:
    """Average over bins of equal count; return nothing if there are too few blocks."""
    label, unit, values = over
    kept = compared.judged & np.isfinite(values)
    bins = min(BINS, int(kept.sum()) // FEWEST)
    if bins < 2:
        return ()
    before, after = compared.before[:, joint], compared.after[:, joint]
    reference: tuple[Numbers, Numbers] | tuple[None, None] = (None, None)
    least = 1 if compared.reference is None else FEWEST
    if compared.reference is None:
        order = np.flatnonzero(kept)[np.argsort(values[kept], kind="stable")]
        parts = np.array_split(order, bins)
    else:
        edges = np.quantile(values[kept], np.linspace(0.0, 1.0, bins + 1))
        inside = compared.reference & (values >= edges[0]) & (values <= edges[-1])
        member = np.searchsorted(edges[1:-1], values, side="right")
        filled = [k for k in range(bins) if (kept & (member == k)).any()]
        parts = [np.flatnonzero(kept & (member == k)) for k in filled]
        reference = _means(after, [np.flatnonzero(inside & (member == k)) for k in filled], compared.series)
    (before, before_std), (after, after_std) = (
        _means(torque, parts, compared.series, least) for torque in (before, after)
    )
    coordinate = np.array([values[rows].mean() for rows in parts])
    return (Evidence(joint + 1, label, unit, coordinate, before, after, before_std, after_std, *reference),)


def _means(
    values: Numbers, parts: Sequence[NDArray[np.int64]], series: Series, least: int = FEWEST
) -> tuple[Numbers, Numbers]:
    """Return means and their standard errors [K]; NaN for bins with fewer than `least` blocks."""
    means, errors = np.full(len(parts), np.nan), np.full(len(parts), np.nan)
    second = np.floor(series.time).astype(np.int64) + 1_000_000 * series.recording
    for k, rows in enumerate(parts):
        if len(rows) >= least:
            means[k] = values[rows].mean()
            _, member = np.unique(second[rows], return_inverse=True)
            errors[k] = np.sqrt(np.sum(np.bincount(member, weights=values[rows] - means[k]) ** 2)) / len(rows)
    return means, errors


def _coordinate_of(place: Place, kind: str, series: Series, joint: int) -> tuple[str, str, Numbers]:
    """Return label, unit and values [B] of the coordinate."""
    own = joint if place.joint is None else place.joint - 1
    tendon = None if place.tendon is None else place.tendon - 1
    if kind == "velocity" and tendon is not None:
        return f"velocity of tendon {tendon + 1}", "m/s", series.tendon_velocity[:, tendon, own]
    if kind in ("force", "load"):
        if tendon is None:
            return "mean tendon force", "N", np.abs(series.force).mean(axis=1)
        return f"force of tendon {tendon + 1}", "N", series.force[:, tendon]
    of_joint: Mapping[str, tuple[str, str, Numbers]] = {
        "velocity": ("velocity", "rad/s", series.velocity),
        "angle": ("angle", "rad", series.angle),
        "travel": ("travel since the last reversal", "rad", np.asarray(series.travel * np.sign(series.velocity))),
        "acceleration": ("acceleration", "rad/s²", series.acceleration),
    }
    if kind in of_joint:
        label, unit, values = of_joint[kind]
        return f"{label} of joint {own + 1}", unit, values[:, own]
    return "time", "s", series.time


# --- all sides --------------------------------------------------------------------------------------------------------


def residual_views(
    series: Series, before: Numbers, after: Numbers, *, load: Numbers | None = None
) -> tuple[ResidualView, ...]:
    """Return all pictures of the residual, joint after joint. before, after: [B, n]; load: [B, n]."""
    return tuple(view for joint in range(before.shape[1]) for view in _of_joint(series, before, after, load, joint))


def _of_joint(
    series: Series, before: Numbers, after: Numbers, load: Numbers | None, joint: int
) -> Iterator[ResidualView]:
    used = series.used
    pair = before[used, joint], after[used, joint]
    yield _over_time(series, before[:, joint], after[:, joint], joint)
    yield _binned("angle", f"angle of joint {joint + 1}", "rad", series.angle[used, joint], *pair, joint)
    yield _binned("velocity", f"velocity of joint {joint + 1}", "rad/s", series.velocity[used, joint], *pair, joint)
    yield _binned("tendon_force", "mean tendon force", "N", np.abs(series.force[used]).mean(axis=1), *pair, joint)
    if load is not None:
        yield _binned("load", f"torque at joint {joint + 1}", "N·m", load[used, joint], *pair, joint)
    turned = series.travel[used, joint] * np.sign(series.velocity[used, joint])
    yield _binned("travel", "travel since reversal, with its direction", "rad", turned, *pair, joint)
    yield _spectrum(series, before[:, joint], after[:, joint], joint)
    yield _autocorrelation(series, before[:, joint], after[:, joint], joint)


def _over_time(series: Series, before: Numbers, after: Numbers, joint: int) -> ResidualView:
    """Average over equal pieces, recordings one after another; NaN between them and where nothing is used."""
    size = max(1, -(-len(before) // POINTS))
    pieces = -(-len(before) // size)
    piece, used = np.arange(len(before)) // size, series.used
    count = np.bincount(piece[used], minlength=pieces)

    def mean(values: Numbers) -> Numbers:
        total = np.bincount(piece[used], values[used], minlength=pieces)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    clock = _running_time(series)
    return ResidualView(joint + 1, "time", "time", "s", clock[np.arange(pieces) * size], mean(before), mean(after))


def _running_time(series: Series) -> Numbers:
    """Return the time of each block; every recording starts where the one before ended."""
    new = np.flatnonzero(np.diff(series.recording, prepend=series.recording[:1] - 1))
    ends = np.append(new[1:], len(series.time)) - 1
    lengths = series.time[ends] - series.time[new] + series.step
    begin = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    which = np.searchsorted(new, np.arange(len(series.time)), side="right") - 1
    return np.asarray(series.time - series.time[new][which] + begin[which])


def _binned(kind: str, label: str, unit: str, x: Numbers, before: Numbers, after: Numbers, joint: int) -> ResidualView:
    """Average over bins of equal count; `before_std` is the scatter within the bin."""
    parts = [part for part in np.array_split(np.argsort(x, kind="stable"), BINS) if len(part)]
    at, one, other = (np.array([values[part].mean() for part in parts]) for values in (x, before, after))
    scatter = np.array([before[part].std() for part in parts])
    return ResidualView(joint + 1, kind, label, unit, at, one, other, scatter)


def _spectrum(series: Series, before: Numbers, after: Numbers, joint: int) -> ResidualView:
    """Return Welch's power density, N²m²/Hz; runs without a gap are averaged by their length."""
    rate, plan = 1.0 / series.step, make_folds(series)
    runs = np.split(plan.rows, np.flatnonzero(np.diff(plan.run)) + 1)
    size = min(512, max(map(len, runs)) or 1)
    total, weight = np.zeros((2, size // 2 + 1)), 0.0
    for run in runs:
        if len(run) >= size:
            total += welch(np.stack([before[run], after[run]]), rate, nperseg=size)[1] * len(run)
            weight += len(run)
    frequency = np.arange(size // 2 + 1, dtype=np.float64) / (size * series.step)
    total /= max(weight, 1.0)
    return ResidualView(joint + 1, "spectrum", "frequency", "Hz", frequency[1:], total[0, 1:], total[1, 1:])


def _autocorrelation(series: Series, before: Numbers, after: Numbers, joint: int) -> ResidualView:
    lags = np.arange(1, max(2, round(LONGEST_LAG / series.step)) + 1)
    curves = [_correlations(series, values, lags) for values in (before, after)]
    return ResidualView(joint + 1, "autocorrelation", "lag", "s", np.asarray(lags * series.step), *curves)


def _correlations(series: Series, values: Numbers, lags: NDArray[np.int64]) -> Numbers:
    """Return the correlation of values [B] with themselves a few blocks later, without pairs across a gap."""
    plan = make_folds(series)
    seen = values[plan.rows] - (values[plan.rows].mean() if len(plan.rows) else 0.0)
    variance = float(np.mean(seen**2)) if len(seen) else 0.0
    correlations = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        same = plan.run[lag:] == plan.run[:-lag]
        if same.any() and variance > 0.0:
            correlations[k] = float(np.sum((seen[lag:] * seen[:-lag])[same])) / int(same.sum()) / variance
    return correlations


def whiteness(series: Series, before: Numbers, after: Numbers) -> tuple[tuple[float, float], ...]:
    """Return, for each joint, the correlation of neighbouring blocks before and after; 0 for white noise."""

    def of(values: Numbers) -> float:
        return float(_correlations(series, values, np.array([1]))[0])

    return tuple((of(one), of(other)) for one, other in zip(before.T, after.T, strict=True))


# --- the answer -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Asked:
    """What is asked of a diagnosis."""

    given: Input
    least_gain: float  # share of the rms that a cause must remove
    seed: int
    settings: FitSettings
    phases: Phases


def answered(
    asked: Asked,
    gain: Gain,
    compared: tuple[Series, Numbers, Numbers],  # the series, and what is left without and with the causes [B, n]
    *,
    causes: Sequence[Cause],
    unexplained: Unexplained,
    warnings: Sequence[str],
    load_at_joints: Numbers | None = None,  # torque to be explained, N·m [B, n]
    **others: Any,  # fields of `Diagnosis`
) -> Diagnosis:
    """Return the diagnosis; its duration is still 0."""
    given = asked.given
    explained = bool(causes) or others.get("load") is not None
    return Diagnosis(
        finger=given.finger.name,
        verdict=_verdict(explained, unexplained.unknown),
        recordings=tuple(str(recording.path) for recording in given.training),
        tests=tuple(str(recording.path) for recording in given.tests),
        references=tuple(str(recording.path) for recording in given.reference),
        seconds=0.0,
        seed=asked.seed,
        least_gain=asked.least_gain,
        causes=tuple(causes),
        unexplained=unexplained,
        views=residual_views(*compared, load=load_at_joints),
        whiteness=whiteness(*compared),
        warnings=(*given.warnings, *warnings),
        **vars(gain),
        **others,
    )


def _verdict(explained: bool, unknown: bool) -> str:
    if explained:
        return "partly explained" if unknown else "explained"
    return "unexplained" if unknown else "adequate"


def cause_of(found: Judged, **numbers: Any) -> Cause:
    """Return a cause with its words and its rivals; `numbers` are further fields of `Cause`."""
    effect, rivals = found.effect, tuple(other.where for other in found.alike)
    known: dict[str, Any] = {"gain": found.gain, "gain_unit": found.gain_unit, "confusable_with": rivals}
    known |= {"sensors": found.sensors} | numbers
    return Cause(found.where, title_of(effect), _explanation(found), found.p_value, **known)


def _explanation(found: Judged) -> str:
    """Say what the effect is; a number that the description has is different now."""
    if found.effect not in BY_NAME or found.terms:
        return BY_NAME[found.effect].explanation if found.terms else ""
    _, look, at = BY_NAME[found.effect].explanation.partition("Look ")
    return f"The description has this effect; its number is different now. {look}{at}".strip()


def reported(found: Judged, compared: Compared, **numbers: Any) -> Cause:
    """Return a cause with its picture."""
    # a change is free at all of its places together
    places = [found.where.place] if compared.reference is not None else [term.place for term in found.terms]
    return cause_of(found, **numbers, evidence=evidence(found.effect, places or [found.where.place], compared))


def not_taken(causes: Iterable[Cause], experiments: Mapping[Where, str], seconds: float) -> dict[str, Any]:
    """Divide causes that were not taken into those that are too small and the uncertain ones, without mere chance."""
    # `experiments` names those planned; `seconds` of unseen motion were judged
    small, uncertain = list[Cause](), list[Cause]()
    for cause in causes:
        if cause.gain.low > 0.0:
            small.append(cause)
        elif cause.p_value < SIGNIFICANCE and not cause.gain.high < 0.0:  # else unseen data refute it
            settling = _longer(cause.gain, seconds) or experiments.get(cause.where) or OTHER_MOTION
            uncertain.append(replace(cause, experiment=settling))
    return {"too_small": tuple(small), "uncertain": tuple(uncertain)}


def _longer(gain: Interval, seconds: float) -> str:
    """Return how long a recording would settle a gain: its error falls with the root of the duration."""
    factor = ((gain.value - gain.low) / gain.value) ** 2 if gain.value > 0.0 else math.inf
    if not factor <= MOST_LONGER:
        return ""
    needed = 10.0 * math.ceil(MARGIN * factor * seconds / 10.0)
    return f"test on {needed:.0f} s of such motion, in place of {seconds:.0f} s"
