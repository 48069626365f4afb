"""Model and simulated finger speak of the same finger: the model has the rig's static friction, nothing is fitted.

On free motion the friction model leaves less than a third of every joint torque's rms.
"""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from repository_paths import ROOT
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import read_recording

EXAMPLES = ROOT / "examples"
FINGER = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
FREE = EXAMPLES / "demo_recording" / "index_finger_free.parquet"
NEVER = 1e6  # N·m; the bias must not freeze

Array = NDArray[np.float64]


def left_over(description: dict[str, Any], recording: dict[str, Array]) -> Array:
    """[n] rms of the compensated torque over rms of the joint torque."""
    finger = copy.deepcopy(description)
    finger["contact"] = {"threshold": [NEVER] * len(finger["joints"])}
    outputs = Instance.from_description(finger).run(recording)
    left, before = (np.mean(outputs[name] ** 2, axis=0) for name in ("compensated_torque", "joint_torque"))
    return np.asarray(np.sqrt(left / before))


def with_friction(description: dict[str, Any], factor: float) -> dict[str, Any]:
    """All friction of tendons and joints times a factor."""

    def scaled(node: Any) -> Any:
        if isinstance(node, list):
            return [scaled(each) for each in node]
        if isinstance(node, dict):
            keys = {"static", "coulomb", "viscous"}
            return {key: factor * value if key in keys else scaled(value) for key, value in node.items()}
        return node

    return {key: scaled(value) if key in ("joints", "tendons") else value for key, value in description.items()}


def test_issue_3_the_model_leaves_less_than_a_third_of_the_index_fingers_torque() -> None:
    left = left_over(FINGER, read_recording(FREE).arrays())
    assert np.all(left < 1 / 3), left


@pytest.mark.parametrize("factor", [0.0, 0.5, 2.0])
def test_with_other_friction_it_leaves_more(factor: float) -> None:
    """It is the friction model that explains the torque, not the bias that follows it."""
    recording = read_recording(FREE).arrays()
    right, wrong = left_over(FINGER, recording), left_over(with_friction(FINGER, factor), recording)
    assert np.all(wrong > 1.2 * right), (wrong, right)
    assert np.any(wrong > 1 / 3), wrong
