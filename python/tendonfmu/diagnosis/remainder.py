"""How much of a residual is predictable, and what the predictable part depends on.

Two methods look at it:

- a flexible learner on everything that is known of the motion and its past (remainder_learner.py);
- a search for steady oscillations in time (statistics/spectral_line.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import ttest_1samp

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.remainder_features import Finding, features
from tendonfmu.diagnosis.remainder_learner import Choice, Learner, choices
from tendonfmu.diagnosis.remainder_text import described
from tendonfmu.statistics import Splines, Whitener, find_lines, make_folds, standard_error, whitener

if TYPE_CHECKING:
    from tendonfmu.diagnosis.series import Series


LEVEL = 0.01  # probability of a wrong "unknown", family-wise
LEAST_SHARE = 0.02  # of the residual's variance: smaller parts are not reported
CERTAIN = 2.0  # standard errors over the stretches


@dataclass(frozen=True)
class Remainder:
    """The predictable part of a residual [B, n]."""

    share: tuple[float, ...]  # per joint, share of the variance that is predicted on unseen stretches
    gain: Numbers  # the same by stretch, (N·m)² [stretches, n]
    square: Numbers  # sum of squares of the residual, (N·m)² [n]
    p_value: float  # probability of such a result if nothing is predictable, over all joints
    unknown: bool  # whether some part is certainly predictable
    description: str
    prediction: Numbers  # N·m [B, n], 0 where not used
    findings: tuple[Finding, ...]  # the parts that are certain


def measure_remainder(
    series: Series, residual: Numbers, splines: Splines, *, force: Numbers | None = None, seed: int = 0
) -> Remainder:
    """Measure the predictable part of a residual [B, n], N·m."""
    # splines: [B, s]; force: [B, m]
    joints, folds = residual.shape[1], make_folds(series)
    residual = np.where(series.used[:, None], residual, 0.0)
    if not folds.enough:
        nothing = np.zeros((folds.stretches, joints))
        return Remainder((0.0,) * joints, nothing, np.zeros(joints), 1.0, False, "", np.zeros_like(residual), ())
    seen = features(series, force=force, seed=seed)
    learner = Learner(seen, residual, splines, folds)
    tried = choices(seen)
    everything = learner.predicted(tried[0].columns)
    prediction, findings, p_values = np.zeros_like(residual), [], []
    for joint in range(joints):
        gain = learner.gains(everything)[:, joint]
        p_values.append(_p_value(gain))
        if gain.sum() > CERTAIN * standard_error(gain):
            prediction[folds.rows, joint] = everything[:, joint]
    large = [_share(learner.target[:, j], prediction[folds.rows, j]) >= LEAST_SHARE for j in range(joints)]
    if any(large):
        named = _named(learner, tried[1:])
        findings += [Finding(j + 1, named[j].group, named[j].subject) for j in range(joints) if large[j]]
    lines = _lines(series, residual, prediction, findings)
    p_value = min([1.0, *(joints * p_value for p_value in p_values), *lines])
    gain = learner.gains(prediction[folds.rows])
    share = tuple(_share(learner.target[:, j], prediction[folds.rows, j]) for j in range(joints))
    certain = [finding for finding in findings if share[finding.joint - 1] >= LEAST_SHARE]
    text = described(series, residual, prediction, certain, share) if certain else ""
    square = np.sum(learner.target**2, axis=0)
    return Remainder(share, gain, square, p_value, bool(certain), text, prediction, tuple(certain))


def _share(target: Numbers, prediction: Numbers) -> float:
    whole = float(np.sum(target**2))
    return max(0.0, 1.0 - float(np.sum((target - prediction) ** 2)) / whole) if whole > 0.0 else 0.0


def _p_value(gain: Numbers) -> float:
    """Return the p-value of gains by stretch [K]: a one-sided t test."""
    if not np.any(gain):
        return 1.0
    return float(ttest_1samp(gain, 0.0, alternative="greater").pvalue)


def _named(learner: Learner, tried: Sequence[Choice]) -> list[Choice]:
    """Return for each joint the named set of columns that predicts best."""
    known = [choice for choice in tried if choice.group != "interaction"]
    left = [np.sum((learner.target - learner.predicted(choice.columns)) ** 2, axis=0) for choice in known]
    return [known[k] for k in np.argmin(left, axis=0)]


def _lines(series: Series, residual: Numbers, prediction: Numbers, findings: list[Finding]) -> list[float]:
    """Add steady oscillations to `findings` and `prediction` [B, n]; return their p-values."""
    filters, p_values = whitener(series, residual - prediction), []
    joints = residual.shape[1]
    for joint in range(joints):
        own = Whitener(filters.coefficients[:, joint : joint + 1], filters.scale[joint : joint + 1], filters.valid)
        lines, wave = find_lines(series, residual[:, joint] - prediction[:, joint], own, level=LEVEL / joints)
        prediction[:, joint] += wave
        findings += [Finding(joint + 1, "line", "", line) for line in lines]
        p_values += [min(1.0, joints * line.p_value) for line in lines]
    return p_values
