"""Two joints on motor-driven tendons with Karnopp's stick-slip friction in the joints: explicit Euler steps of 1 ms."""

from __future__ import annotations

import math

import numpy as np

from evidence.fingers.foreign import Array, Nominal, description, noisy, quantised

R1, R2, R3, R4 = (0.0085, 0.0), (-0.0091, 0.0), (-0.0066, 0.0083), (0.007, -0.0079)  # m
ARMS = np.array([R1, R2, R3, R4])
ARMS_LIST = ARMS.tolist()
STIFFNESS = (3600.0, 4100.0, 3900.0, 4300.0)  # N/m
MASS, SERVO, BRAKE = 0.4, 4e4, 220.0  # kg, N/m, N·s/m of every motor
INERTIA = (1.2e-4, 5e-5)  # kg·m²
DRY, LOADED, PEAK = (0.008, 0.007), (4e-4, 5e-4), 1.3  # N·m, m, static over sliding
DAMPING, COVER = 0.0025, 0.03  # N·m·s/rad, N·m/rad
STILL = 0.01  # rad/s, below it Karnopp's joint may stick
DT, HIDDEN_DRY = 0.001, 0.024


def simulate(hidden: str, seconds: float, rng: np.random.Generator) -> dict[str, Array]:
    """Samples at 250 Hz, after 2 s that are thrown away; 20 mN of noise, 1 µm."""
    f1, f2, p1, p2 = rng.uniform(0.1, 0.3, 2), rng.uniform(0.3, 0.6, 2), rng.uniform(0, 6, 2), rng.uniform(0, 6, 2)
    t = np.arange(-2.0, seconds, DT)[:, None]
    goal = 0.36 * np.sin(2 * np.pi * f1 * t + p1) + 0.24 * np.sin(2 * np.pi * f2 * t + p2)
    pull = 20 + 6 * np.sin(2 * np.pi * 0.06 * t + p1[0])
    target = (goal @ ARMS.T + pull / np.array(STIFFNESS)).tolist()
    dry = (DRY[0], HIDDEN_DRY if hidden == "joint_friction" else DRY[1])
    q, v, x0, u = goal[0].tolist(), [0.0, 0.0], list(target[0]), [0.0] * 4
    rows = []
    for now, aims in zip(t[:, 0].tolist(), target, strict=True):
        f = [STIFFNESS[i] * max(0.0, x0[i] - ARMS_LIST[i][0] * q[0] - ARMS_LIST[i][1] * q[1]) for i in range(4)]
        torque = [sum(ARMS_LIST[i][j] * f[i] for i in range(4)) for j in range(2)]
        rows.append((*q, *torque, *x0, *f))
        load = [sum(f), f[2] + f[3]]
        extra = [0.0, 0.0]
        if hidden == "gravity":
            extra[1] = 0.05 * math.sin(q[1] + 0.4)
        elif hidden == "unknown_hum":
            extra[0] = 0.02 * math.sin(2 * math.pi * 2.3 * now)
        for j in range(2):
            slide = dry[j] + LOADED[j] * load[j]
            spring = COVER * q[j] + DAMPING * v[j]
            free = torque[j] - spring - extra[j]
            if abs(v[j]) < STILL and abs(free) < PEAK * slide:
                rub, a, v[j] = free, 0.0, 0.0
            else:
                rub = slide * math.copysign(1.0, v[j] if abs(v[j]) >= STILL else free)
                a = (free - rub) / INERTIA[j]
            v[j] += DT * a
            q[j] += DT * v[j]
        for i in range(4):
            u[i] += DT * (SERVO * (aims[i] - x0[i]) - BRAKE * u[i] - f[i]) / MASS
            x0[i] += DT * u[i]
    kept = np.array(rows)[round(2 / DT) :: 4]
    angle, measured, position, force = np.split(kept, (2, 4, 8), axis=1)
    return {
        "time": t[round(2 / DT) :: 4, 0],
        "force": noisy(force, 0.02, rng),
        "position": quantised(position, 1e-6),
        "angle": quantised(angle, 2e-4),
        "measured": measured,
    }


def describe(hidden: str) -> Nominal:
    """Friction in the joints only, constant and by load; the constant part of joint 2 may be what is hidden."""
    joints = []
    for j, scale in enumerate((1.4, 0.7)):
        dry = {"static": 1.3 * scale * DRY[j], "coulomb": scale * DRY[j], "stribeck_velocity": 0.02, "viscous": 0.002}
        load = {"static": 1.2 * LOADED[j] / scale, "coulomb": LOADED[j] / scale, "stribeck_velocity": 0.02}
        joints.append({"friction": dry, "load_friction": load, "cover": {"stiffness": 0.03 * scale}})
    if hidden == "joint_friction":
        del joints[1]["friction"]
    tendons = [
        {"stiffness": stiffness, "moment_arms": list(arms)}
        for stiffness, arms in zip(STIFFNESS, ARMS_LIST, strict=True)
    ]
    return description("karnopp_finger", joints, tendons)
