"""Where a path turns: what `span_of` takes travels from."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tendonfmu.diagnosis.span import _turning_points

TURNS = [0.0, 2.0, 0.5, 3.0, -1.0]
DEAD = 0.1


def path_through(turns: list[float], samples: int) -> np.ndarray:
    """A path that goes straight from turn to turn, and rests for a while at each."""
    strokes = [np.linspace(a, b, samples) for a, b in pairwise(turns)]
    return np.concatenate([np.append(stroke, [stroke[-1]] * 3) for stroke in strokes])


@pytest.mark.parametrize("samples", [2, 3, 50])
def test_a_path_turns_where_it_reverses(samples: int) -> None:
    """However many samples a stroke has."""
    np.testing.assert_array_equal(_turning_points(path_through(TURNS, samples), DEAD), TURNS)


def test_what_is_smaller_than_the_dead_zone_is_no_turn() -> None:
    """The farthest point counts, noise included."""
    path = path_through(TURNS, 200)
    noisy = path + np.random.default_rng(1).uniform(-0.04, 0.04, len(path))
    found = _turning_points(noisy, DEAD)
    assert len(found) == len(TURNS)
    np.testing.assert_allclose(found, TURNS, atol=0.04)


def test_a_path_that_does_not_move_has_no_turn() -> None:
    assert _turning_points(np.full(20, 0.3), 0.0).tolist() == [0.3]
    assert _turning_points(np.array([0.3]), DEAD).tolist() == [0.3, 0.3]
