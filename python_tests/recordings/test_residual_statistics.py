"""What says whether residuals are those of a consistent filter, against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tendonfmu.recordings.residuals import consistency, whiteness


@pytest.mark.parametrize("count", [40, 1000, 100000])
def test_the_interval_of_the_nis_is_that_of_chi_square(count: int) -> None:
    low, high = consistency([np.ones((count, 1))])["interval"]
    expected = stats.chi2.ppf([0.025, 0.975], count) / count
    assert [low, high] == pytest.approx(list(expected), rel=1e-9)


def test_whiteness_tells_white_from_coloured() -> None:
    white = np.random.default_rng(1).standard_normal((5000, 2))
    white[1000:1500] = np.nan
    coloured = white.copy()
    coloured[1:, 1] += 0.2 * np.nan_to_num(white[:-1, 1])
    found = whiteness([coloured])
    assert abs(found["lag_one"][0]) < 0.04 and found["ljung_box_p"][0] > 0.01
    assert found["lag_one"][1] == pytest.approx(0.2 / 1.04, abs=0.04) and found["ljung_box_p"][1] < 1e-6
