"""Runs of the core as a differentiable function: what is left without a learning bias, and its derivatives."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import small_finger
from fit_finger import made_recording
from tendonfmu.estimate.core_runs import CoreRuns, SlowDrift, slowest_drift
from tendonfmu.model import finger_from_data, finger_of, native
from tendonfmu.recordings import FitRecording, Held, Recording, prepare

REMEMBERING = {"effect": "presliding", "displacement": 0.4}


def finger(*extensions: dict[str, Any]) -> dict[str, Any]:
    return copy.deepcopy(small_finger()) | {"extensions": list(extensions)}


def prepared(recording: Recording, kinematics: int = 3) -> FitRecording:
    return prepare(finger_from_data(finger(), Path("small.json")), recording, kinematics, Held())


def test_it_leaves_the_torque_less_friction_and_known_load() -> None:
    recording, data = made_recording(rate=200.0), finger(REMEMBERING)
    runs = CoreRuns(finger_of(data), [prepared(recording)])
    still = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0, 0.0]}
    outputs = native.run_recording({**data, "bias": still, "contact": {"threshold": [1e9, 1e9]}}, recording.arrays(), 3)
    expected = outputs["compensated_torque"] - recording.groups["external_torque"]
    whole = expected[: len(expected) // 2 * 2].reshape(-1, 2, 2).mean(axis=1)  # blocks of 10 ms
    np.testing.assert_allclose(runs.residual(), whole, rtol=0, atol=1e-15)


def test_a_place_that_sticks_holds_its_friction() -> None:
    """Without presliding: nothing is learned and nothing forgotten, so that only constants are left."""
    quiet = small_finger()
    quiet["bias"] |= {"forget_rate": 0.0, "drift_variance": 0.0, "noise_std": 1e-9, "initial_variance": 0.0}
    recording = made_recording(rate=200.0)
    runs = CoreRuns(finger_of(finger()), [prepared(recording)])
    left = SlowDrift(runs.time, runs.stretch, runs.used).without(runs.residual())
    assert np.sqrt(np.mean(left**2)) < 0.012  # of 40 mN·m; the made bias wanders and jumps as its forget rate says


def test_columns_are_derivatives() -> None:
    data = finger(REMEMBERING)
    runs = CoreRuns(finger_of(data), [prepared(made_recording(rate=200.0))], threads=2)
    paths = [
        "tendons[1].edge_friction[1].coulomb",
        "joints[1].friction.stribeck_velocity",
        "extensions[1].displacement",
    ]
    begin = dict(
        zip(paths, [*(native.Instance.from_description(data).get(path) for path in paths[:2]), 0.5], strict=True)
    )
    sizes = dict(zip(paths, [0.03, 0.08, 0.4], strict=True))

    def columns(step: float, *together: list[str]) -> NDArray[np.float64]:
        moves = [({path: begin[path] + step * sizes[path] for path in chosen}, step) for chosen in together]
        return runs.columns(moves, begin)

    each = [[path] for path in paths]
    one_sided, central = columns(1e-4, *each), 0.5 * (columns(1e-3, *each) + columns(-1e-3, *each))
    scale = np.sqrt(np.mean(central**2, axis=(0, 1)))
    assert (scale > 1e-6).all()
    assert (np.sqrt(np.mean((one_sided - central) ** 2, axis=(0, 1))) < 0.01 * scale).all()
    both = columns(1e-4, paths[:2])[:, :, 0]
    np.testing.assert_allclose(both, one_sided[:, :, 0] + one_sided[:, :, 1], atol=0.05 * scale[:2].max())


def test_fast_recordings_are_thinned() -> None:
    recording = prepared(made_recording(rate=1000.0, duration=10.0))
    data = finger(REMEMBERING)
    every, thin = (CoreRuns(finger_of(data), [recording], rate=rate).residual() for rate in (np.inf, 400.0))
    assert 0.0 < np.sqrt(np.mean((every - thin) ** 2)) < 2e-4  # N·m, of 40 mN·m of friction


def test_a_constant_is_taken_out_of_each_stretch() -> None:
    time, stretch, used = np.arange(40) * 0.01, np.repeat([0, 1], 20), np.ones(40, dtype=bool)
    used[:3] = False
    values = np.where(stretch == 0, 2.0, -1.0)[:, None] + np.sin(np.arange(40))[:, None]
    left = SlowDrift(time, stretch, used).without(values)
    assert left.shape == (37, 1)
    assert np.abs(left[:17].mean()) < 1e-12
    assert np.abs(left[17:].mean()) < 1e-12


@pytest.mark.parametrize(("size", "follows"), [(0.0, False), (5.0, True)])
def test_a_drift_is_taken_out_where_rests_demand_it(size: float, follows: bool) -> None:
    rng = np.random.default_rng(4)
    time = np.arange(12_000) * 0.01
    still = time % 4.0 < 1.0
    drift = size * np.sin(2 * np.pi * time / 80.0)
    hysteresis = rng.standard_normal(31)[np.int64(time // 4.0)]  # what friction holds at each rest
    residual = (drift + hysteresis + 3.0 * np.sin(2 * np.pi * time / 2.0) * ~still)[:, None]
    found = slowest_drift(residual, time, np.zeros(12_000, dtype=np.int64), np.ones(12_000, dtype=bool), still)
    assert np.isfinite(found.knots) == follows
    left = found.without(drift[:, None])
    assert np.sqrt(np.mean(left**2)) <= 0.15 * size
