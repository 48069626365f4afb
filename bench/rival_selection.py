"""Ways of naming a cause that take samples for independent, one cause after another as long as a criterion wants it.

- correlation: the largest correlation, while its p-value (Student's t, Bonferroni over all columns) is below 1 %;
- bic: the largest fall of Schwarz's criterion (1978), while it falls;
- random_cv: the largest fall of the error in tenfold cross-validation over randomly split samples, while it falls;
- sindy: PySINDy's sequentially thresholded least squares over all columns at once (STLSQ, threshold a tenth of the
  residual's standard deviation per standard deviation of a column); causes by their coefficients.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import t as student

from rival_columns import MOST_CAUSES, Numbers, Plain, Trial, least_power
from tendonfmu.statistics.splines import basis, without

SIGNIFICANCE = 0.01
FOLDS = 10
THRESHOLD = 0.1  # of STLSQ, both sides scaled to a standard deviation of 1

Choice = Callable[[Plain, Numbers], Trial | None]


def stepwise(data: Plain, choose: Choice) -> list[Trial]:
    """Adds what `choose` names, and takes it off target and columns, until it names none."""
    found: list[Trial] = []
    left = data
    while len(found) < MOST_CAUSES:
        trial = choose(left, np.einsum("rc,rc->c", left.columns, left.columns))
        if trial is None:
            break
        found.append(trial)
        span = basis(left.of(trial))
        trials = tuple(each for each in left.trials if each.where != trial.where)
        left = Plain(without(left.target, span), without(left.columns, span), trials)
    return found


def by_correlation(data: Plain, power: Numbers) -> Trial | None:
    total = float(data.target @ data.target)
    product = data.target @ data.columns
    share = product**2 / np.maximum(power * total, 1e-300) * (power > least_power(power))
    best = max(data.trials, key=lambda each: float(share[each.columns].max()), default=None)
    if best is None:
        return None
    r2 = min(float(share[best.columns].max()), 1.0 - 1e-12)
    freedom = len(data.target) - 2
    p_value = 2.0 * float(student.sf(np.sqrt(r2 * freedom / (1.0 - r2)), freedom)) * data.columns.shape[1]
    return best if p_value < SIGNIFICANCE else None


def by_bic(data: Plain, power: Numbers) -> Trial | None:
    rows, total = len(data.target), float(data.target @ data.target)

    def fall(trial: Trial) -> float:
        explained = float(np.sum((basis(data.of(trial)).T @ data.target) ** 2)) if _shows(trial, power) else 0.0
        return -rows * np.log(max(1.0 - explained / total, 1e-12)) - len(trial.numbers) * np.log(rows)

    best = max(data.trials, key=fall, default=None)
    return best if best is not None and fall(best) > 0.0 else None


def by_random_cv(data: Plain, power: Numbers) -> Trial | None:
    fold = np.random.default_rng(0).integers(0, FOLDS, len(data.target))
    order = np.argsort(fold, kind="stable")
    starts = np.searchsorted(fold[order], np.arange(FOLDS))

    def gain(trial: Trial) -> float:
        if not _shows(trial, power):
            return 0.0
        own = data.of(trial)[order]
        score = np.add.reduceat(own * data.target[order, None], starts, axis=0)
        gram = np.add.reduceat(np.einsum("ri,rj->rij", own, own), starts, axis=0)
        total = 0.0
        for k in range(FOLDS):
            a = np.linalg.pinv(gram.sum(axis=0) - gram[k], rcond=1e-9, hermitian=True) @ (score.sum(axis=0) - score[k])
            total += float(2.0 * a @ score[k] - a @ gram[k] @ a)
        return total

    best = max(data.trials, key=gain, default=None)
    return best if best is not None and gain(best) > 0.0 else None


def by_sindy(data: Plain) -> list[Trial]:
    """Causes with a coefficient that is left, the largest first."""
    import pysindy

    power = np.einsum("rc,rc->c", data.columns, data.columns)
    every = [(number, trial) for trial in data.trials for number in trial.numbers]
    numbers = [number for number, _ in every if power[number] > least_power(power)]
    owner = [trial for number, trial in every if power[number] > least_power(power)]
    scaled = data.columns[:, numbers] / np.sqrt(power[numbers] / len(data.target))
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=THRESHOLD, alpha=0.05), feature_library=pysindy.IdentityLibrary()
    )
    model.fit(scaled, t=1.0, x_dot=(data.target / data.target.std())[:, None])
    size = np.abs(model.coefficients()[0])
    found: list[Trial] = []
    for k in np.argsort(-size):
        if size[k] > 0.0 and owner[k].where not in [each.where for each in found]:
            found.append(owner[k])
    return found[:MOST_CAUSES]


def _shows(trial: Trial, power: Numbers) -> bool:
    return bool(power[trial.columns].max() > least_power(power))
