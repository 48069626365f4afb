"""What leaving events out is worth: on residuals made here, of which the answer is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tendonfmu.diagnosis.contact_scan import event_gain, unusual
from tendonfmu.diagnosis.result import Event

TIME = np.arange(0.0, 60.0, 0.01)
PUSHES = tuple(Event("a.csv", start, start + 0.5, (1,), 0.05, "a push") for start in (5.0, 21.0, 38.0, 54.0))


@pytest.fixture
def recording() -> Callable[[float], Any]:
    """White noise of 1 mN·m, and in the events so much more."""

    def make(push: float) -> Any:
        left = np.random.default_rng(3).normal(scale=1e-3, size=(len(TIME), 2))
        for event in PUSHES:
            left[(event.start <= TIME) & (event.end >= TIME)] += push
        model = SimpleNamespace(residual=left)
        return SimpleNamespace(
            path=Path("a.csv"), time=TIME, train=np.ones(len(TIME), dtype=bool), run=lambda data: model
        )

    return make


def test_it_is_what_the_pushes_add(recording: Callable[[float], Any]) -> None:
    found = event_gain({}, [recording(0.01)], PUSHES)
    assert found is not None
    inside = 4 * 0.5 / 60.0
    assert found.value == pytest.approx(1 - 1 / np.sqrt(1 + inside * 0.01**2 / 1e-6), abs=0.02)
    assert 0.0 < found.low < found.value < found.high < 1.0


def test_samples_that_are_not_judged_do_not_count(recording: Callable[[float], Any]) -> None:
    touched = recording(0.01)
    touched.train &= TIME < 5.0
    found = event_gain({}, [touched], PUSHES)
    assert found is not None and abs(found.value) < 1e-9
    touched.train[:] = False
    assert event_gain({}, [touched], PUSHES) is None


def test_what_the_reference_has_as_well_is_no_change() -> None:
    kick, larger = (Event("b.csv", 0.0, 0.4, (1,), peak, "a kick") for peak in (0.06, 0.08))
    assert list(unusual([kick, larger], PUSHES[:1], 1.0)) == [larger]
    elsewhere = Event("b.csv", 9.0, 9.5, (2,), 0.01, "a touch")
    assert list(unusual([kick, elsewhere], PUSHES, 1.0)) == [elsewhere]
    assert list(unusual([kick], (), 1.0)) == [kick]
    assert list(unusual(PUSHES, PUSHES[:1], 1.0)) == list(PUSHES)  # four where there was one
    assert not unusual(PUSHES, PUSHES[:1], 4.0)  # as many an hour
