"""Two joints that move from rest to rest; every tendon has one Bouc-Wen hysteresis where it enters the finger."""

from __future__ import annotations

import numpy as np

from evidence.fingers.foreign import Array, Nominal, description, level_law, noisy, quantised

ARMS = np.array([[0.0092, 0.0], [-0.0092, 0.0], [-0.0075, 0.0075], [0.0075, -0.0075]])  # m
STIFFNESS = 3800.0  # N/m
SHARE = np.array([0.06, 0.05, 0.055, 0.045])  # of the tendon force
SPAN = 60e-6  # m, travel over which the hysteresis builds up
COVER, REST = np.array([0.02, 0.025]), 0.03
SOFT, ECCENTRIC, CREEPING, MEMORY = 0.035, 0.0025, 0.06, 2.0


def simulate(hidden: str, seconds: float, rng: np.random.Generator) -> dict[str, Array]:
    """Computed at 1 kHz, sampled at 500 Hz; 10 mN of noise, 1 µm."""
    t = np.arange(0.0, seconds, 0.001)
    q = np.zeros((len(t), 2))
    for j in range(2):  # minimum-jerk moves of 0.5 to 1.5 s, 0.1 to 0.6 s of rest between them
        begin, at = 0.0, 0.0
        while begin < seconds:
            length, goal = rng.uniform(0.5, 1.5), rng.uniform(-0.65, 0.75)
            s = np.clip((t - begin) / length, 0.0, 1.0)
            q[t >= begin, j] = (at + (goal - at) * s**3 * (10 - 15 * s + 6 * s**2))[t >= begin]
            begin, at = begin + length + rng.uniform(0.1, 0.6), goal
    travel = q @ ARMS.T
    z = np.zeros((len(t), 4))
    for k in range(1, len(t)):
        step = (travel[k] - travel[k - 1]) / SPAN
        z[k] = np.clip(z[k - 1] + step * (1 - z[k - 1] ** 2 * (0.5 + 0.5 * np.sign(step * z[k - 1]))), -1.0, 1.0)
    arms = np.broadcast_to(ARMS, (len(t), 4, 2)).copy()
    if hidden == "pulley_eccentricity":
        arms[:, 1, 0] += ECCENTRIC * np.sin(q[:, 0])
        travel[:, 1] += ECCENTRIC * (1 - np.cos(q[:, 0]))
    stiffness = COVER + np.array([SOFT, 0.0]) if hidden == "cover_stiffness" else COVER
    extra = np.zeros_like(q)
    if hidden == "unknown_creep":
        slow = 0.0
        for k, angle in enumerate(q[:, 1]):
            extra[k, 1] = CREEPING * (angle - slow)
            slow += 0.001 * (angle - slow) / MEMORY
    wanted = stiffness * (q - REST) + extra
    lost = SHARE * z
    force = (20 + 5 * np.sin(2 * np.pi * 0.08 * t))[:, None] * np.ones(4)
    for _ in range(30):  # tendons share what is missing until the joints are in balance
        missing = wanted - np.einsum("kij,ki->kj", arms, force * (1 - lost))
        force = force + missing @ np.linalg.pinv(ARMS)
    known = COVER * (q - REST) * ([0.0, 1.0] if hidden == "cover_stiffness" else 1.0) + (force * lost) @ ARMS
    lacking = extra.copy()
    if hidden == "cover_stiffness":
        lacking[:, 0] = stiffness[0] * (q[:, 0] - REST)
    elif hidden == "pulley_eccentricity":
        lacking = np.einsum("kij,ki->kj", ARMS - arms, force * (1 - lost))
    return {
        "time": t[::2],
        "force": noisy(force, 0.01, rng)[::2],
        "position": quantised(travel + force / STIFFNESS, 1e-6)[::2],
        "true_angle": q[::2],
        "measured": (force @ ARMS)[::2],
        "described": known[::2],
        "hidden": lacking[::2],
    }


def describe(hidden: str) -> Nominal:
    """One law a tendon, before the first joint; covers; joints without friction; no angle sensor."""
    tendons = []
    for arms, start in zip(ARMS, (0.04, 0.07, 0.08, 0.03), strict=True):
        edge = [level_law(start, 0.004), None]
        tendons.append({"stiffness": STIFFNESS, "moment_arms": arms.tolist(), "edge_friction": edge})
    joints = [{"cover": {"stiffness": 0.03, "rest_angle": 0.0}}, {"cover": {"stiffness": 0.018, "rest_angle": 0.0}}]
    if hidden == "cover_stiffness":
        joints[0] = {}
    return description("boucwen_finger", joints, tendons)
