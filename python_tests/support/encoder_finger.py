"""A finger in numpy with joint encoders, tendons that stretch and friction of its own, and what may be off in it.

It shares no code with the package. Motion is imposed; forces follow from the balance of the joints' covers, a
pretension that breathes, and friction in proportion to the force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Numbers = NDArray[np.float64]
RATE = 200.0  # Hz
COVER = 0.02  # N·m/rad
FRICTION, SLOW = 0.06, 0.0008  # of the tendon force; m/s, over which it turns
FORCE_NOISE, STEP, LAG = 0.02, 1e-6, 0.001  # N; m; s, by which positions come late


@dataclass(frozen=True)
class EncoderFinger:
    """A finger."""

    arms: Numbers  # [m, n]
    stiffness: Numbers  # [m]
    zero: Numbers  # [m]
    encoder: Numbers  # [n] rad, what each encoder reads too much
    hardening: float = 0.0  # per N; of the stretch
    noise: float = 2e-4  # rad, of the encoders
    pretension: float = 12.0  # N
    names: Sequence[str] = field(default_factory=list)

    def but(self, what: str, size: float, tendon: int = 0, joint: int = 0) -> EncoderFinger:
        """Return the finger with something off: "encoder", "zero", "arm" or "stiffness" (shares), "coupling" (m)."""
        if what == "nothing":
            return self
        name = {"arm": "arms", "coupling": "arms"}.get(what, what)
        values = getattr(self, name).copy()
        place: Any = {"arms": (tendon, joint), "encoder": joint}.get(name, tendon)
        values[place] = values[place] * (1.0 + size) if what in ("arm", "stiffness") else values[place] + size
        return replace(self, **{name: values})

    @property
    def description(self) -> dict[str, Any]:
        """The true description, but for what an encoder reads too much."""
        law = {"static": FRICTION, "coulomb": FRICTION, "stribeck_velocity": 0.005}
        return {
            "format": "tendonfmu-finger-1",
            "name": "encoder_finger",
            "joints": [{"name": f"joint_{j + 1}", "cover": {"stiffness": COVER}} for j in range(self.arms.shape[1])],
            "tendons": [
                {
                    "name": f"tendon_{i + 1}",
                    "stiffness": float(self.stiffness[i]),
                    "zero": float(self.zero[i]),
                    "moment_arms": self.arms[i].tolist(),
                    "edge_friction": [law if j == 0 else None for j in range(self.arms.shape[1])],
                }
                for i in range(len(self.arms))
            ],
            "bias": {"noise_time": 0.01},
            "contact": {"threshold": [0.05] * self.arms.shape[1]},
        }

    def recording(self, seed: int, seconds: float = 60.0) -> pd.DataFrame:
        """Return a recording of free motion."""
        random = np.random.default_rng(seed)
        time = np.arange(round(seconds * RATE)) / RATE
        joints = self.arms.shape[1]
        angle = np.tile(random.uniform(0.2, 0.5, joints), (len(time), 1))
        for rate in random.uniform(0.3, 2.0, (3, joints)):
            swing = np.sin(np.outer(time, rate) + random.uniform(0.0, 6.0, joints))
            angle += random.uniform(0.15, 0.3, joints) * swing
        speed = np.gradient(angle, 1.0 / RATE, axis=0)
        balanced = lsq_linear(self.arms.T, np.zeros(joints), (1.0, 3.0)).x  # pretension that turns no joint
        breath = self.pretension * (1.0 + 0.3 * np.sin(random.uniform(0.2, 0.5) * time + random.uniform(0.0, 6.0)))
        pull = np.outer(breath, balanced) + COVER * angle @ np.linalg.pinv(self.arms)
        force = pull * (1.0 + FRICTION * np.tanh(speed @ self.arms.T / SLOW))
        stretch = force / self.stiffness * (1.0 - self.hardening * force)
        position = self.zero + angle @ self.arms.T + stretch
        position -= LAG * np.gradient(position, 1.0 / RATE, axis=0)
        force = force + FORCE_NOISE * random.standard_normal(force.shape)
        position = STEP * np.round((position + STEP * random.standard_normal(position.shape)) / STEP)
        read = angle + self.encoder + self.noise * random.standard_normal(angle.shape)
        groups = {"tendon_force": force, "tendon_position": position, "joint_position": read}
        columns = {f"{name}[{k + 1}]": values[:, k] for name, values in groups.items() for k in range(values.shape[1])}
        frame: pd.DataFrame = pd.DataFrame({"time": time, **columns})
        return frame


def encoder_finger(seed: int, hardening: float = 0.0) -> EncoderFinger:
    """Make up a finger of two or three joints with a pair of tendons each, led past the joints before."""
    random = np.random.default_rng(seed)
    joints = int(random.integers(2, 4))
    arms = np.zeros((2 * joints, joints))
    for j in range(joints):
        arms[2 * j, : j + 1] = random.uniform(0.006, 0.011, j + 1)
        arms[2 * j + 1, : j + 1] = -random.uniform(0.006, 0.011, j + 1)
    tendons = len(arms)
    return EncoderFinger(
        arms,
        random.uniform(3000.0, 8000.0, tendons),
        random.uniform(-0.003, 0.003, tendons),
        np.zeros(joints),
        hardening,
        float(random.choice([5e-5, 2e-4, 5e-4])),
        float(random.uniform(9.0, 15.0)),
    )
