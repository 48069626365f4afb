"""What the model of the estimation makes of a description: its torques, and the noise and the bias that it states."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import native

NEVER = 1e9  # N·m, a contact threshold out of reach


def model_alone(description: Mapping[str, Any]) -> dict[str, Any]:
    """The description without contact and with a bias that only jumps, from 0."""
    alone = copy.deepcopy(dict(description))
    alone["contact"] = {"threshold": [NEVER] * len(alone["joints"])}
    kept = {key: value for key, value in (alone.get("bias") or {}).items() if key == "forget_rate"}
    still = {"drift_variance": 0.0, "initial_variance": 0.0, "noise_std": 1.0}
    alone["bias"] = kept | still | {"initial_torque": [0.0] * len(alone["joints"])}
    return alone


def model_torques(description: Mapping[str, Any], recording: Mapping[str, Numbers]) -> tuple[Numbers, Numbers]:
    """T [N, n] and the jumps of the bias added up [N, n], of a recording with kinematics source 3."""
    outputs = native.run_recording(model_alone(description), recording, 3)
    return outputs["friction_torque"] - outputs["bias_torque"], outputs["bias_torque"]


def noise_scale(description: Mapping[str, Any], time: Numbers, force: Numbers) -> Numbers:
    """[N, 1] standard deviation of the noise; that of the first sample is the root of bias.initial_variance."""
    bias = description.get("bias") or {}
    mean_force = np.abs(force).mean(axis=1)
    std = bias.get("noise_std", 0.01) + (bias.get("noise_std_per_force") or 0.0) * mean_force
    first = std[0] if bias.get("initial_variance") is None else np.sqrt(bias["initial_variance"])
    if bias.get("noise_time") is not None:
        std = std * np.sqrt(bias["noise_time"] / np.diff(time, prepend=np.nan))
    std[0] = first
    return np.asarray(std)[:, None]
