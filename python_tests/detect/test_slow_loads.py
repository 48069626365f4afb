"""What the bias filter takes of slow loads, held to what the equations say (docs/reference/detection.md#limits)."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from repository_paths import ROOT
from tendonfmu.model.friction_places import moment_arms
from tendonfmu.model.native import run_recording

Numbers = NDArray[np.float64]
FINGER: dict[str, Any] = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
RATE, FORCE, JOINT = 500.0, 10.0, 1
RELEASE = 2.0  # s
STEADY = 0.4472  # s, (noise² · noise_time / drift_variance)^½ of the example's bias at 10 N
PER_NEWTON = [0.0003, 0.0007, 0.0006, 0.0004]  # N·m per N
INNOVATION = {
    "method": "innovation",
    "threshold": [0.02, 0.02, 0.02, 0.012],
    "threshold_per_force": [0.0025, 0.006, 0.005, 0.0035],
    "innovation": {"time": 0.05, "threshold": [4 * value for value in PER_NEWTON], "threshold_per_force": PER_NEWTON},
    "hold_time": 0.05,
    "release_time": RELEASE,
}


def resting(load: Numbers) -> dict[str, Numbers]:
    """A finger that stands at 10 N of pretension, its tendons holding a load [N] N·m on one joint."""
    arms = moment_arms(FINGER)
    stiffness = np.array([tendon["stiffness"] for tendon in FINGER["tendons"]])
    torque = np.zeros((len(load), arms.shape[1]))
    torque[:, JOINT] = load
    force = FORCE + (torque - FORCE * arms.sum(axis=0)) @ np.linalg.pinv(arms)
    return {"time": np.arange(len(load)) / RATE, "tendon_force": force, "tendon_position": force / stiffness}


@pytest.mark.parametrize("rise", [0.1, 1.0, 10.0])
def test_the_bias_takes_of_a_slow_load_what_its_time_constant_says(rise: float) -> None:
    time, top = np.arange(0, 6.0 + rise, 1 / RATE), 0.06
    made = resting(top * np.clip((time - 5.0) / rise, 0.0, 1.0))
    at = round((5.0 + rise) * RATE)
    left = top * STEADY / rise * (1 - np.exp(-rise / STEADY))  # of a ramp through a filter of first order
    never = run_recording(FINGER | {"contact": {"threshold": [1e6] * 4}}, made)
    assert never["residual"][at, JOINT] == pytest.approx(left, rel=0.02)
    paper, ours = (run_recording(data, made) for data in (FINGER, FINGER | {"contact": INNOVATION}))
    assert paper["contact"].any() == (left > 0.018 + 0.0027 * FORCE)
    assert ours["contact"].any() == (rise == 0.1)  # the change within 50 ms is 0.05/rise of the load beyond that
