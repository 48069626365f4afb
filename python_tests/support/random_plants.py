"""Seeded random expanded rigs and states for checks of the simulated finger's right-hand side.

They are made to exercise every term and switch of the equations, not to be simulated for long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import random_fingers

Array = NDArray[Any]
Table = dict[str, Any]
TENDON_SPEED = 0.005  # m/s: Stribeck velocities are drawn around this


def random_arms(rng: np.random.Generator, m: int, n: int) -> Array:
    """[m, n] m, of full rank, whose null vector nearest to ones is positive; tendons may end before the last joint."""
    while True:
        nu = rng.uniform(0.6, 1.4, m)
        R = rng.uniform(-0.01, 0.01, (m, n))
        last = rng.integers(0, n, m) if rng.random() < 0.5 else np.full(m, n - 1)
        R[np.arange(n)[None, :] > last[:, None]] = 0.0
        for j in range(n):
            on = R[:, j] != 0.0
            if on.any():
                R[on, j] -= nu[on] * (nu[on] @ R[on, j]) / (nu[on] @ nu[on])
        singular = np.linalg.svd(R, compute_uv=False)
        if singular[-1] < 0.05 * singular[0]:
            continue
        nearest = np.ones(m) - R @ np.linalg.pinv(R) @ np.ones(m)
        if nearest.min() > 0.1 * nearest.mean():
            return R


def random_finger(rng: np.random.Generator, n: int, m: int) -> Table:
    """Joints and tendons of random_fingers.py with other arms."""
    tendons = [random_fingers.random_tendon(rng, i + 1, row, False) for i, row in enumerate(random_arms(rng, m, n))]
    for tendon in tendons:
        tendon.pop("bidirectional", None)  # the plant's tendons pull
        tendon["stiffness"] = rng.uniform(3000.0, 20000.0)
    return {
        "format": "tendonfmu-finger-1",
        "name": "random_plant",
        "joints": [random_fingers.random_joint(rng, j + 1) for j in range(n)],
        "tendons": tendons,
        "contact": {"threshold": [0.05] * n},
    }


def random_links(rng: np.random.Generator, n: int) -> list[Table]:
    links = []
    for j in range(n):
        size = rng.uniform(2e-6, 2e-5)
        link: Table = {
            "axis": (rng.normal(size=3) * rng.uniform(0.3, 3.0)).tolist(),
            "mass": rng.uniform(0.01, 0.06),
            "inertia": (size * rng.uniform(0.7, 1.0, 3)).tolist(),
        }
        if j or rng.random() < 0.5:
            link["offset"] = rng.uniform(-0.05, 0.05, 3).tolist()
        if rng.random() < 0.8:
            link["centre_of_mass"] = rng.uniform(-0.03, 0.03, 3).tolist()
        if rng.random() < 0.7:
            link["limits"] = {"lower": -rng.uniform(0.4, 0.9), "upper": rng.uniform(0.4, 0.9)}
            if rng.random() < 0.7:
                link["limits"] |= {"stiffness": rng.uniform(1.0, 20.0), "damping": rng.uniform(0.0, 0.05)}
        if rng.random() < 0.5:
            link["cover_hardening"] = rng.uniform(0.0, 0.1)
        if rng.random() < 0.7:
            link["damping"] = rng.uniform(0.0, 0.005)
        links.append(link)
    return links


def random_tendon_physics(rng: np.random.Generator, n: int) -> Table:
    options = {
        "hardening": rng.uniform(0.0, 2e6),
        "damping": rng.uniform(0.0, 5.0),
        "moment_arm_scale": rng.uniform(0.8, 1.2),
        "moment_arm_slope": rng.uniform(-0.002, 0.002, n).tolist(),
        "eccentricity": rng.uniform(0.0, 0.001, n).tolist(),
        "phase": rng.uniform(-3.0, 3.0, n).tolist(),
    }
    return {key: value for key, value in options.items() if rng.random() < 0.6}


def random_friction(rng: np.random.Generator, finger: Table) -> Table:
    """Every switch on in about half of the rigs."""
    options: Table = {
        "presliding": {
            "pulley": rng.uniform(1e-5, 6e-5),
            "edge": rng.uniform(1e-5, 6e-5),
            "joint": rng.uniform(1e-3, 8e-3),
        },
        "bristle_damping": rng.uniform(0.0, 0.01),
        "stribeck_exponent": int(rng.integers(1, 3)),
        "tension_loss": str(rng.choice(["linear", "capstan"])),
        "pulley_torque": str(rng.choice(["beyond_joint", "at_joint"])),
        "joint_load": str(rng.choice(["all", "passing"])),
        "preload": rng.uniform(0.2, 5.0),
        "asymmetry": rng.uniform(-0.3, 0.3),
        "edges": random_diversions(rng, finger),
        "drift": {"amplitude": rng.uniform(-0.3, 0.5), "time_constant": rng.uniform(1.0, 400.0)},
        "heat": {"coefficient": rng.uniform(-0.01, 0.02), "time_constant": rng.uniform(5.0, 200.0)},
    }
    return {key: value for key, value in options.items() if rng.random() < 0.6}


def random_diversions(rng: np.random.Generator, finger: Table) -> list[Table]:
    found: list[Table] = []
    for i, tendon in enumerate(finger["tendons"]):
        for j, law in enumerate(tendon.get("edge_friction", [])):
            if j == 0 or law is None or rng.random() < 0.6:
                continue
            entry: Table = {
                "tendon": i + 1,
                "joint": j + 1,
                "shape": str(rng.choice(["sine", "capstan"])),
                "rest": rng.uniform(-0.5, 0.5),
                "slope": rng.uniform(-1.5, 1.5),
                "centre": rng.uniform(-0.3, 0.3),
                "coefficient": rng.uniform(0.01, 0.1),
            }
            if rng.random() < 0.5:
                entry["negative_coefficient"] = rng.uniform(0.01, 0.1)
            found.append({k: v for k, v in entry.items() if k not in ("slope", "centre") or rng.random() < 0.7})
    return found


def random_motion(rng: np.random.Generator, n: int) -> Table:
    joints = []
    for _ in range(n):
        knots = int(rng.integers(1, 6))
        time = np.cumsum(rng.uniform(0.1, 1.5, knots)) - 0.1
        joints.append(
            {
                "time": time.tolist(),
                "position": rng.uniform(-0.4, 0.4, knots).tolist(),
                "velocity": rng.uniform(-1.0, 1.0, knots).tolist(),
                "acceleration": rng.uniform(-2.0, 2.0, knots).tolist(),
            }
        )
    knots = int(rng.integers(1, 4))
    time = np.cumsum(rng.uniform(0.2, 2.0, knots)) - 0.2
    return {"joints": joints, "pretension": {"time": time.tolist(), "value": rng.uniform(1.0, 20.0, knots).tolist()}}


def random_pushes(rng: np.random.Generator, n: int) -> list[Table]:
    pushes = []
    for _ in range(int(rng.integers(0, 4))):
        push: Table = {
            "start": rng.uniform(0.0, 3.0),
            "rise": rng.uniform(0.1, 1.0),
            "hold": rng.uniform(0.0, 1.0),
            "fall": rng.uniform(0.1, 1.0),
            "force": rng.uniform(0.5, 5.0),
            "direction": rng.normal(size=3).tolist(),
        }
        if rng.random() < 0.6:
            push["frame"] = str(rng.choice(["base", "link"]))
        if rng.random() < 0.6:
            push |= {"link": int(rng.integers(1, n + 1)), "point": rng.uniform(-0.03, 0.03, 3).tolist()}
        pushes.append(push)
    return pushes


def random_plant(seed: int) -> Table:
    """An expanded rig."""
    rng = np.random.default_rng([seed, 31])
    n = int(rng.integers(1, 5))
    m = int(rng.integers(n + 1, 9))
    finger = random_finger(rng, n, m)
    physics: Table = {"links": random_links(rng, n)}
    if rng.random() < 0.6:
        physics["gravity"] = rng.uniform(-10.0, 10.0, 3).tolist()
    if rng.random() < 0.7:
        physics["tip"] = rng.uniform(-0.03, 0.03, 3).tolist()
    if n > 1 and rng.random() < 0.5:
        physics["joint_coupling"] = rng.uniform(0.0, 0.1, n - 1).tolist()
    if rng.random() < 0.7:
        count = m if rng.random() < 0.7 else int(rng.integers(0, m))
        physics["tendons"] = [random_tendon_physics(rng, n) for _ in range(count)]
    if rng.random() < 0.5:
        physics["servo"] = {"frequency": rng.uniform(5.0, 40.0), "damping_ratio": rng.uniform(0.5, 1.5)}
    physics["friction"] = random_friction(rng, finger)
    if rng.random() < 0.4:
        physics["wrist"] = {
            "amplitude": rng.uniform(0.05, 0.5),
            "period": rng.uniform(2.0, 30.0),
            "arms": rng.uniform(-0.01, 0.01, m).tolist(),
            "friction": random_fingers.random_side(rng, 0.03, TENDON_SPEED),
        }
        if rng.random() < 0.5:
            physics["wrist"]["presliding"] = rng.uniform(1e-5, 6e-5)
    if rng.random() < 0.5:
        physics["obstacle"] = {"centre": [0.0, 0.0, 0.0], "radius": 1.0, "stiffness": rng.uniform(100.0, 3000.0)}
        place_obstacle(rng, physics, n)
    return {
        "format": "tendonfmu-rig-1",
        "name": f"random_plant_{seed}",
        "version": 1,
        "finger": finger,
        "physics": physics,
        "motion": random_motion(rng, n),
        "pushes": random_pushes(rng, n),
        "recording": {"duration": 5.0},
    }


def place_obstacle(rng: np.random.Generator, physics: Table, n: int) -> None:
    """A sphere that about half of the random postures touch."""
    obstacle = physics["obstacle"]
    obstacle["centre"] = rng.uniform(-0.1, 0.1, 3).tolist()
    obstacle["radius"] = rng.uniform(0.03, 0.12)
    if rng.random() < 0.6:
        obstacle["damping"] = rng.uniform(0.0, 5.0)
    if rng.random() < 0.6:
        obstacle["link"] = int(rng.integers(1, n + 1))
        obstacle["point"] = rng.uniform(-0.03, 0.03, 3).tolist()


def random_state(rng: np.random.Generator, twin: Any) -> Array:
    """A state within reach and somewhat beyond: some tendons slack, joints at rest or beyond their stops."""
    q = rng.uniform(-0.8, 0.8, twin.n)
    v = rng.uniform(-1.0, 1.0, twin.n) * 10.0 ** rng.uniform(-3.0, 0.3, twin.n)
    path = np.array([each.path(q) for each in twin.tendons])
    stretch = np.array([each.elongation(rng.uniform(0.5, 40.0)) for each in twin.tendons])
    slack = rng.random(twin.m) < 0.15
    x = path + np.where(slack, -0.001 * rng.random(twin.m), stretch)
    arms = np.array([each.arms(q) for each in twin.tendons])
    x_rate = arms @ v + rng.normal(0.0, 0.003, twin.m)
    bristles = rng.uniform(-1.1, 1.1, len(twin.places))
    return np.concatenate([q, v, x, x_rate, bristles, [rng.uniform(0.0, 5.0)], rng.normal(size=4)])
