"""How large the error of a description is when it runs online: raw samples, its own filters, slow bias removed.

The error is taken from means over 10 ms, less a bias that moves within 2 s (splines, as in the search). The residual r
of the bias filter is not used for this, because it hides causes: the filter follows everything slow, such as a spring
or a weight, and single samples of r are mostly sensor noise. So r only shows that a cause does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.cause_search import bias_of, series_of
from tendonfmu.diagnosis.gain import squared_residual
from tendonfmu.diagnosis.series import block_prediction, make_grid
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Span, make_folds


class OnlineError:
    """Errors of several models over the same samples of the same recordings."""

    def __init__(self, data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> None:
        """Prepare the recordings."""
        self._recordings, self._grid = recordings, make_grid(recordings)
        series = series_of(data, recordings, self._grid)
        folds = make_folds(series)
        self._rows, self._stretch, self._stretches = folds.rows, folds.stretch, folds.stretches
        self._span = Span(bias_of(data, series)[self._rows])
        self._measured = series.target[self._rows] + block_prediction(data, recordings, self._grid)[self._rows]

    def square(self, data: Mapping[str, Any]) -> float:
        """Return Σ r² over all joints, (N·m)², of every sample; r is taken before the bias update."""
        return squared_residual(data, self._recordings)

    def by_stretch(self, data: Mapping[str, Any]) -> Numbers:
        """Return Σ e² over all joints, (N·m)² [K], by stretches of about 2 s."""
        predicted = block_prediction(data, self._recordings, self._grid)[self._rows]
        left = self._span.without(self._measured - predicted)
        sums = np.bincount(self._stretch, np.sum(left**2, axis=1), minlength=self._stretches)
        return np.asarray(sums, dtype=np.float64)
