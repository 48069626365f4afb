"""The drawing of a finger while its joints turn."""

from __future__ import annotations

import numpy as np
import pytest

from fmu_binary import FINGER
from tendonfmu.model import BentDrawing, finger_drawing

DRAWING = finger_drawing(FINGER)
JOINTS = len(DRAWING.joints)
LINE = np.column_stack([np.linspace(DRAWING.left, DRAWING.right - 0.1, 300), np.zeros(300)])


def test_a_positive_angle_turns_what_is_behind_the_joint_upwards() -> None:
    """A tendon with a positive moment arm is above, and pulls towards positive angles; 0 is as it was drawn."""
    angles = np.zeros((2, JOINTS))
    angles[1, 0] = 0.7
    straight, bent = BentDrawing(DRAWING, angles).at(LINE)
    np.testing.assert_allclose(straight, LINE, atol=1e-5)  # float32
    assert bent[:, 1].min() > -1e-6 and bent[-1, 1] > 1.0
    assert np.arctan2(*(bent[-1] - bent[-2])[::-1]) == pytest.approx(0.7, abs=1e-3)


def test_bending_keeps_lengths_and_distances_from_the_middle() -> None:
    angles = np.random.default_rng(3).uniform(-1.2, 1.2, (20, JOINTS))
    bent = BentDrawing(DRAWING, angles)
    middle, beside = bent.at(LINE), bent.at(LINE + np.array([0.0, 0.3]))
    steps = np.linalg.norm(np.diff(middle, axis=1), axis=-1)
    np.testing.assert_allclose(steps, np.diff(LINE[:, 0])[None, :].repeat(20, axis=0), rtol=2e-3)  # chords of arcs
    np.testing.assert_allclose(np.linalg.norm(beside - middle, axis=-1), 0.3, rtol=1e-5)
    end = middle[:, -1] - middle[:, -2]
    expected = angles.sum(axis=1)
    assert np.cos(np.arctan2(end[:, 1], end[:, 0]) - expected) == pytest.approx(1.0, abs=1e-4)
