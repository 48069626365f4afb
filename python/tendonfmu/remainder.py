"""How much of a residual could be explained at all, and where that part lives.

Two looks: a flexible learner on everything that is known of the motion and its past (remainder_learner.py), and steady
oscillations in time (spectral_line.py). Both have a calibrated null, family-wise over all joints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from tendonfmu import remainder_learner as learner
from tendonfmu.remainder_features import Features, features
from tendonfmu.remainder_text import described
from tendonfmu.spectral_line import Line, find_lines
from tendonfmu.whitening import Whitener, whitener

if TYPE_CHECKING:
    from tendonfmu.diagnosis_series import Series

Numbers = NDArray[np.float64]

LEVEL = 0.01  # of a wrong "unknown", family-wise
TRIED = 6  # choices of columns whose prediction is tried
LEAST_SHARE = 0.02  # of the residual's variance: what is less is not worth a word


@dataclass(frozen=True)
class Finding:
    """One part of the remainder.

    joint: from 1. group: key of GROUPS or "line". subject: "joint 2", "tendons 1 and 3", or "".
    """

    joint: int
    group: str
    subject: str
    p_value: float
    line: Line | None = None


@dataclass(frozen=True)
class Remainder:
    """What is explainable of a residual [B, n].

    share: per joint, of its variance that is predicted on unseen blocks. interval: 95 %
    of it. p_value: of there being nothing, family-wise over joints, groups and frequencies. unknown: whether there is
    something for certain and worth a word. prediction: [B, n] N·m, 0 where not used. findings: significant ones, the
    best first.
    """

    share: tuple[float, ...]
    interval: tuple[tuple[float, float], ...]
    p_value: float
    unknown: bool
    description: str
    prediction: Numbers
    findings: tuple[Finding, ...]


def measure_remainder(
    series: Series,
    residual: Numbers,
    nuisance: Sequence[Numbers],
    *,
    force: Numbers | None = None,
    seed: int = 0,
    level: float = LEVEL,
) -> Remainder:
    """residual: [B, n] N·m. nuisance: per joint, columns [B, p] whose span was taken from its residual (bias splines,
    derivatives of the nominal model); columns of the learner get the same. force: [B, m] N predicted by the model, for
    the learner; without it only what makes no torque of the measured one. Blocks that are not used are left out.
    """
    joints = residual.shape[1]
    residual = np.where(series.used[:, None], residual, 0.0)
    filters = whitener(series, residual)
    plan = learner.layout(series, filters.valid)
    if plan.blocks < learner.FEWEST_BLOCKS:
        nothing = ((0.0, 0.0),) * joints
        return Remainder((0.0,) * joints, nothing, 1.0, False, "", np.zeros_like(residual), ())
    with threadpool_limits(limits=1):
        seen = features(series, force=force, seed=seed)
        findings, gains, prediction = _look(residual, nuisance, seen, filters, plan, seed)
    filters = whitener(series, residual - prediction)
    lines, waves = [], np.zeros_like(residual)
    for joint in range(joints):
        left = residual[:, joint] - prediction[:, joint]
        found, waves[:, joint] = find_lines(series, left, learner.of_joint(filters, joint), level=level / joints)
        lines += [Finding(joint + 1, "line", "", min(1.0, joints * each.p_value), each) for each in found]
    p_value = min(each.p_value for each in [*findings, *lines])
    findings = sorted([each for each in [*findings, *lines] if each.p_value <= level], key=lambda each: each.p_value)
    prediction += waves
    share, interval = _shares(residual, prediction, plan)
    large = [max(gains[j], share[j] if interval[j][0] > 0.0 else 0.0) >= LEAST_SHARE for j in range(joints)]
    clear = [each for each in findings if large[each.joint - 1]]
    text = described(series, residual, prediction, clear, share) if clear else ""
    return Remainder(share, interval, p_value, bool(clear), text, prediction, tuple(findings))


def _look(
    residual: Numbers,
    nuisance: Sequence[Numbers],
    seen: Features,
    filters: Whitener,
    plan: learner.Layout,
    seed: int,
) -> tuple[list[Finding], list[float], Numbers]:
    """Of each joint the best finding and the share of the whitened residual predicted; and the prediction [B, n]."""
    learned = []
    for joint, columns in enumerate(nuisance):
        prepared = partial(learner.prepared, residual[:, joint], columns, seen, plan=plan)
        ready = prepared(own=learner.of_joint(filters, joint))
        plain = partial(prepared, own=Whitener(np.zeros((0, 1)), np.ones(1), filters.valid))
        learned.append(_learned(ready, plain, seen, plan, np.random.default_rng((seed, joint))))
    null = np.max([each.null for each in learned], axis=0)
    prediction = np.zeros_like(residual)
    prediction[plan.rows] = np.stack([each.values for each in learned], axis=1)
    findings = [_finding(joint + 1, each, null) for joint, each in enumerate(learned)]
    return findings, [each.gain for each in learned], prediction


@dataclass(frozen=True)
class _Learned:
    """Of one joint. surprise: the greatest. null: [DRAWS] of it. gain: share of the whitened residual it predicts.
    values: [U] N·m, predicted. named: choice that predicts best of those that have a name."""

    surprise: float
    null: Numbers
    gain: float
    values: Numbers
    named: learner.Choice


def _learned(
    ready: learner.Prepared,
    plain: Callable[[], learner.Prepared],
    seen: Features,
    plan: learner.Layout,
    rng: np.random.Generator,
) -> _Learned:
    """ready: whitened; plain: the same without. What is quick shows in the former only, its size in the latter."""
    skills, null = learner.skills(ready, seen, plan, rng)
    order = [skill.choice for skill in skills]
    everything = next(choice for choice in order if not choice.group)
    single = [choice for choice in order if choice.group][:TRIED]
    best = learner.Choice("", "", np.unique(np.concatenate([choice.columns for choice in single[: TRIED // 2]])))
    sharp = learner.predicted(ready, [*single, everything, best], seen, plan)
    named_ones = [k for k, choice in enumerate(single) if choice.group != "interaction"] or [0]
    named = single[max(named_ones, key=lambda number: sharp.gains[number])]
    tries = [np.zeros(len(plan.rows)), sharp.values]
    if max(sharp.gains) > LEAST_SHARE / 2.0:
        tries.append(learner.predicted(plain(), [named, everything, best], seen, plan).values)
    left = [float(np.sum((ready.target - values) ** 2)) for values in tries]
    return _Learned(skills[0].surprise, null, max(sharp.gains), tries[int(np.argmin(left))], named)


def _finding(joint: int, learned: _Learned, null: Numbers) -> Finding:
    p_value = float(1 + np.sum(null >= learned.surprise)) / (1 + len(null))
    return Finding(joint, learned.named.group, learned.named.subject, p_value)


def _shares(
    residual: Numbers, prediction: Numbers, plan: learner.Layout
) -> tuple[tuple[float, ...], tuple[tuple[float, float], ...]]:
    """1 − variance left over variance, per joint, with the interval of a ratio over blocks."""
    share, interval = [], []
    for joint in range(residual.shape[1]):
        before, guess = residual[plan.rows, joint], prediction[plan.rows, joint]
        whole = np.bincount(plan.block, before**2)
        gain = np.bincount(plan.block, 2.0 * before * guess - guess**2)
        ratio = float(gain.sum() / max(whole.sum(), 1e-300))
        error = float(np.sqrt(np.sum((gain - ratio * whole) ** 2)) / max(whole.sum(), 1e-300))
        share.append(ratio)
        interval.append((ratio - 1.96 * error, ratio + 1.96 * error))
    return tuple(share), tuple(interval)
