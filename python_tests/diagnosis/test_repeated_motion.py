"""A motion of the reference that was made again: found with its shift, not under another load, taken off sample by
sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthetic_series import ARMS, STEP, make_series
from tendonfmu.diagnosis.reference import Repeat, find_repeats, less_reference, outside
from tendonfmu.diagnosis.samples import Series

SECONDS = 12.0


def joined(*parts: Series) -> Series:
    """Recordings one after another, by number."""
    count = [len(each.time) for each in parts]
    number = np.repeat(np.arange(len(parts)), count)
    names = ("time", "target", "used", "angle", "velocity", "acceleration", "force", "tendon_velocity", "travel")
    values = {name: np.concatenate([getattr(each, name) for each in parts]) for name in names}
    return replace(parts[0], **values, recording=number, segment=number)


def later(series: Series, seconds: float, lead: Series) -> Series:
    """The same motion after the last seconds of another, on a clock of its own."""
    rows = round(seconds / STEP)
    names = ("target", "used", "angle", "velocity", "acceleration", "force", "tendon_velocity", "travel")
    values = {
        name: np.concatenate([getattr(lead, name)[:rows], getattr(series, name)])[: len(series.time)] for name in names
    }
    return replace(series, **values)


def forces(series: Series, load: float = 0.0, pretension: float = 10.0) -> np.ndarray:
    """[B, m] N as a model predicts them: pretension and what carries a spring and a load, N·m."""
    carried = 0.02 * series.angle + load
    return np.asarray(pretension + carried @ np.linalg.pinv(ARMS))


THEN, FOREIGN = make_series(1, SECONDS), make_series(2, SECONDS)


@pytest.mark.parametrize("shift", [0.0, 1.7, 4.0])
def test_a_repeat_is_found_with_its_shift(shift: float) -> None:
    both = joined(THEN, later(THEN, shift, FOREIGN))
    (found,) = find_repeats(both, forces(both), [0], [1])
    assert (found.then, found.now) == (0, 1) and found.shift == pytest.approx(shift, abs=1e-9)
    assert found.begin == THEN.time[0]
    assert found.end == pytest.approx(THEN.time[-1] - shift, abs=1e-9)


def test_a_repeat_is_found_within_a_longer_reference_that_moves_more_elsewhere() -> None:
    parts = joined(replace(FOREIGN, angle=3.0 * FOREIGN.angle), THEN, make_series(4, SECONDS))
    count = len(THEN.time)
    reference = replace(parts, time=np.arange(3 * count) * STEP)
    both = joined(reference, THEN)
    (found,) = find_repeats(both, forces(both), [0], [1])
    assert found.shift == pytest.approx(THEN.time[0] - reference.time[count], abs=1e-9)
    assert found.end - found.begin == pytest.approx(THEN.time[-1] - THEN.time[0], abs=1e-9)


def test_a_controller_that_follows_as_well_repeats_it() -> None:
    rng = np.random.default_rng(3)
    wandering = 0.01 * np.ptp(THEN.angle, axis=0) * np.sin(2 * np.pi * 0.4 * THEN.time[:, None] + rng.uniform(0, 6, 2))
    near = joined(THEN, replace(THEN, angle=THEN.angle + wandering))
    assert len(find_repeats(near, forces(near), [0], [1])) == 1
    far = joined(THEN, replace(THEN, angle=THEN.angle + 5.0 * wandering))
    assert find_repeats(far, forces(joined(THEN, THEN)), [0], [1]) == []


@pytest.mark.parametrize(("load", "pretension"), [(0.03, 10.0), (0.0, 13.0), (0.0, 7.0)])
def test_the_same_motion_under_another_load_or_pretension_is_no_repeat(load: float, pretension: float) -> None:
    both = joined(THEN, THEN)
    count = len(THEN.time)
    force = forces(both)
    force[count:] = forces(THEN, load, pretension)
    assert find_repeats(both, force, [0], [1]) == []
    assert len(find_repeats(both, forces(both), [0], [1])) == 1


def test_another_motion_and_a_short_or_torn_one_are_no_repeats() -> None:
    for then, now in (
        (THEN, FOREIGN),
        (make_series(1, 4.5), make_series(1, 4.5)),
        (THEN, replace(THEN, time=THEN.time + np.where(THEN.time > 6.0, 1.0, 0.0))),
        (THEN, later(THEN, SECONDS - 4.0, FOREIGN)),
    ):
        both = joined(then, now)
        assert find_repeats(both, forces(both), [0], [1]) == []


# --- differences ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [0.0, 0.5, 0.5 + 0.4 * STEP, -0.3 * STEP])
def test_less_the_reference_a_straight_line_is_its_shift(shift: float) -> None:
    """Values in between are interpolated: exact for what is straight, whatever the shift."""
    both = joined(THEN, THEN)
    repeat = Repeat(0, 1, shift, THEN.time[0], THEN.time[-1])
    slopes = np.array([[2.0, -0.5], [1.0, 0.0], [0.25, 7.0]])
    line = 3.0 + both.time[:, None, None] * slopes
    left = less_reference(line, both, [repeat])
    now = np.flatnonzero(both.recording == 1)
    when = both.time[now] - shift
    inside = (when >= repeat.begin) & (when < repeat.end)
    assert inside.sum() > 1000
    np.testing.assert_allclose(left[now[inside]], np.broadcast_to(shift * slopes, (inside.sum(), 3, 2)), atol=1e-9)
    untouched = np.concatenate([np.flatnonzero(both.recording == 0), now[~inside]])
    assert np.array_equal(left[untouched], line[untouched])


def test_outside_are_the_reference_and_what_has_no_partner() -> None:
    """Also where the block of the reference is not used; another reference stays."""
    used = THEN.used.copy()
    used[500:520] = False
    both = joined(replace(THEN, used=used), later(THEN, 2.0, FOREIGN), FOREIGN)
    (repeat,) = find_repeats(both, forces(both), [0, 2], [1])
    found = outside(both, [repeat])
    assert found[both.recording == 0].all() and not found[both.recording == 2].any()
    own, time = found[both.recording == 1], both.time[both.recording == 1]
    assert own[time < 2.0].all()
    left_out = own[time >= 2.0]
    lost = np.flatnonzero(left_out)
    assert set(range(500, 520)) <= set(lost.tolist()) and len(lost) <= 20 + 3
    assert not outside(both, []).any()
