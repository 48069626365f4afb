"""Four ways of naming a cause that take samples for independent, on the very residual and columns of `diagnose`.

Each gets the residual of the refitted nominal model and the columns of all candidates, both free of what refitting and
a slow bias can mend, and adds one cause after another as long as its own criterion wants it:

- correlation: the largest correlation, while its p-value (Student's t, Bonferroni over all columns) is below 1 %;
- bic: the largest fall of Schwarz's criterion (1978), while it falls;
- random_cv: the largest fall of the error in tenfold cross-validation over randomly split samples, while it falls;
- sindy: PySINDy's sequentially thresholded least squares over all columns at once (STLSQ, threshold a tenth of the
  residual's standard deviation per standard deviation of a column); causes by their coefficients.

    tendonfmu campaign cases.json -o campaign --beside bench/diagnosis_rivals.py:beside
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from tendonfmu.campaign_cases import Case
from tendonfmu.cause_search import View, look
from tendonfmu.description import read_finger
from tendonfmu.diagnosis_result import Where
from tendonfmu.extension_fit import FitSettings
from tendonfmu.fit_recordings import Held, prepare
from tendonfmu.nuisance import basis, without
from tendonfmu.recording import read_recording
from tendonfmu.signal_choice import choose

Numbers = NDArray[np.float64]

SIGNIFICANCE = 0.01
FOLDS = 10
MOST_CAUSES = 4
THRESHOLD = 0.1  # of STLSQ, both sides scaled to a standard deviation of 1


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
    """target [R] N·m and columns [R, c] of all joints one after another, orthogonal to the nuisance; whose they are."""

    target: Numbers
    columns: Numbers
    trials: tuple[Trial, ...]

    def of(self, trial: Trial) -> Numbers:
        return self.columns[:, trial.columns]


def plain(view: View) -> Plain:
    """What the rivals see: least squares and no more, as with independent samples."""
    used = view.series.used
    slow = basis(view.splines[used])

    def bare(values: NDArray[Any]) -> Numbers:
        wide = np.asarray(values[used], dtype=np.float64)
        return np.stack([without(wide[:, j], slow) for j in range(wide.shape[1])], axis=1)

    own, columns = bare(view.columns.nominal), bare(view.columns.values)
    span = basis(own.reshape(-1, own.shape[2]))
    trials = tuple(
        Trial(Where(proposal.candidate.name, proposal.place.joint, proposal.place.tendon), shape.columns)
        for proposal in view.columns.proposals
        for shape in proposal.shapes
    )
    return Plain(view.residual[used].reshape(-1), without(columns.reshape(-1, columns.shape[2]), span), trials)


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
    share = product**2 / np.maximum(power * total, 1e-300) * (power > _least(power))
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
    numbers = [number for number, _ in every if power[number] > _least(power)]
    owner = [trial for number, trial in every if power[number] > _least(power)]
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


def _least(power: Numbers) -> float:
    return 1e-12 * float(power.max())


def _shows(trial: Trial, power: Numbers) -> bool:
    return bool(power[trial.columns].max() > _least(power))


def answers(view: View) -> dict[str, list[Where]]:
    """What each rival names, first things first. sindy only where PySINDy is installed."""
    data = plain(view)
    found = {
        "correlation": stepwise(data, by_correlation),
        "bic": stepwise(data, by_bic),
        "random_cv": stepwise(data, by_random_cv),
    }
    with contextlib.suppress(ModuleNotFoundError):
        found["sindy"] = by_sindy(data)
    return {name: [trial.where for trial in trials] for name, trials in found.items()}


def beside(case: Case) -> Mapping[str, list[Where]]:
    """For `tendonfmu campaign --beside`: the rivals on a case, from the signals that `diagnose` chooses."""
    assert case.finger is not None
    finger = read_finger(case.finger)
    recordings = [prepare(finger, read_recording(path), case.kinematics, Held()) for path in case.recordings]
    chosen = choose(finger, recordings, FitSettings(threads=1))
    return answers(look(chosen.nominal.data, chosen.recordings, chosen.grid, chosen.least))
