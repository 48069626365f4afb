"""∂T/∂z and ∂Δb/∂z of the estimation on random fingers: against formulas in complex numbers (exact) and against
central differences of the core itself."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import oracle_fit
from fit_cases import groups, image_of, off_start, random_fit_case, shared_key, twin_of
from oracle_trace import Trace, with_values
from repetitions import repeated
from tendonfmu.errors import InputError
from tendonfmu.estimate.estimation import Estimator

Array = NDArray[Any]

FINGERS = 40
SAMPLES = 100
ROUNDING = 1e-10  # of the column's largest: sums of products of numbers between 1e-4 and 1e3
BY_DIFFERENCES = 1e-6  # of the column's largest, after one Richardson extrapolation


class Case:
    """A random finger, its estimator and twin, and both sides' rows at a point off the start."""

    def __init__(self, seed: int) -> None:
        self.description, self.recording, self.source = random_fit_case(seed, SAMPLES)
        group = groups(self.description, shared_key(seed) if seed % 2 else lambda path: path)
        self.estimator = Estimator(image_of(self.description), group)
        self.estimator.add_recording(self.recording, self.source)
        self.twin = twin_of(self.description, group, self.estimator.unknowns)
        self.z = off_start(self.estimator.unknowns, seed)
        moved = with_values(self.description, self.twin.moved(self.z))
        self.trace = Trace(moved, self.recording, self.source)
        self.rows = self.estimator.jacobian(0, self.z, 0, SAMPLES)
        # a force, a velocity within 1e-9 of its threshold may be decided either way
        self.compared = ~self.trace.near


@functools.cache
def case(seed: int) -> Case:
    return Case(seed)


def excess(found: Array, expected: Array) -> float:
    """Largest difference, in units of the largest of its column (last axis)."""
    largest = np.abs(expected).reshape(-1, expected.shape[-1]).max(axis=0)
    return float((np.abs(found - expected) / np.where(largest > 0.0, largest, 1.0)).max(initial=0.0))


@pytest.mark.parametrize("seed", repeated(range(FINGERS), 0, 3, 7, 10, 13, 20, 26, 29))
def test_torques_jumps_and_their_derivatives(seed: int) -> None:
    each = case(seed)
    torque, jump, d_torque, d_jump = (rows[each.compared] for rows in each.rows)
    expected = oracle_fit.derivatives(each.trace, each.twin, each.z)
    assert excess(torque, each.trace.torque[each.compared]) < ROUNDING
    np.testing.assert_allclose(jump, each.trace.jump[each.compared], rtol=0.0, atol=1e-14)
    assert excess(d_torque, expected[0][each.compared]) < ROUNDING
    assert excess(d_jump, expected[1][each.compared]) < ROUNDING


@pytest.mark.parametrize("seed", repeated(range(FINGERS), 0, 16))
def test_derivatives_are_the_cores_differences(seed: int) -> None:
    """Every column whose step stays within its bounds."""
    each = case(seed)
    _, _, d_torque, d_jump = each.rows

    def rows_at(column: int, step: float) -> Array:
        z = each.z.copy()
        z[column] += step
        return np.stack(each.estimator.jacobian(0, z, 0, SAMPLES)[:2])

    def difference(column: int, step: float) -> Array:
        return (rows_at(column, step) - rows_at(column, -step)) / (2.0 * step)

    compared = 0
    for column, unknown in enumerate(each.estimator.unknowns):
        step = 1e-5 * (abs(each.z[column]) or unknown.scale)  # so small that no tendon becomes slack
        if not unknown.lower + step <= each.z[column] <= unknown.upper - step:
            continue
        expected = (4.0 * difference(column, step / 2.0) - difference(column, step)) / 3.0
        # rounding of T in units of the derivative: what a difference cannot resolve
        floor = 1e-15 * max(np.abs(each.rows[0]).max(), 1e-3) / step
        found = np.stack([d_torque[..., column], d_jump[..., column]])
        error = np.abs(found - expected)[:, each.compared].max()
        assert error <= BY_DIFFERENCES * np.abs(expected).max() + 100.0 * floor, unknown.path
        compared += 1
    assert compared > 0.8 * len(each.z)


def test_any_part_of_a_recording() -> None:
    each = case(2)
    for start, stop in ((0, 1), (0, 7), (40, 41), (13, 100), (99, 100)):
        for found, whole in zip(each.estimator.jacobian(0, each.z, start, stop), each.rows, strict=True):
            np.testing.assert_array_equal(found, whole[start:stop])
    not_a_number = np.where(np.arange(len(each.z)) == 1, np.nan, each.z)
    for wrong in ((0, each.z, 0, SAMPLES + 1), (1, each.z, 0, 1), (0, each.z[:-1], 0, 1), (0, not_a_number, 0, 1)):
        with pytest.raises((InputError, IndexError, ValueError)):
            each.estimator.jacobian(*wrong)


@pytest.mark.parametrize(("start", "stop", "length"), [(0, 100, 4), (13, 97, 7), (40, 50, 10), (3, 100, 25)])
def test_means_over_blocks(start: int, stop: int, length: int) -> None:
    """Samples beyond the last whole block are not there."""
    each = case(2)
    blocks = (stop - start) // length
    for found, whole in zip(each.estimator.jacobian(0, each.z, start, stop, length), each.rows, strict=True):
        rows = whole[start : start + blocks * length]
        expected = rows.reshape(blocks, length, *rows.shape[1:]).mean(axis=1)
        assert found.shape == expected.shape and excess(found, expected) < 1e-12
