"""What the fingers that are pushed share: noise, quantisation, and the form of a description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

Array = npt.NDArray[np.float64]
Nominal = dict[str, Any]


def frame(time: Array, force: Array, position: Array, angle: Array | None) -> pd.DataFrame:
    """The recording's columns from arrays (samples, tendons) [N], [m] and (samples, joints) [rad]."""
    columns = {"time": time}
    columns |= {f"tendon_force[{i + 1}]": force[:, i] for i in range(force.shape[1])}
    columns |= {f"tendon_position[{i + 1}]": position[:, i] for i in range(position.shape[1])}
    if angle is not None:
        columns |= {f"joint_position[{j + 1}]": angle[:, j] for j in range(angle.shape[1])}
    made: pd.DataFrame = pd.DataFrame(columns)
    return made


def noisy(values: Array, std: float, rng: np.random.Generator) -> Array:
    return values + std * rng.standard_normal(values.shape)


def quantised(values: Array, resolution: float) -> Array:
    return np.round(values / resolution) * resolution


def rough(value: float, rng: np.random.Generator) -> float:
    """A starting number: the true one times a factor of 0.6 to 1.6, even in its logarithm."""
    return float(f"{value * np.exp(rng.uniform(np.log(0.6), np.log(1.6))):.3g}")


def law(magnitude: float, speed: float, rng: np.random.Generator, viscous: float = 0.0, peak: float = 1.0) -> Nominal:
    """A rough symmetric law; `peak` is static over coulomb, and 1 leaves the Stribeck effect out."""
    coulomb = rough(magnitude, rng)
    return level_law(coulomb, speed, rough(viscous, rng) if viscous > 0.0 else 0.0) | {"static": coulomb * peak}


def level_law(coulomb: float, speed: float, viscous: float = 0.0) -> Nominal:
    """A symmetric law without Stribeck effect."""
    return {"static": coulomb, "coulomb": coulomb, "stribeck_velocity": speed, "viscous": viscous}


def description(
    name: str, joints: Sequence[Mapping[str, Any]], tendons: Sequence[Mapping[str, Any]], threshold: float = 0.03
) -> Nominal:
    """A finger description of joints and tendons with names, usual thresholds and a slow bias."""
    return {
        "format": "tendonfmu-finger-1",
        "name": name,
        "joints": [{"name": f"joint_{j + 1}", **joint} for j, joint in enumerate(joints)],
        "tendons": [{"name": f"tendon_{i + 1}", **tendon} for i, tendon in enumerate(tendons)],
        "velocity_threshold": {"tendon": 0.0005, "joint": 0.01},
        "velocity_filter_cutoff": 20.0,
        "bias": {"drift_variance": 1e-6, "noise_std": 0.01, "forget_rate": 5.0},
        "contact": {"threshold": [threshold] * len(joints)},
    }
