"""The gain of a change with its interval: true to a simulation, whatever the unit."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom

from tendonfmu.diagnosis.change_search import gain_of, interval_of

Numbers = NDArray[np.float64]

STRETCHES, ROWS, JOINTS = 24, 200, 2  # 2 s each, in blocks of 10 ms
MEMORY = 0.9  # of the noise from block to block, 0.1 s
DRAWS = 300


def difference(strength: float) -> tuple[Numbers, NDArray[np.int64]]:
    """[r, n] what a change makes of a motion that is uneven from stretch to stretch, and [r] stretch."""
    time = np.arange(STRETCHES * ROWS)
    stretch = time // ROWS
    uneven = np.random.default_rng(4).uniform(0.2, 1.8, STRETCHES)[stretch]
    return strength * (uneven * np.sign(np.sin(time / 37.0)))[:, None] * np.array([1.0, 0.4]), stretch


def noise(rng: np.random.Generator) -> Numbers:
    """[r, n] of variance 1 with a memory."""
    white = np.sqrt(1 - MEMORY**2) * rng.standard_normal((STRETCHES * ROWS + 100, JOINTS))
    return np.asarray(lfilter([1.0], [1.0, -MEMORY], white, axis=0)[100:])


@pytest.mark.parametrize("strength", [0.2, 0.5, 1.5])
def test_the_interval_covers_the_gain_of_this_motion(strength: float) -> None:
    """The true gain: of this motion and the noise's own variance. Of 300 intervals of 95 % as many hold it as a
    binomial number does in all but one of 10,000 tries; on both sides."""
    rng = np.random.default_rng(11)
    made, stretch = difference(strength)
    true = 1.0 - np.sqrt(JOINTS / (JOINTS + float(np.mean(np.sum(made**2, axis=1)))))
    found = []
    for _ in range(DRAWS):
        left = noise(rng)
        # the noise's own variance differs from draw to draw, which is no matter of the change
        left *= np.sqrt(JOINTS / np.mean(np.sum(left**2, axis=1)))
        found.append(interval_of(left + made, left, stretch))
    covered = sum(each.low <= true <= each.high for each in found)
    fewest, most = binom.ppf([5e-5, 1 - 5e-5], DRAWS, 0.95)
    assert fewest <= covered <= most, covered
    assert sum(true < each.low for each in found) <= binom.ppf(1 - 5e-5, DRAWS, 0.025)
    errors = [gain_of(noise(rng) + made, noise(rng), stretch)[1] for _ in range(3)]
    assert all(np.isfinite(errors))


def test_a_gain_has_no_unit_and_no_first_stretch() -> None:
    made, stretch = difference(0.7)
    left = noise(np.random.default_rng(14))
    one = gain_of(left + made, left, stretch)
    for scale in (1e-6, 1e6):
        assert gain_of(scale * (left + made), scale * left, stretch) == pytest.approx(one, rel=1e-9)
    assert gain_of(left + made, left, stretch + 40) == pytest.approx(one, rel=1e-12)
    assert gain_of(left + made, left, 3 * stretch) == pytest.approx(one, rel=1e-12)  # stretches between are not used
    order = np.random.default_rng(1).permutation(len(left))
    assert gain_of((left + made)[order], left[order], stretch[order]) == pytest.approx(one, rel=1e-9)
