"""What a description gets wrong as it runs online, on raw samples and with its own filters, apart from a slow bias.

Means of 10 ms, less a bias that wanders within 2 s (splines, as the search has it). The bias filter's own r hides
causes: it follows what is slow, a spring or a weight, and single samples are mostly noise of the sensors. So r only
says that a cause does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnose.cause_search import bias_of, series_of
from tendonfmu.diagnose.gain import residual_of
from tendonfmu.diagnose.series import block_prediction, make_grid
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Span, make_folds

Numbers = NDArray[np.float64]


class OnlineError:
    """Of models over the same samples of the same recordings."""

    def __init__(self, data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> None:
        """data: any of the models, which share the settings of the bias. recordings: as they were measured; `train`
        says what is judged."""
        self._recordings, self._grid = recordings, make_grid(recordings)
        series = series_of(data, recordings, self._grid)
        folds = make_folds(series)
        self._rows, self._stretch, self._stretches = folds.rows, folds.stretch, folds.stretches
        self._span = Span(bias_of(data, series)[self._rows])
        self._measured = series.target[self._rows] + block_prediction(data, recordings, self._grid)[self._rows]

    def square(self, data: Mapping[str, Any]) -> float:
        """Σ r² over all joints, (N·m)²: every sample, before the bias has seen it."""
        left = (residual_of(data, each)[each.train] for each in self._recordings)
        return float(sum(np.nansum(each**2) for each in left))

    def by_stretch(self, data: Mapping[str, Any]) -> Numbers:
        """[K] Σ e² over all joints, (N·m)², by stretches of about 2 s."""
        predicted = block_prediction(data, self._recordings, self._grid)[self._rows]
        left = self._span.without(self._measured - predicted)
        sums = np.bincount(self._stretch, np.sum(left**2, axis=1), minlength=self._stretches)
        return np.asarray(sums, dtype=np.float64)
