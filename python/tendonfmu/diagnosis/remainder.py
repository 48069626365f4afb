"""How much of a residual is predictable, what the predictable part depends on, and whether it is unknown.

Two methods look at it:

- flexible learners without physics on everything that is known of the motion and its past, judged on unseen
  stretches (remainder_learner.py);
- a search for steady oscillations in time (statistics/whitening.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement

import numpy as np
from scipy.signal import welch
from scipy.stats import ttest_1samp

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.diagnosis.remainder_features import (
    GROUPS,
    LAW,
    Features,
    features,
    planted,
    run_starts,
    tree_states,
)
from tendonfmu.diagnosis.remainder_learner import Learner
from tendonfmu.diagnosis.result import RemainderMap, Unexplained
from tendonfmu.diagnosis.samples import Series
from tendonfmu.files import listed
from tendonfmu.statistics import Interval, Line, Splines, Whitener, find_lines, make_folds, standard_error, whitener

LEVEL = 0.01  # probability of a wrong "unknown", family-wise
LEAST_SHARE = 0.02  # of the residual's variance: smaller parts are not reported
STRONG = 0.1  # of the variance, of a line in signals that are not whitened
CERTAIN = 2.0  # standard errors over the stretches
LAW_ERROR = 0.1  # of the torque to be explained: laws of friction differ from each other by no more
CONCENTRATED = 1.6  # times as much of the prediction's power as of the time, to report a concentration


@dataclass(frozen=True)
class Finding:
    """One part of the remainder."""

    joint: int  # number from 1
    group: str  # key of GROUPS, or "line"
    subject: str  # "joint 2", "tendons 1 and 3", or ""
    line: Line | None = None  # the oscillation, for group "line"


@dataclass(frozen=True)
class Remainder:
    """The predictable part of a residual [B, n]."""

    share: tuple[float, ...]  # per joint, share of the variance that is predicted on unseen stretches
    gain: Numbers  # the same by stretch, (N·m)² [stretches, n]
    beyond: Numbers  # the part of `gain` that no friction law of another form would bring, (N·m)² [stretches, n]
    square: Numbers  # sum of squares of the residual, (N·m)² [n]
    p_value: float  # probability of such a result if nothing is predictable, over all joints
    description: str
    prediction: Numbers  # N·m [B, n], 0 where not used
    findings: tuple[Finding, ...]  # the parts that are certain
    planted: float = math.nan  # share of the variance of planted states that the learner finds


def measure_remainder(
    series: Series,
    residual: Numbers,
    splines: Splines,
    *,
    force: Numbers | None = None,
    torque: Numbers | None = None,
    seed: int = 0,
) -> Remainder:
    """Measure the predictable part of a residual [B, n], N·m; force [B, m] and torque [B, n] are the model's."""
    joints, folds = residual.shape[1], make_folds(series)
    residual = np.where(series.used[:, None], residual, 0.0)
    if not folds.enough:
        nothing = np.zeros((folds.stretches, joints))
        return Remainder((0.0,) * joints, nothing, nothing, np.zeros(joints), 1.0, "", np.zeros_like(residual), ())
    seen = features(series, force=force, torque=torque, seed=seed, elastic=True)
    learner = Learner(seen, residual, splines, folds)
    states = tree_states(series, series.force if force is None else force, torque)
    everything, law = _predicted(learner, seen, states, seed)
    prediction, law_alone, findings = np.zeros_like(residual), np.zeros_like(learner.target), list[Finding]()
    gains = learner.gains(everything).T
    for joint in range(joints):
        if _is_certain(gains[joint]):
            prediction[folds.rows, joint] = everything[:, joint]
            law_alone[:, joint] = law[:, joint]
    large = [_share(learner.target[:, j], prediction[folds.rows, j]) >= LEAST_SHARE for j in range(joints)]
    if any(large):
        named = _named(learner, seen)
        findings += [Finding(j + 1, *named[j]) for j in range(joints) if large[j]]
    lines = _lines(series, residual, prediction, findings)
    p_value = min([1.0, *(joints * _p_value(gain) for gain in gains), *lines])
    gain = learner.gains(prediction[folds.rows])
    share = tuple(_share(learner.target[:, j], prediction[folds.rows, j]) for j in range(joints))
    certain = [finding for finding in findings if share[finding.joint - 1] >= LEAST_SHARE]
    text = described(series, residual, prediction, certain, share) if certain else ""
    square = np.sum(learner.target**2, axis=0)
    beyond = gain - learner.gains(law_alone)
    planted = _planted_share(learner, series, residual, seed)
    return Remainder(share, gain, beyond, square, p_value, text, prediction, tuple(certain), planted)


