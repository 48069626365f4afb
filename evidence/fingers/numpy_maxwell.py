"""Three joints, imposed motion, friction at every edge as a sum of six Maxwell-slip elements (springs that slide)."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from evidence.fingers.foreign import Array, Nominal, description, level_law, noisy, quantised

ARMS = (
    np.array([[9.0, 0, 0], [-8.7, 0, 0], [-7.1, 8.2, 0], [7.4, -7.9, 0], [6.9, -6.4, 7.2], [-7.2, 6.6, -7.0]]) / 1000.0
)  # m
STIFFNESS = np.array([4200.0, 3700.0, 3500.0, 4400.0, 4000.0, 3300.0])  # N/m
SHARE = np.where(ARMS != 0.0, [0.03, 0.02, 0.018], 0.0)  # of the tendon force, before each joint
YIELD = np.geomspace(3e-6, 80e-6, 6)  # m, travel at which an element slides
DAMPING, COVER, REST = 0.006, 0.02, 0.05
LINKING, HIDDEN_SHARE, DRIFT = 0.05, 0.14, 1.2


def simulate(hidden: str, seconds: float, rng: np.random.Generator) -> dict[str, Array]:
    """Samples at 500 Hz; 30 mN of noise, 2 µm."""
    t = np.arange(0.0, seconds, 0.002)
    low = butter(4, 0.5, fs=500.0, output="sos")
    q = sosfiltfilt(low, rng.standard_normal((len(t) + 4000, 3)), axis=0)[2000:-2000]
    q *= 0.33 / q.std(axis=0)
    v = np.gradient(q, t, axis=0)
    share = SHARE.copy()
    if hidden == "edge_friction":
        share[4, 1] = HIDDEN_SHARE
    # travel of tendon i against the link before joint j: all joints from j on move it
    travel = np.cumsum((q[:, None, :] * ARMS)[:, :, ::-1], axis=2)[:, :, ::-1]
    z = np.zeros((6, 3, 6))
    slip = np.zeros((len(t), 6, 3))
    for k in range(1, len(t)):
        z = np.clip(z + (travel[k] - travel[k - 1])[:, :, None], -YIELD, YIELD)
        slip[k] = (z / YIELD).mean(axis=2)
    worn = 1 + DRIFT * (1 - np.exp(-t / 18.0)) if hidden == "friction_drift" else np.ones_like(t)
    lost = share * slip * worn[:, None, None]
    remains = np.cumprod(1 - lost, axis=2)  # of the force, after the edges up to joint j
    joint = COVER * (q - REST) + DAMPING * v
    extra = np.zeros_like(q)
    if hidden == "joint_coupling":
        pull = LINKING * (q[:, 1] - q[:, 2])
        extra[:, 1], extra[:, 2] = pull, -pull
    start = (19 + 6 * np.sin(2 * np.pi * 0.055 * t + 1.0))[:, None] * np.ones(6)
    force = start
    for _ in range(40):
        rubbing = np.einsum("ij,ki,kij->kj", ARMS, force, 1 - remains)
        force = start + (joint + extra + rubbing - start @ ARMS) @ np.linalg.pinv(ARMS)
    return {
        "time": t,
        "force": noisy(force, 0.03, rng),
        "position": quantised(q @ ARMS.T + force / STIFFNESS, 2e-6),
        "angle": quantised(q, 1e-4),
        "measured": force @ ARMS,
    }


def describe(hidden: str) -> Nominal:
    """Edges where tendons cross joints; no dry friction in the joints, but damping."""
    tendons = []
    for i, arms in enumerate(ARMS):
        factors = (0.7, 1.5, 0.9) if i % 2 else (1.3, 0.65, 1.2)
        edge = [level_law(share, 0.005) if share else None for share in (SHARE[i] * factors).tolist()]
        if hidden == "edge_friction" and i == 4:
            edge[1] = None
        tendons.append({"stiffness": float(STIFFNESS[i]), "moment_arms": arms.tolist(), "edge_friction": edge})
    joint = {"cover": {"stiffness": 0.03, "rest_angle": 0.0}, "friction": level_law(0.0005, 0.1, 0.008)}
    return description("maxwell_finger", [joint] * 3, tendons)
