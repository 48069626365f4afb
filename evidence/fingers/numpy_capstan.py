"""Two joints, imposed motion with rests; tendons rub on round edges by the capstan equation, exp(−μ · wrap angle)."""

from __future__ import annotations

import numpy as np

from evidence.fingers.foreign import Array, Nominal, description, level_law, noisy, quantised

ARMS = np.array([[0.0088, 0.0], [-0.0090, 0.0], [-0.0070, 0.0080], [0.0073, -0.0077]])  # m
STIFFNESS = np.array([3900.0, 4500.0, 3400.0, 3700.0])  # N/m
MU, WRAP = 0.06, 0.5  # friction coefficient, rad of wrap at the entry
TOUCH = 15e-6  # m, travel over which the friction turns around
COVER, REST, JOINT, DAMPING = 0.025, 0.0, 0.005, 0.002
THICK, LOADED, GAIN, CATCH = 0.03, 3e-4, 0.12, 0.08  # N·m·s/rad, m, 1, N·m


def simulate(hidden: str, seconds: float, rng: np.random.Generator) -> dict[str, Array]:
    """Samples at 1 kHz; 20 mN of noise, 5 µm."""
    t = np.arange(0.0, seconds, 0.001)
    # a clock that stops for a while every few seconds makes the rests
    clock = t + 3.0 / (2 * np.pi) * np.sin(2 * np.pi * t / 3.0 + rng.uniform(0, 6))
    f, p = rng.uniform(0.08, 0.4, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    q = 0.27 * np.sin(2 * np.pi * f * clock[:, None, None] + p).sum(axis=2)
    v = np.gradient(q, t, axis=0)

    def turned(travel: Array) -> Array:
        """Dahl's model: −1 to 1, follows the direction of travel over TOUCH."""
        s = np.zeros_like(travel)
        for k in range(1, len(travel)):
            way = travel[k] - travel[k - 1]
            s[k] = np.sign(way) - (np.sign(way) - s[k - 1]) * np.exp(-np.abs(way) / TOUCH)
        return s

    passes = np.ones((len(t), 4, 2))
    passes[:, :, 0] = np.exp(-MU * WRAP * turned(q @ ARMS.T))
    inner = 0.35 + 0.4 * q[:, :1]  # rad of wrap between the joints, more when joint 1 is bent
    passes[:, :, 1] = passes[:, :, 0] * np.exp(-MU * inner * turned(q[:, 1:] * ARMS[:, 1]))
    direction = turned(q * 1e-3)  # the same in the joints, over 15 mrad
    joint = COVER * (q - REST) + JOINT * direction + (DAMPING if hidden != "viscous_friction" else 0.0) * v
    extra = np.zeros_like(q)
    if hidden == "viscous_friction":
        extra += THICK * v
    elif hidden == "unknown_catch":
        extra[:, 1] = CATCH * np.exp(-(((q[:, 1] + 0.1) / 0.08) ** 2)) * (v[:, 1] < 0)
    force = (21 + 6 * np.sin(2 * np.pi * 0.06 * t + p[0, 0]))[:, None] * np.ones(4)
    for _ in range(30):
        base = extra.copy()
        if hidden == "joint_load_friction":
            base[:, 0] += LOADED * force.sum(axis=1) * direction[:, 0]
        missing = joint + base - np.einsum("ij,kij,ki->kj", ARMS, passes, force)
        force = force + missing @ np.linalg.pinv(ARMS)
    seen = force * (1 - GAIN * np.array([0.0, 1.0, 0.0, 0.0])) if hidden == "force_gain" else force
    return {
        "time": t,
        "force": noisy(seen, 0.02, rng),
        "position": quantised(q @ ARMS.T + seen / STIFFNESS, 5e-6),
        "angle": quantised(q, 1e-4),
        "measured": seen @ ARMS,
    }


def describe(hidden: str) -> Nominal:
    """Edges with three working points where the wrap depends on joint 1; the joints' own friction."""
    tendons = []
    for i, arms in enumerate(ARMS):
        start = 0.02 if i % 2 else 0.045
        inner = {"angles": [-0.6, 0.0, 0.6], "laws": [level_law(share, 0.005) for share in (0.007, 0.028, 0.03)]}
        edge = [level_law(start, 0.005), inner if arms[1] else None]
        tendons.append({"stiffness": float(STIFFNESS[i]), "moment_arms": arms.tolist(), "edge_friction": edge})
    friction = level_law(0.007, 0.1, 0.0 if hidden == "viscous_friction" else 0.003)
    joint = {"cover": {"stiffness": 0.018, "rest_angle": 0.05}, "friction": friction}
    return description("capstan_finger", [joint, joint], tendons)
