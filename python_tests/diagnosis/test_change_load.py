"""A torque that is there all the time now: told as a load, not as friction, and not where the reference wanders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from repetitions import repeated
from synthetic_series import make_series
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.names import reported_causes
from tendonfmu.diagnosis.reference import steady_load
from tendonfmu.diagnosis.result import Diagnosis, SteadyLoad
from tendonfmu.diagnosis.samples import Series
from worn_finger import WELL, How, finger, record, recording

LOAD = 0.05  # N·m
SECONDS = 24.0
NOISE = 0.004  # N·m
OFTEN = 10  # changes of the level in a minute


def series_of(count: int) -> Series:
    """As many recordings of SECONDS, of two joints; numbers from 0."""
    one = make_series(1, SECONDS)
    names = ("time", "target", "used", "angle", "velocity", "acceleration", "force", "tendon_velocity", "travel")
    number = np.repeat(np.arange(count), len(one.time))
    values = {name: np.concatenate([getattr(one, name)] * count) for name in names}
    return replace(one, **values, recording=number, segment=number)


def found_in(left: NDArray[np.float64], series: Series, then: int) -> SteadyLoad | None:
    """left: [B, n] N·m besides noise. then: recordings of the reference, the first ones."""
    noise = NOISE * np.random.default_rng(3).standard_normal(series.target.shape)
    return steady_load(series, left + noise, series.recording >= then)


def at_joint(series: Series, levels: list[float], joint: int = 2) -> NDArray[np.float64]:
    """[B, n] N·m of a level for each recording."""
    left = np.zeros_like(series.target)
    left[:, joint - 1] = np.array(levels)[series.recording]
    return left


# --- what a load is ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [LOAD, -LOAD])
def test_a_level_that_moved_is_a_load_at_its_joint(level: float) -> None:
    series = series_of(2)
    load = found_in(at_joint(series, [0.01, 0.01 + level]), series, 1)
    assert load is not None and load.joint == 2
    assert load.size.change.low <= level <= load.size.change.high
    assert load.size.reference.value == pytest.approx(0.01, abs=1e-3)
    assert load.size.now.value == pytest.approx(0.01 + level, abs=1e-3)
    rms = float(np.hypot(level, NOISE))
    assert load.gain.value == pytest.approx(1 - NOISE / rms, abs=0.02) and load.gain.low > 0.5


def test_the_largest_of_two_is_told() -> None:
    series = series_of(2)
    left = at_joint(series, [0.0, LOAD], joint=2) + at_joint(series, [0.0, -1.5 * LOAD], joint=1)
    load = found_in(left, series, 1)
    assert load is not None and load.joint == 1 and load.size.change.value < 0.0


def test_a_level_within_what_the_reference_leaves_is_no_load() -> None:
    """Its own rms about the level, or how far its recordings lie apart: twice as much is within it."""
    series = series_of(2)
    wandering = at_joint(series, [0.0, LOAD])
    turns = np.sign(np.sin(2 * np.pi * OFTEN / 60.0 * series.time))[:, None]
    assert found_in(wandering + 0.6 * LOAD * turns, series, 1) is None
    assert found_in(wandering + 0.3 * LOAD * turns, series, 1) is not None
    five = series_of(5)  # one of four references lies 0.75 of its distance off their mean, their rms is 0.43 of it
    assert found_in(at_joint(five, [0.0, 0.0, 0.0, LOAD, 1.5 * LOAD]), five, 4) is None
    assert found_in(at_joint(five, [0.0, 0.0, 0.0, LOAD, 2.0 * LOAD]), five, 4) is not None


def test_a_level_that_is_there_at_times_is_no_load() -> None:
    """In a fifth of the stretches it is gone: a contact, which the scan for events looks for."""
    series = series_of(2)
    left = at_joint(series, [0.0, LOAD])
    left[(series.recording == 1) & (series.time < 0.2 * SECONDS)] = -0.01
    assert found_in(left, series, 1) is None


def test_nothing_moved_is_no_load_and_too_little_says_nothing() -> None:
    series = series_of(2)
    assert found_in(np.zeros_like(series.target), series, 1) is None
    for seconds in (1.5, 5.0, 7.0):  # one stretch; two or three, of which no interval can be given
        short = replace(series, used=series.used & ((series.recording == 0) | (series.time < seconds)))
        load = found_in(at_joint(short, [0.0, LOAD]), short, 1)
        assert load is None or load.gain.low > 0.0
        assert load is None or seconds > 1.5
    nothing = replace(series, used=series.recording == 0)
    assert found_in(at_joint(nothing, [0.0, LOAD]), nothing, 1) is None


# --- recordings -------------------------------------------------------------------------------------------------------


def loaded(rest: float) -> Diagnosis:
    """A load on a finger of numpy, whose recording begins in motion, or after a rest."""
    then, now = How(motion=2, noise=1), How(motion=5, noise=2, rest=rest)
    return diagnose(
        finger(),
        [recording(record(replace(WELL, load=LOAD), now))],
        reference=[recording(record(WELL, then), "then.parquet")],
        kinematics=3,
    )


@pytest.mark.parametrize("rest", repeated([0.0, 2.0], 0))
def test_a_load_is_told_as_contact_and_not_as_friction(rest: float) -> None:
    """The bias of a recording that begins in motion is learned at its first jump; that makes no difference."""
    found = loaded(rest)
    assert found.verdict == "explained" and found.causes == () and found.load is not None
    change = found.load.size.change
    assert change.value == pytest.approx(LOAD, rel=0.01) and change.low < LOAD < change.high + 0.005 * LOAD
    (cause,) = reported_causes(found)
    assert (cause.where.effect, cause.where.joint) == ("contact", 1)
    assert "force_offset" in {each.effect for each in cause.confusable_with}
    assert cause.gain.low > 0.5 and "50" in cause.size and cause.changed == found.load.size
    assert found.gain.value == 0.0  # the bias takes it up at run time


@pytest.mark.long
def test_a_load_beside_a_change_is_told() -> None:
    now = record(replace(WELL, dry=1.4 * WELL.dry, load=0.02), motion=5, noise=2)
    found = diagnose(finger(), [recording(now)], reference=[recording(record(motion=2), "then.parquet")], kinematics=3)
    assert [each.where.effect for each in found.causes] == ["joint_friction"]
    assert found.load is not None and found.load.size.change.value == pytest.approx(0.02, rel=0.02)
