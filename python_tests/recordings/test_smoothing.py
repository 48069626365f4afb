"""Signals smoothed without lag."""

from __future__ import annotations

import numpy as np

from tendonfmu.recordings.signal_noise import zero_phase

RATE = 1000.0


def test_smoothing_does_not_lag_and_keeps_the_motion() -> None:
    time = np.arange(20_000) / RATE
    clean = np.sin(2 * np.pi * 0.3 * time) + 0.5 * np.sin(2 * np.pi * 2.0 * time)
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(time))
    left = zero_phase(clean + noise, 20.0, RATE) - clean
    slope = np.gradient(clean, time)
    assert abs(left @ slope / (slope @ slope)) < 1e-4, "s of lag"
    assert left.std() < 0.3 * noise.std()
    assert np.abs(left[np.r_[:200, -200:0]]).max() < 5.0 * left.std(), "nothing swings in at the ends"
