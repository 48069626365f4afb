"""Other ways of explaining a recording: what every rival of a diagnosis sees, and how it names causes.

They see the residual of the refitted nominal model and the columns of all candidates, both free of what refitting and a
slow bias can mend by plain least squares, as with independent samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import t as student

from tendonfmu.diagnosis.cause import Where
from tendonfmu.diagnosis.view import View
from tendonfmu.statistics.splines import Span, basis, without

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_CAUSES = 4  # that any rival may name
SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class Trial:
    """A candidate at a place with one choice of its non-linear numbers, and its columns."""

    where: Where
    columns: slice

    @property
    def numbers(self) -> range:
        return range(self.columns.start, self.columns.stop)


@dataclass(frozen=True)
class Plain:
    """target [R] N·m and columns [R, c], orthogonal to the nuisance, and whose they are. Rows: the joints of the first
    block, those of the second, and so on."""

    target: Numbers
    columns: Numbers
    trials: tuple[Trial, ...]

    def of(self, trial: Trial) -> Numbers:
        return self.columns[:, trial.columns]


def plain(view: View) -> Plain:
    """What the rivals see: least squares and no more, as with independent samples."""
    used = view.series.used
    slow = Span(view.splines[used])

    def bare(values: NDArray[Any]) -> Numbers:
        return np.stack([slow.without(values[used, j]) for j in range(values.shape[1])], axis=1)

    nominal, columns = bare(view.columns.nominal), bare(view.columns.values)
    span = basis(nominal.reshape(-1, nominal.shape[2]))
    trials = tuple(
        Trial(Where(proposal.candidate.name, proposal.place.joint, proposal.place.tendon), proposal.columns)
        for proposal in view.columns.proposals
    )
    return Plain(view.residual[used].reshape(-1), without(columns.reshape(-1, columns.shape[2]), span), trials)


def least_power(power: Numbers) -> float:
    """Below it a column is rounding. power: [c] squares of all columns."""
    return 1e-12 * float(power.max())


# --- one cause after another, samples taken for independent -----------------------------------------------------------
# - correlation: the largest correlation, while its p-value (Student's t, Bonferroni over all columns) is below 1 %;
# - bic: the largest fall of Schwarz's criterion (1978), while it falls;
# - random_cv: the largest fall of the error in tenfold cross-validation over randomly split samples, while it falls;

FOLDS = 10

Choice = Callable[[Plain, Numbers], Trial | None]


def stepwise(data: Plain, choose: Choice) -> list[Trial]:
    """Adds what `choose` names, and takes it off target and columns, until it names none."""
    named: list[Trial] = []
    left = data
    while len(named) < MOST_CAUSES:
        trial = choose(left, np.einsum("rc,rc->c", left.columns, left.columns))
        if trial is None:
            break
        named.append(trial)
        span = basis(left.of(trial))
        trials = tuple(other for other in left.trials if other.where != trial.where)
        left = Plain(without(left.target, span), without(left.columns, span), trials)
    return named


def by_correlation(data: Plain, power: Numbers) -> Trial | None:
    total = float(data.target @ data.target)
    product = data.target @ data.columns
    share = product**2 / np.maximum(power * total, 1e-300) * (power > least_power(power))
    best = max(data.trials, key=lambda trial: float(share[trial.columns].max()), default=None)
    if best is None:
        return None
    r2 = min(float(share[best.columns].max()), 1.0 - 1e-12)
    freedom = len(data.target) - 2
    p_value = 2.0 * float(student.sf(np.sqrt(r2 * freedom / (1.0 - r2)), freedom)) * data.columns.shape[1]
    return best if p_value < SIGNIFICANCE else None


def by_bic(data: Plain, power: Numbers) -> Trial | None:
    rows, total = len(data.target), float(data.target @ data.target)

    def fall(trial: Trial) -> float:
        explained = float(np.sum((basis(data.of(trial)).T @ data.target) ** 2)) if shows(trial, power) else 0.0
        return float(-rows * np.log(max(1.0 - explained / total, 1e-12)) - len(trial.numbers) * np.log(rows))

    best = max(data.trials, key=fall, default=None)
    return best if best is not None and fall(best) > 0.0 else None


def by_random_cv(data: Plain, power: Numbers) -> Trial | None:
    fold = np.random.default_rng(0).integers(0, FOLDS, len(data.target))
    order = np.argsort(fold, kind="stable")
    starts = np.searchsorted(fold[order], np.arange(FOLDS))

    def gain(trial: Trial) -> float:
        if not shows(trial, power):
            return 0.0
        columns = data.of(trial)[order]
        score = np.add.reduceat(columns * data.target[order, None], starts, axis=0)
        gram = np.add.reduceat(np.einsum("ri,rj->rij", columns, columns), starts, axis=0)
        total = 0.0
        for k in range(FOLDS):
            a = np.linalg.pinv(gram.sum(axis=0) - gram[k], rcond=1e-9, hermitian=True) @ (score.sum(axis=0) - score[k])
            total += float(2.0 * a @ score[k] - a @ gram[k] @ a)
        return total

    best = max(data.trials, key=gain, default=None)
    return best if best is not None and gain(best) > 0.0 else None


STEPWISE: Mapping[str, Choice] = {"correlation": by_correlation, "bic": by_bic, "random_cv": by_random_cv}


def shows(trial: Trial, power: Numbers) -> bool:
    return bool(power[trial.columns].max() > least_power(power))


# --- a structural-residual test as fault diagnosis has it (Gertler 1998; Blanke et al. 2016): detect, then isolate ----
# Residuals are parity relations of the torque balance. One for each joint is the balance of that joint. One for each
# tendon is the part of the balance that no force of this tendon can enter: its component across the tendon's arms.
#
# Detection: a generalised likelihood ratio test for a mean that is not 0, in windows of three lengths. Noise is
# independent and normal; its variance is that of the first half of the recording (training), the second half is tested.
# The threshold is the chi-square quantile at 1 % over all windows and residuals (Bonferroni).
#
# Isolation: the fault signature matrix says which residuals an effect enters, which is where its columns have at least
# 5 % of their power. The effects whose signature is the pattern of residuals that fired are named, all of them: a set
# without an order, since effects that enter the same residuals (a spring and a weight at a joint) have the same
# signature. A pattern that is nobody's signature is an alarm without a name.

ENTERS = 0.05  # of a column's power; less would not fire while the rest of it does
WINDOWS = (0.1, 0.3, 1.0)  # s


@dataclass(frozen=True)
class Parity:
    """fired: [k] residuals, joints first, then tendons. causes: all effects with that signature."""

    fired: Flags
    causes: list[Where]


def by_parity(data: Plain, arms: Numbers, step: float) -> Parity:
    """arms: [m, n] m. step: s, of a block."""
    relations = parity_relations(arms)
    fired = detected(data.target.reshape(-1, arms.shape[1]), relations, step)
    signatures = signature_matrix(data, relations)
    named = [where for where, signature in signatures.items() if fired.any() and np.array_equal(signature, fired)]
    return Parity(fired, named)


def parity_relations(arms: Numbers) -> list[Numbers]:
    """[n, d] orthonormal directions of each residual: the n joints, then what is left of each tendon, where n > 1."""
    joints = arms.shape[1]
    relations = [np.eye(joints)[:, [j]] for j in range(joints)]
    if joints > 1:
        relations += [np.linalg.svd(across[None], full_matrices=True)[2][1:].T for across in arms]
    return relations


def detected(residual: Numbers, relations: list[Numbers], step: float) -> Flags:
    """[k] whether each residual fires. residual: [B, n] N·m."""
    half = len(residual) // 2
    training, test = residual[:half], residual[half:]
    lengths = [min(max(1, round(window / step)), max(len(test), 1)) for window in WINDOWS]
    looks = len(relations) * sum(len(test) // length for length in lengths)
    fired = []
    for directions in relations:
        spread = np.sqrt(np.mean((training @ directions) ** 2, axis=0))
        seen = (test @ directions) / np.maximum(spread, 1e-300)
        threshold = float(chi2.isf(SIGNIFICANCE / max(looks, 1), directions.shape[1]))
        fired.append(any(largest_ratio(seen, length) > threshold for length in lengths))
    return np.array(fired)


def largest_ratio(values: Numbers, length: int) -> float:
    """Twice the logarithm of the likelihood ratio of the window that shows most; values: [B, d] of variance 1."""
    count = len(values) // length
    means = values[: count * length].reshape(count, length, -1).mean(axis=1)
    return float((length * np.sum(means**2, axis=1)).max(initial=0.0))


def signature_matrix(data: Plain, relations: list[Numbers]) -> dict[Where, Flags]:
    """[k] for each effect at a place: which residuals it enters."""
    joints, power = len(relations[0]), np.einsum("rc,rc->c", data.columns, data.columns)
    numbers: dict[Where, list[int]] = {}
    for trial in data.trials:
        shown = [number for number in trial.numbers if power[number] > least_power(power)]
        numbers.setdefault(trial.where, []).extend(shown)
    signatures: dict[Where, Flags] = {}
    for where, chosen in numbers.items():
        if chosen:
            by_joint = (data.columns[:, chosen] / np.sqrt(power[chosen])).reshape(-1, joints, len(chosen))
            entering = [np.einsum("bjc,jd->bdc", by_joint, directions) for directions in relations]
            signatures[where] = np.array([np.mean(np.sum(part**2, axis=(0, 1))) >= ENTERS for part in entering])
    return signatures
