"""Events in a residual: pushes and stalls are found, noise, heavy tails and smooth effects are none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from repetitions import repeated
from synthetic_series import bias_splines, make_series, nuisance_of, residual_of, with_effect
from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.contact_scan import event_gain, left_out, reached, scan_events, unusual
from tendonfmu.diagnosis.result import Event
from tendonfmu.diagnosis.samples import Series

PUSHES = ((8.0, 8.4, 0, 1.0), (21.0, 22.4, 1, -1.0), (37.0, 37.8, 1, 1.0), (50.0, 51.1, 0, -1.0))  # s, s, joint, sign


def events_of(series: Series, usual: Numbers | None = None) -> tuple[Event, ...]:
    residual = residual_of(series, nuisance_of(series))
    return scan_events(series, residual, bias_splines(series), ["rec"], usual=usual)


def pushed(series: Series) -> Series:
    """Four pushes of six times the rms of the residual, with flanks of 50 ms."""
    rms = residual_of(series, nuisance_of(series)).std(axis=0)
    target = series.target.copy()
    for start, end, joint, sign in PUSHES:
        shape = np.clip(np.minimum(series.time - start, end - series.time) / 0.05, 0.0, 1.0)
        target[:, joint] += sign * 6.0 * rms[joint] * shape
    return replace(series, target=target)


@pytest.mark.parametrize("seed", repeated([11, 12], 0))
def test_pushes_are_found_with_time_and_joint(seed: int) -> None:
    series = pushed(make_series(seed))
    found = events_of(series)
    assert len(found) == len(PUSHES)
    for event, (start, end, joint, _) in zip(found, PUSHES, strict=True):
        assert joint + 1 in event.joints
        assert event.start == pytest.approx(start, abs=0.2)
        assert event.end == pytest.approx(end, abs=0.2)
        assert 0.04 < event.peak < 0.12
    out = left_out(series, found, ["rec"])
    assert out[(series.time > 21.1) & (series.time < 22.3)].all()
    assert not out[(series.time > 24.0) & (series.time < 36.0)].any()


def test_what_free_motion_reaches_elsewhere_shows_pushes_that_are_the_rule() -> None:
    """A touch every four seconds, of many sizes: by itself the recording has no usual residual."""
    free, series = make_series(13), make_series(14)
    spread, target = residual_of(series, nuisance_of(series)).std(axis=0), series.target.copy()
    starts = np.arange(3.0, 57.0, 4.0)
    for start, size in zip(starts, np.resize([4.0, 30.0, 8.0, 15.0], len(starts)), strict=True):
        shape = np.clip(np.minimum(series.time - start, start + 1.4 - series.time) / 0.05, 0.0, 1.0)
        target += size * spread * shape[:, None]
    pushes, usual = replace(series, target=target), reached(free)
    assert len(events_of(pushes)) < len(starts) // 2
    found = events_of(pushes, usual)
    assert all(any(event.start < start + 0.3 and event.end > start + 1.1 for event in found) for start in starts)
    assert events_of(series, usual) == ()


@pytest.mark.parametrize("seed", repeated([21, 22, 23], 0))
def test_noise_has_no_events(seed: int) -> None:
    assert events_of(make_series(seed)) == ()


def test_neither_has_a_strong_smooth_effect() -> None:
    """Friction at one end of the range, as strong as the noise: seldom visited, but no event."""
    series = make_series(25)
    signal = np.tanh(series.velocity[:, 0] / 0.02) * np.clip(series.angle[:, 0] - 0.2, 0.0, None)
    assert events_of(with_effect(series, nuisance_of(series), signal, joint=0, strength=1.0)) == ()


def test_says_what_is_seen_meanwhile() -> None:
    series = make_series(26)
    stall = (series.time > 30.0) & (series.time < 31.0)
    target, velocity, force = series.target.copy(), series.velocity.copy(), series.force.copy()
    target[stall, 1] += 0.09
    velocity[stall, 1] = 0.0
    force[stall, 2] = 0.0
    found = events_of(replace(series, target=target, velocity=velocity, force=force))
    event = max(found, key=lambda each: each.peak)
    assert event.recording == "rec"
    assert event.joints == (2,)
    assert "joint 2 stands still" in event.description
    assert "tendon 3 nearly slack" in event.description


def test_a_joint_that_comes_loose_needs_less_of_a_residual() -> None:
    """Reversals as rough as the stall hide it from the block maxima; its motion is like no other."""
    series = make_series(27)
    target, velocity = series.target.copy(), series.velocity.copy()
    for turn in range(4, 60, 5):
        target[turn * 100 : turn * 100 + 25, 0] += 0.05
    loose = (series.time > 41.0) & (series.time < 41.3)
    target[loose, 0] += 0.05
    assert events_of(replace(series, target=target)) == ()
    velocity[np.flatnonzero(loose)[:8], 0] = 60.0
    (event,) = events_of(replace(series, target=target, velocity=velocity))
    assert event.start == pytest.approx(41.0, abs=0.3)
    assert event.end == pytest.approx(41.3, abs=0.3)
    assert "joint 1 jumps" in event.description


# --- what leaving events out is worth --------------------------------------------------------------------------------

TIME = np.arange(0.0, 60.0, 0.01)
TOUCHES = tuple(Event("a.csv", start, start + 0.5, (1,), 0.05, "a push") for start in (5.0, 21.0, 38.0, 54.0))


@pytest.fixture
def recording() -> Callable[[float], Any]:
    """White noise of 1 mN·m, and in the events so much more."""

    def make(push: float) -> Any:
        left = np.random.default_rng(3).normal(scale=1e-3, size=(len(TIME), 2))
        for event in TOUCHES:
            left[(event.start <= TIME) & (event.end >= TIME)] += push
        model = SimpleNamespace(residual=left)
        return SimpleNamespace(
            path=Path("a.csv"), time=TIME, train=np.ones(len(TIME), dtype=bool), run=lambda data: model
        )

    return make


def test_it_is_what_the_pushes_add(recording: Callable[[float], Any]) -> None:
    found = event_gain({}, [recording(0.01)], TOUCHES)
    assert found is not None
    inside = 4 * 0.5 / 60.0
    assert found.value == pytest.approx(1 - 1 / np.sqrt(1 + inside * 0.01**2 / 1e-6), abs=0.02)
    assert 0.0 < found.low < found.value < found.high < 1.0


def test_samples_that_are_not_judged_do_not_count(recording: Callable[[float], Any]) -> None:
    touched = recording(0.01)
    touched.train &= TIME < 5.0
    found = event_gain({}, [touched], TOUCHES)
    assert found is not None and abs(found.value) < 1e-9
    touched.train[:] = False
    assert event_gain({}, [touched], TOUCHES) is None


def test_what_the_reference_has_as_well_is_no_change() -> None:
    kick, larger = (Event("b.csv", 0.0, 0.4, (1,), peak, "a kick") for peak in (0.06, 0.08))
    assert list(unusual([kick, larger], TOUCHES[:1], 1.0)) == [larger]
    elsewhere = Event("b.csv", 9.0, 9.5, (2,), 0.01, "a touch")
    assert list(unusual([kick, elsewhere], TOUCHES, 1.0)) == [elsewhere]
    assert list(unusual([kick], (), 1.0)) == [kick]
    assert list(unusual(TOUCHES, TOUCHES[:1], 1.0)) == list(TOUCHES)  # four where there was one
    assert not unusual(TOUCHES, TOUCHES[:1], 4.0)  # as many an hour
