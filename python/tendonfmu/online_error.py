"""What a description leaves of raw samples as it runs online, velocity filter and bias filter included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.fit_recordings import FitRecording
from tendonfmu.gain import residual_of
from tendonfmu.gain_interval import Blocks, blocks_of

Numbers = NDArray[np.float64]

SETTLING = 1.0  # s in which the bias finds its place


class OnlineError:
    """Of models over the same samples of the same recordings."""

    def __init__(self, recordings: Sequence[FitRecording]) -> None:
        """recordings: as they were measured; `train` says what is judged."""
        self._recordings = recordings
        self._blocks: list[Blocks] = []
        for each in recordings:
            judged = each.train.copy()
            for part in each.parts:
                judged[part] &= each.time[part] > each.time[part.start] + SETTLING
            self._blocks.append(blocks_of(each.time, judged))

    def by_stretch(self, data: Mapping[str, Any]) -> Numbers:
        """[K] Σ r² over all joints, (N·m)², by stretches of about 2 s; r before the bias has seen the sample."""
        found = []
        for recording, blocks in zip(self._recordings, self._blocks, strict=True):
            left = residual_of(data, recording)
            found.append(blocks.sums(np.nan_to_num(np.sum(left**2, axis=1))))
        return np.concatenate(found)
