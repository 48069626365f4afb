"""The regression that the field identifies such an arm with: a rigid body in base parameters, Coulomb and viscous."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from psm_recordings import JOINTS, log_of, rate_of
from scipy.signal import butter, sosfiltfilt

Array = NDArray[np.float64]

CUTOFF = 8.0  # Hz, as in the maps
SIGN = 0.01  # of the largest speed, over which the sign turns
STRIBECK = 0.1  # of the largest speed, over which friction falls from rest


class RigidBody:
    """Effort of a joint: inertia, coupled inertia, gravity of links and counterweight, friction."""

    def __init__(self, joint: int, names: Sequence[str], stribeck: bool) -> None:
        self.joint, self.stribeck = joint, stribeck
        self.fastest = max(float(np.abs(log_of(name)[f"joint_velocity_{joint}"]).max()) for name in names)
        design = np.vstack([self._columns(name) for name in names])
        effort = np.concatenate([log_of(name)[f"effort_{joint}"] for name in names])
        scale = np.maximum(np.sqrt((design**2).mean(axis=0)), 1e-12)
        self.numbers = np.linalg.lstsq(design / scale, effort, rcond=1e-6)[0] / scale

    def _columns(self, name: str) -> Array:
        log, rate = log_of(name), rate_of(name)
        low_pass = butter(2, CUTOFF, fs=rate, output="sos")
        angle = [log[f"joint_position_{k}"].to_numpy() for k in JOINTS]
        speed = [sosfiltfilt(low_pass, log[f"joint_velocity_{k}"]) for k in JOINTS]
        turn = [np.gradient(values) * rate for values in speed]
        own, at = turn[self.joint - 1], speed[self.joint - 1] / self.fastest
        sine, cosine = np.sin(angle[:2]), np.cos(angle[:2])
        gravity = [sine[0] * cosine[1], cosine[0] * sine[1], cosine[0] * cosine[1], sine[1], sine[0]]
        inertia = [own, own * angle[2], own * angle[2] ** 2, own * cosine[1] ** 2]
        coupled = [turn[k] for k in range(3) if k != self.joint - 1]
        sign = np.tanh(at / SIGN)
        friction = [sign, at, *([sign * np.exp(-np.abs(at) / STRIBECK)] if self.stribeck else [])]
        by_insertion = [values * angle[2] for values in gravity[:3]]
        rows = [np.ones_like(own), *inertia, *coupled, *gravity, *by_insertion, *friction]
        return np.column_stack(rows)

    def error(self, name: str) -> float:
        """Error on a recording, as a part of the effort's root mean square."""
        effort = log_of(name)[f"effort_{self.joint}"].to_numpy()
        return float(np.sqrt(np.mean((effort - self._columns(name) @ self.numbers) ** 2) / np.mean(effort**2)))
