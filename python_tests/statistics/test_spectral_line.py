"""Steady oscillations of a residual: found where samples can show them, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from tendonfmu.statistics.blocks import BlockSeries
from tendonfmu.statistics.whitening import find_lines


@pytest.mark.parametrize(("rate", "frequency"), [(100.0, 12.0), (30.0, 7.0)])
def test_a_line_is_found_and_none_beyond_half_the_rate(rate: float, frequency: float) -> None:
    """At 30 samples a second blocks of 10 ms are 33 ms apart, and a slow drift has an image near 30 Hz."""
    random = np.random.default_rng(4)
    time = np.arange(int(60 * rate)) / rate
    drift = np.cumsum(random.normal(0.0, 0.02, len(time)))
    residual = drift + 0.3 * np.sin(2 * np.pi * frequency * time) + random.normal(0.0, 0.3, len(time))
    flat = np.zeros(len(time), dtype=np.int64)
    series = BlockSeries(time, flat, flat, residual[:, None], np.ones(len(time), dtype=bool), 0.01)
    lines, _ = find_lines(series, residual, None, level=0.01)
    assert lines and all(line.frequency == pytest.approx(frequency, abs=0.1) for line in lines)
