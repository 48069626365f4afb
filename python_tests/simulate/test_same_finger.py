"""The friction model explains the torque of the simulated finger in free motion: its laws are the rig's, not fitted."""

from __future__ import annotations

import copy
import json

import numpy as np

from repository_paths import ROOT
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import read_recording

FINGER = json.loads((ROOT / "examples/fingers/index_finger.json").read_text(encoding="utf-8"))
FREE = ROOT / "examples/demo_recording/index_finger_free.parquet"


def test_the_model_leaves_less_than_a_third_of_the_index_fingers_torque() -> None:
    """Not the bias that follows it: with half of the friction, or twice as much, each joint is left with more."""
    recording = read_recording(FREE).arrays()

    def left_over(factor: float) -> np.ndarray:
        """[n] rms of the compensated torque over rms of the joint torque, with all friction times a factor."""
        finger = copy.deepcopy(FINGER) | {"contact": {"threshold": [1e6] * len(FINGER["joints"])}}  # the bias follows
        laws = [finger["joints"], finger["tendons"]]
        while laws:
            node = laws.pop()
            for key, value in node.items() if isinstance(node, dict) else enumerate(node):
                if key in ("static", "coulomb", "viscous"):
                    node[key] = factor * value
                elif isinstance(value, (dict, list)):
                    laws.append(value)
        outputs = Instance.from_description(finger).run(recording)
        left, before = (np.mean(outputs[name] ** 2, axis=0) for name in ("compensated_torque", "joint_torque"))
        return np.asarray(np.sqrt(left / before))

    right = left_over(1.0)
    assert np.all(right < 1 / 3), right
    for factor in (0.5, 2.0):
        assert np.all(left_over(factor) > 1.2 * right), factor
