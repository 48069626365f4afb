"""A two-joint finger as a user writes it: imposed motion, Coulomb friction smoothed by tanh(v / vs), no memory."""

from __future__ import annotations

import numpy as np

from evidence.fingers.foreign import Array, Nominal, description, level_law, noisy, quantised

ARMS = np.array([[0.009, 0.0], [-0.0088, 0.0], [-0.007, 0.0081], [0.0072, -0.0078]])  # m
STIFFNESS = 4000.0  # N/m
ENTRY, INNER, SMOOTH = 0.035, 0.025, 0.002  # share, share, m/s
COVER, REST, JOINT, DAMPING = 0.025, 0.05, 0.006, 0.002  # N·m/rad, rad, N·m, N·m·s/rad
DELAY = 0.02  # s


def simulate(hidden: str, seconds: float, rng: np.random.Generator) -> dict[str, Array]:
    """Samples at 500 Hz; 50 mN and 2 µm of noise."""
    t = np.arange(-round(DELAY * 500), round(seconds * 500)) / 500.0
    frequency, phase = rng.uniform(0.1, 0.55, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    q = 0.05 + 0.28 * np.sin(2 * np.pi * frequency * t[:, None, None] + phase).sum(axis=2)
    v = np.gradient(q, t, axis=0)
    # shares lost at the entry and between the joints, (samples, tendons)
    lost_1 = ENTRY * np.tanh(v @ ARMS.T / SMOOTH)
    lost_2 = INNER * np.tanh(v[:, 1:] * ARMS[:, 1] / SMOOTH)
    passes = np.stack([1 - lost_1, (1 - lost_1) * (1 - lost_2)], axis=1) * ARMS.T  # (samples, joints, tendons)
    joint = COVER * (q - REST) + JOINT * np.tanh(v / 0.05) + DAMPING * v
    extra = np.zeros_like(q)
    if hidden == "gravity":
        extra[:, 0] = 0.06 * np.sin(q[:, 0] + 0.5)
    elif hidden == "cover_hardening":
        extra[:, 1] = 0.12 * q[:, 1] ** 3
    # the tendon forces that carry all that, nearest to the pretension
    wanted = 20.0 * (1 + 0.3 * np.sin(2 * np.pi * 0.07 * t + phase[0, 0]))[:, None] * np.ones(4)
    missing = joint + extra - np.einsum("kji,ki->kj", passes, wanted)
    shares = np.linalg.solve(passes @ passes.transpose(0, 2, 1), missing[:, :, None])
    force = wanted + (passes.transpose(0, 2, 1) @ shares)[:, :, 0]
    late = np.roll(force, round(DELAY * 500), axis=0) if hidden == "time_delay" else force
    rows = slice(round(DELAY * 500), None)
    position = q @ ARMS.T + force / STIFFNESS
    return {
        "time": t[rows],
        "force": noisy(late, 0.05, rng)[rows],
        "position": quantised(noisy(position, 2e-6, rng), 1e-6)[rows],
        "measured": (late @ ARMS)[rows],
    }


def describe(hidden: str) -> Nominal:
    """All of it is in the description, with rough numbers; no angle sensor."""
    entry, inner = level_law(0.025, 0.005), level_law(0.034, 0.005)
    joint = {"cover": {"stiffness": 0.018, "rest_angle": 0.0}, "friction": level_law(0.009, 0.1, 0.003)}
    tendons = [
        {"stiffness": STIFFNESS, "moment_arms": arms.tolist(), "edge_friction": [entry, inner if arms[1] else None]}
        for arms in ARMS
    ]
    return description("tanh_finger", [joint, joint], tendons)
