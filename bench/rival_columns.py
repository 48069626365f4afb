"""What every rival of a diagnosis sees: the residual of the refitted nominal model, and the columns of all candidates.

Both are free of what refitting and a slow bias can mend, by plain least squares, as with independent samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis.cause_search import View
from tendonfmu.diagnosis.result import Where
from tendonfmu.statistics.splines import Span, basis, without

Numbers = NDArray[np.float64]

MOST_CAUSES = 4  # that any rival may name


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

    own, columns = bare(view.columns.nominal), bare(view.columns.values)
    span = basis(own.reshape(-1, own.shape[2]))
    trials = tuple(
        Trial(Where(proposal.candidate.name, proposal.place.joint, proposal.place.tendon), shape.columns)
        for proposal in view.columns.proposals
        for shape in proposal.shapes
    )
    return Plain(view.residual[used].reshape(-1), without(columns.reshape(-1, columns.shape[2]), span), trials)


def least_power(power: Numbers) -> float:
    """Below it a column is rounding. power: [c] squares of all columns."""
    return 1e-12 * float(power.max())
