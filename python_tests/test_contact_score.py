"""What counts as a push found and as an alarm without one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.contact_score import merged, score_contacts

TIME = np.arange(1000) / 100.0  # 10 s


def flags(*spans: tuple[float, float]) -> NDArray[np.bool_]:
    result = np.zeros(len(TIME), bool)
    for begin, end in spans:
        result |= (begin - 1e-9 <= TIME) & (end - 1e-9 > TIME)
    return result


def test_found_late_is_found() -> None:
    score = score_contacts(TIME, flags((2.0, 3.0), (5.0, 6.0)), flags((2.9, 3.0)))
    assert (score.pushes, score.found, score.outside, score.outside_share) == (2, 1, [], 0.0)


@pytest.mark.parametrize(("until", "found"), [(1.79, 1), (1.85, 0), (2.0, 0), (3.0, 0)])
def test_an_alarm_that_was_on_before_has_found_nothing(until: float, found: int) -> None:
    score = score_contacts(TIME, flags((2.0, 3.0)), flags((1.0, until), (2.5, 2.6)))
    assert score.found == found


def test_alarms_without_a_push_are_counted_once_and_by_their_time() -> None:
    """Two that are 0.05 s apart are one; what outlasts a push is one too."""
    score = score_contacts(TIME, flags((5.0, 6.0)), flags((1.0, 1.5), (1.55, 2.0), (5.2, 6.45)))
    assert score.found == 1
    assert [pytest.approx(each) for each in score.outside] == [(1.0, 2.0), (6.0, 6.45)]
    assert score.outside_share == pytest.approx((0.5 + 0.45 + 0.45) / 9.0)


def test_nobody_pushes_or_somebody_always_does() -> None:
    everywhere = np.ones(len(TIME), bool)
    assert score_contacts(TIME, ~everywhere, ~everywhere).outside_share == 0.0
    assert score_contacts(TIME, ~everywhere, everywhere).outside_share == 1.0
    always = score_contacts(TIME, everywhere, everywhere)
    assert (always.pushes, always.found, always.outside, always.outside_share) == (1, 1, [], 0.0)


def test_merging_closes_short_gaps_only() -> None:
    assert merged([(0.0, 1.0), (1.1, 2.0), (2.5, 3.0)], 0.2) == [(0.0, 2.0), (2.5, 3.0)]
    assert merged([], 1.0) == []