def _planted_share(learner: Learner, series: Series, residual: Numbers, seed: int) -> float:
    """Return the share of the variance of planted states, as large as the residual, that the learner finds."""
    random, rows = np.random.default_rng(seed), learner.folds.rows
    joints = residual.shape[1]
    states = np.concatenate([planted(series, run_starts(series.segment), random) for _ in range(joints)], axis=1)
    states -= states[rows].mean(axis=0)
    hosts = np.repeat(residual, states.shape[1] // joints, axis=1)
    states *= hosts[rows].std(axis=0) / np.maximum(states[rows].std(axis=0), 1e-12)
    with_states, hosts_alone = (learner.of(each).predicted(learner.columns) for each in (hosts + states, hosts))
    missed = states[rows] - (with_states - hosts_alone)
    return float(np.clip(1.0 - np.sum(missed**2) / max(float(np.sum(states[rows] ** 2)), 1e-300), 0.0, 1.0))


def _predicted(learner: Learner, seen: Features, states: tuple[Numbers, Numbers], seed: int) -> tuple[Numbers, Numbers]:
    """Return what all that was recorded predicts on unseen stretches, and where it does, a law's states [R, n]."""
    groups = list(dict.fromkeys(seen.group.tolist()))
    sets = [np.flatnonzero(seen.group == group) for group in groups]
    of_law = [k for k, group in enumerate(groups) if group in LAW]
    mixtures = learner.mixed(sets, [range(len(sets)), of_law])
    together = [learner.predicted(columns) for columns in (learner.columns, np.flatnonzero(np.isin(seen.group, LAW)))]
    best = [np.zeros_like(learner.target) for _ in mixtures]
    for joint in range(learner.target.shape[1]):
        for k in range(len(best)):
            if k and not _is_certain(learner.gains(best[0])[:, joint]):
                continue
            trees = learner.by_trees(states[k], joint, seed)
            best[k][:, joint] = _best(learner.target[:, joint], mixtures[k][:, joint], together[k][:, joint], trees)
    return best[0], best[1]


def _is_certain(gain: Numbers) -> bool:
    """Return whether gains by stretch [K] are more than chance."""
    return float(gain.sum()) > CERTAIN * standard_error(gain)


def _best(target: Numbers, *predictions: Numbers) -> Numbers:
    """Return the prediction [R], or the mean of two, that leaves least on unseen stretches."""
    ways = [0.5 * (one + other) for one, other in combinations_with_replacement(predictions, 2)]
    return min(ways, key=lambda way: float(np.sum((target - way) ** 2)))


def _share(target: Numbers, prediction: Numbers) -> float:
    whole = float(np.sum(target**2))
    return max(0.0, 1.0 - float(np.sum((target - prediction) ** 2)) / whole) if whole > 0.0 else 0.0


def _p_value(gain: Numbers) -> float:
    """Return the p-value of gains by stretch [K]: a one-sided t test."""
    return float(ttest_1samp(gain, 0.0, alternative="greater").pvalue) if np.any(gain) else 1.0


def _named(learner: Learner, seen: Features) -> list[tuple[str, str]]:
    """Return for each joint the group whose columns predict best, and the subject of these, "" for all of the group."""
    pairs = [pair for pair in zip(seen.group.tolist(), seen.subject.tolist(), strict=True) if pair[0] != "interaction"]
    wholes = [(group, "") for group, _ in pairs if group != "position"]  # those of all tendons are the angles
    known = list(dict.fromkeys([*wholes, *pairs]))
    left = []
    for group, subject in known:
        columns = np.flatnonzero((seen.group == group) & ((seen.subject == subject) | (not subject)))
        left.append(np.sum((learner.target - learner.predicted(columns)) ** 2, axis=0))
    return [known[k] for k in np.argmin(left, axis=0)]


def _lines(series: Series, residual: Numbers, prediction: Numbers, findings: list[Finding]) -> list[float]:
    """Add steady oscillations to `findings` and `prediction` [B, n]; return their p-values."""
    filters, p_values = whitener(series, residual - prediction), []
    joints = residual.shape[1]
    for joint in range(joints):
        own = Whitener(filters.coefficients[:, joint : joint + 1], filters.scale[joint : joint + 1], filters.valid)
        left = residual[:, joint] - prediction[:, joint]
        weak, wave = find_lines(series, left, own, level=LEVEL / joints)
        # a filter that was fitted to smooth signals removes a strong line itself
        strong, rest = find_lines(series, left - wave, None, level=LEVEL / joints, least=STRONG)
        lines = sorted((*weak, *strong), key=lambda line: -line.share)
        prediction[:, joint] += wave + rest
        findings += [Finding(joint + 1, "line", "", line) for line in lines]
        p_values += [min(1.0, joints * line.p_value) for line in lines]
    return p_values


# --- in words --------------------------------------------------------------------------------------------------------


def described(
    series: Series, residual: Numbers, prediction: Numbers, findings: Sequence[Finding], share: Sequence[float]
) -> str:
    """Return one sentence for each joint that has findings, the joint with the greatest share first."""
    joints = sorted({finding.joint for finding in findings}, key=lambda joint: -share[joint - 1])
    sentences = []
    for joint in joints:
        own = [finding for finding in findings if finding.joint == joint]
        what = " and ".join(dict.fromkeys(_what(own[:3])))
        where = _where(series, prediction[:, joint - 1], joint, own)
        sentences.append(f"Joint {joint}: {_part(share[joint - 1])} follows {what}{where}.")
    return " ".join(sentences)


def _part(share: float) -> str:
    if share < 0.01:
        return "a small but certain, fast-changing part of what is left"
    return f"{100.0 * share:.0f} % of the variance of what is left"


def _what(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield what each finding follows; all oscillations are listed together, at the first one."""
    lines = [finding.line for finding in findings if finding.line is not None]
    frequencies = listed([f"{line.frequency:.3g}" for line in lines])
    sizes = listed([f"{1000.0 * line.amplitude:.3g}" for line in lines])
    steady = "a steady oscillation" if len(lines) == 1 else "steady oscillations"
    for finding in findings:
        if finding.line is not None:
            yield f"{steady} at {frequencies} Hz of {sizes} mN·m, independent of the motion"
        else:
            yield f"{GROUPS[finding.group]}{f', {finding.subject}' if finding.subject else ''}"


def _where(series: Series, part: Numbers, joint: int, findings: Sequence[Finding]) -> str:
    """Return where and when most of the prediction is, unless it is everywhere."""
    used = series.used
    power = part[used] ** 2
    if all(finding.line is not None for finding in findings) or not power.sum():
        return ""
    notes = []
    angles = _stretch(series.angle[used, joint - 1], power)
    if angles:
        notes.append(f"mostly at angles of joint {joint} from {angles[0]:.2f} to {angles[1]:.2f} rad")
    times = _stretch(series.time[used], power) if len(np.unique(series.recording)) == 1 else None
    if times:
        notes.append(f"mostly from {times[0]:.0f} to {times[1]:.0f} s")
    frequency, density = welch(np.where(used, part, 0.0), 1.0 / series.step, nperseg=min(len(part), 1024))
    total = np.cumsum(density)
    notes.append(f"half of it below {frequency[np.searchsorted(total, 0.5 * total[-1])]:.2g} Hz")
    return " (" + ", ".join(notes) + ")"


def _stretch(coordinate: Numbers, power: Numbers) -> tuple[float, float] | None:
    """Return the third of the time, sorted by the coordinate, with most of the power; None if it is spread evenly."""
    order = np.argsort(coordinate)
    summed = np.concatenate([[0.0], np.cumsum(power[order])]) / power.sum()
    width = len(order) // 3
    inside = summed[width:] - summed[:-width]
    start = int(np.argmax(inside))
    if inside[start] < CONCENTRATED / 3.0:
        return None
    chosen = coordinate[order[start : start + width]]
    return float(chosen[0]), float(chosen[-1])


# --- what is unknown -------------------------------------------------------------------------------------------------


def unexplained_of(left: Remainder, everything: Numbers, least_gain: float, explained: float) -> Unexplained:
    """Return the share of the remaining variance that unseen stretches show to be no noise, and whether it matters.

    It matters where it is material and more than a friction law of another form would bring, or larger than such a law
    may be off.
    """
    # everything: sums of squares [n] of what is left, (N·m)²; explained: the same of the torque, all joints
    shares = np.clip(np.array(left.share), 0.0, 1.0)
    whole = float(everything.sum())
    share = float(shares @ everything) / whole if whole > 0.0 else 0.0
    square = float(left.square.sum())
    gain = _rms_gain(left.gain.sum(axis=1), share, square)
    beyond = left.beyond.sum(axis=1)
    apart = _rms_gain(beyond, float(beyond.sum()) / square if square > 0.0 else 0.0, square)
    large = float(left.gain.sum()) > LAW_ERROR**2 * explained
    certain = bool(left.findings) and gain.value >= least_gain and gain.low > 0.0
    unknown = certain and (large or (apart.value >= least_gain and apart.low > 0.0))
    words = left.description if unknown else ""
    return Unexplained(share, words, tuple(shares.tolist()), left.p_value, unknown, gain, planted=left.planted)


def _rms_gain(gain: Numbers, share: float, square: float) -> Interval:
    """Return 1 − rms ratio of a share of the variance, from what each stretch [K] gains of a sum of squares."""
    half = CERTAIN * standard_error(gain) / square if square > 0.0 else 0.0
    return Interval(*(1.0 - float(np.sqrt(1.0 - min(end, 1.0))) for end in (share, share - half, share + half)))


# --- where it shows ---------------------------------------------------------------------------------------------------


CELLS = 14  # on each side
COARSE = 2  # cells on each side of those in which the choice of the signals is made
FEWEST = 5  # blocks in a cell that is drawn


def remainder_map(
    series: Series, left: Numbers, remainder: Remainder, joints: Sequence[str], tendons: Sequence[str]
) -> RemainderMap | None:
    """Return the map of the joint with the largest prediction [B, n], N·m; None if nothing is predicted."""
    power = np.sum(remainder.prediction[series.used] ** 2, axis=0)
    joint = int(np.argmax(power))
    if not power[joint]:
        return None
    signals = _signals(series, joints, tendons)
    followed = {finding.group for finding in remainder.findings if finding.joint == joint + 1}
    if "angle" in followed and len(joints) > 1:
        signals = {label: values for label, values in signals.items() if label.startswith("angle")}
    cells = {name: _cells(values[series.used]) for name, values in signals.items()}
    if len(cells) < 2:
        return None
    wave = left[series.used, joint]
    one, two = max(combinations(cells, 2), key=lambda pair: _comes_back(wave, *(cells[name][1] for name in pair)))
    (columns, column), (rows, row) = cells[one], cells[two]
    number = row * CELLS + column
    count = np.bincount(number, minlength=CELLS**2)
    total = np.bincount(number, left[series.used, joint], minlength=CELLS**2)
    mean = np.where(count >= FEWEST, total / np.maximum(count, 1), np.nan)
    return RemainderMap(joint + 1, (one, two), (columns, rows), mean.reshape(CELLS, CELLS))


def _signals(series: Series, joints: Sequence[str], tendons: Sequence[str]) -> dict[str, Numbers]:
    """Return the recorded signals [B] that vary, by their labels."""
    signals = {f"angle of {name} (rad)": series.angle[:, j] for j, name in enumerate(joints)}
    signals |= {f"velocity of {name} (rad/s)": series.velocity[:, j] for j, name in enumerate(joints)}
    signals |= {f"force of {name} (N)": series.force[:, i] for i, name in enumerate(tendons)}
    return {label: values for label, values in signals.items() if np.ptp(values[series.used]) > 1e-12}


def _cells(values: Numbers) -> tuple[Numbers, Indices]:
    """Return the edges of cells of equal width between the outer hundredths of the values, and the cell of each."""
    low, high = np.quantile(values, (0.01, 0.99))
    edges = np.linspace(low, max(high, low + 1e-12), CELLS + 1)
    return edges, np.clip(np.searchsorted(edges, values, side="right") - 1, 0, CELLS - 1)


def _comes_back(wave: Numbers, column: Indices, row: Indices) -> float:
    """Return by how much the cells' means of one half of a wave [R] lower the squares of the other half."""
    # slow signals such as the pretension are never twice at one place, so they would follow any wave within a half
    number = row // COARSE * CELLS + column // COARSE
    gain, middle = 0.0, len(wave) // 2
    for seen, unseen in ((slice(middle), slice(middle, None)), (slice(middle, None), slice(middle))):
        count = np.bincount(number[seen], minlength=CELLS**2)
        mean: Numbers = np.bincount(number[seen], wave[seen], minlength=CELLS**2) / (count + FEWEST)
        gain += float(np.sum(wave[unseen] ** 2 - (wave[unseen] - mean[number[unseen]]) ** 2))
    return gain
