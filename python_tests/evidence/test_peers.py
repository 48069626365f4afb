"""The arithmetic of the peers' page: what all tools share, on numbers that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tendonfmu as tf
from evidence.peers import error_table, pushes_by_size, together, wins
from evidence.peers.signals import CUTOFF, Case, delayed, filtered, signals_of
from evidence.peers.tools import Error, allowed, regressed, rms_unseen

ARMS = [[0.01], [-0.008]]
FINGER = {"tendons": [{"moment_arms": arms, "stiffness": 4000.0} for arms in ARMS]}
ROWS = [
    {"machine": name, "tool": tool, "rms": rms}
    for name, tool, rms in (
        ("MuJoCo finger", "TendonFMU", [3.0, 4.0]),
        ("MuJoCo finger", "boosted trees", [4.9, 0.1]),
        ("demo finger", "TendonFMU", [1.0, 1.0]),
    )
]


def recording() -> tf.Recording:
    """A joint that rubs 5 mN·m by sign, 2 % of the tendons' load and has a spring; 60 s at 200 Hz."""
    time = np.arange(12000) / 200.0
    angle = 0.4 * np.sin(1.7 * time) + 0.2 * np.sin(0.6 * time)
    velocity = np.gradient(angle, time)
    pull = 15.0 + 5.0 * np.sin(0.4 * time)
    sign = np.tanh(velocity / 0.02)
    arms = np.array(ARMS)[:, 0]
    # f1 = pull, f2 such that the joint is held
    load = pull * np.abs(arms).sum()
    torque = 0.005 * sign + 0.02 * load * sign + 0.03 * angle
    force = np.column_stack([pull, (arms[0] * pull - torque) / -arms[1]])
    return tf.Recording(Path("made"), time, {"tendon_force": force, "joint_position": angle[:, None]})


def case() -> Case:
    return Case(FINGER, [recording()], [recording()])


def test_an_offset_of_a_recording_is_no_error() -> None:
    left = {"first": np.array([[1.0], [3.0]]), "second": np.array([[10.0], [12.0]])}
    error: Error = lambda given: left[given.path.name]  # noqa: E731
    parts = [tf.Recording(Path(name), np.arange(2.0), {}) for name in left]
    assert rms_unseen(error, parts) == pytest.approx([1.0])


def test_the_filter_passes_what_is_slow_and_halves_the_power_at_its_cutoff() -> None:
    step, time = 1e-3, np.arange(4000) * 1e-3
    for frequency, gain in ((0.1, 1.0), (CUTOFF, np.sqrt(0.5))):
        made = filtered(np.sin(2 * np.pi * frequency * time)[:, None], step)[2000:]
        assert np.abs(made).max() == pytest.approx(
            gain * np.abs(np.sin(2 * np.pi * frequency * time[2000:])).max(), rel=0.01
        )
    assert filtered(np.full((10, 1), 7.0), step) == pytest.approx(7.0)  # without a swing at the start


def test_trees_do_not_see_the_torque_in_the_forces() -> None:
    """What pulls no joint: two sets of forces with the same rest and another torque look the same."""
    pulls = np.array([[10.0, 12.0], [10.0 + 0.01, 12.0 - 0.008]])  # along the arms
    first, second = allowed(case(), pulls)
    assert first == pytest.approx(second) and first.shape == (1,)


def test_history_repeats_the_first_sample() -> None:
    assert delayed(np.arange(4.0)[:, None], 2)[:, 0].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_regression_finds_the_friction_that_is_there() -> None:
    own = case()
    signals = signals_of(own, own.learned[0])
    left = signals.torque - regressed(own, signals)(signals)
    assert left.std() < 0.1 * signals.torque.std()


def test_the_least_error_of_all_joints_wins() -> None:
    assert together([3.0, 4.0]) == pytest.approx(np.sqrt(12.5))
    assert wins(ROWS) == {"MuJoCo finger": "boosted trees", "demo finger": "TendonFMU"}
    every = {**wins(ROWS), "Maxwell-slip finger": "", "da Vinci jaw": "", "PSM joints 1 and 2": ""}
    text = error_table({"rows": ROWS, "wins": every})
    assert "| boosted trees | **4.9 0.1** |" in text and "| TendonFMU | 3 4 |" in text


def test_pushes_are_counted_by_size() -> None:
    pushes = [
        {"size": size, "found": found, "delay": 0.02 if found else None}
        for size, found in ((2.0, False), (5.0, True), (9.0, False), (40.0, True))
    ]
    row = pushes_by_size({"detector": "a", "free_alarms": 0, "alarms": 1, "minutes": 2.0, "cpu": 3.0, "pushes": pushes})
    assert row["sizes"] == {"< 3": [0, 1], "3–10": [1, 2], "10–30": [0, 0], "≥ 30": [1, 1]}
    assert row["delay"] == pytest.approx(20.0)
