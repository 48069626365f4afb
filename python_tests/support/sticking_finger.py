"""One joint between two tendons that sticks and slips: a naive simulation of its own, and its description.

A Karnopp model in steps of 0.5 ms: below a creeping speed the joint stands still as long as the load is smaller than
the friction, which then is whatever balances the load.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from evidence.fingers.foreign import frame, level_law

ARMS, STIFFNESS = (0.008, -0.0085), (4000.0, 3600.0)  # m, N/m
EDGES, DRY = (0.03, 0.022), 0.005  # of the tendon force; N·m
COVER, INERTIA, DAMPING = 0.02, 4e-5, 0.002  # N·m/rad, kg·m², N·m·s/rad
STEP, EVERY = 5e-4, 4  # s; samples at 500 Hz
CREEP = 1e-3  # rad/s


def friction_at(force: float) -> float:
    """True friction torque of the joint with both tendons at the same force, N·m."""
    return DRY + sum(share * abs(arm) * force for share, arm in zip(EDGES, ARMS, strict=True))


def described_friction_at(data: Any, force: float) -> float:
    """The same of a description."""
    edges = sum(
        tendon["edge_friction"][0]["coulomb"] * abs(arm) * force
        for tendon, arm in zip(data["tendons"], ARMS, strict=True)
    )
    return float(data["joints"][0]["friction"]["coulomb"] + edges)


def description() -> dict[str, Any]:
    """The right structure, with numbers that are off by 30 %."""
    return {
        "format": "tendonfmu-finger-1",
        "name": "sticking_finger",
        "joints": [
            {"name": "joint", "friction": level_law(1.3 * DRY, 0.01, 0.001), "cover": {"stiffness": 0.7 * COVER}}
        ],
        "tendons": [
            {
                "name": f"tendon_{k + 1}",
                "stiffness": STIFFNESS[k],
                "moment_arms": [ARMS[k]],
                "edge_friction": [level_law(0.7 * EDGES[k], 0.01)],
            }
            for k in range(2)
        ],
        "contact": {"threshold": [0.02]},
    }


def simulate(seconds: float, seed: int, weight: float = 0.0) -> pd.DataFrame:
    """A recording as `tendonfmu` reads it, of slow motion; 20 mN, 1 µm and 0.1 mrad of noise.

    weight: N·m at most, of a link that is upright at −1.2 rad; the description lacks it.
    """
    rng = np.random.default_rng(seed)
    phases, share = rng.uniform(0, 2 * math.pi, 3), rng.uniform(0.9, 1.1, 3)
    time = np.arange(-2.0, seconds, STEP)
    waves = ((0.45, 0.13), (0.2, 0.31), (0.08, 0.57))  # rad, Hz
    goal = sum(a * np.sin(2 * np.pi * f * s * time + p) for (a, f), s, p in zip(waves, share, phases, strict=True))
    pull = 20.0 + 6.0 * np.sin(2 * np.pi * 0.07 * time)
    motors = [(goal * arm + pull / k).tolist() for arm, k in zip(ARMS, STIFFNESS, strict=True)]
    q, v, rows = float(goal[0]), 0.0, []
    for k in range(len(time)):
        force = [STIFFNESS[i] * max(0.0, motors[i][k] - ARMS[i] * q) for i in range(2)]
        size = DRY + sum(EDGES[i] * abs(ARMS[i]) * force[i] for i in range(2))
        load = sum(ARMS[i] * force[i] for i in range(2)) - COVER * q - DAMPING * v - weight * math.sin(q + 1.2)
        if abs(v) < CREEP and abs(load) < size:
            v = 0.0
        else:
            faster = v + STEP * (load - math.copysign(size, v if abs(v) >= CREEP else load)) / INERTIA
            v = 0.0 if v * faster < 0.0 else faster
        q += STEP * v
        if k % EVERY == 0:
            rows.append((time[k], *force, motors[0][k], motors[1][k], q))
    table = np.array(rows)[np.array(rows)[:, 0] >= 0.0]
    noise = rng.normal(size=table.shape) * (0.0, 0.02, 0.02, 1e-6, 1e-6, 1e-4)
    table += noise
    return frame(table[:, 0], table[:, 1:3], table[:, 3:5], table[:, 5:])


def write(folder: Path, seconds: float, seed: int, weight: float = 0.0) -> tuple[Path, Path]:
    """Write description and recording; return their paths."""
    finger, recording = folder / "finger.json", folder / f"recording_{seed}.parquet"
    finger.write_text(json.dumps(description()), encoding="utf-8")
    simulate(seconds, seed, weight).to_parquet(recording, index=False)
    return finger, recording
