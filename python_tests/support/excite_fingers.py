"""The fingers that the tests of training motions use."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from repository_paths import ROOT

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
INDEX_DATA: dict[str, Any] = json.loads(INDEX.read_text(encoding="utf-8"))
INDEX_RANGES = np.array([[-0.35, 0.35], [-0.3, 1.4], [0.0, 1.6], [-0.15, 0.85]])


def law(static: float, coulomb: float, stribeck: float, viscous: float = 0.0) -> dict[str, float]:
    return {"static": static, "coulomb": coulomb, "stribeck_velocity": stribeck, "viscous": viscous}


SMALL: dict[str, Any] = {
    "format": "tendonfmu-finger-1",
    "name": "two_joints",
    "joints": [
        {"name": "base", "cover": {"stiffness": 0.02, "rest_angle": 0.1}, "friction": law(0.02, 0.015, 0.1, 0.01)},
        {"name": "tip", "load_friction": law(1e-3, 8e-4, 0.1)},
    ],
    "tendons": [
        {
            "name": "flexor",
            "stiffness": 6000.0,
            "moment_arms": [0.009, 0.006],
            "pulley_friction": [law(0.03, 0.03, 0.006)],
            "edge_friction": [
                {"positive": law(0.06, 0.05, 0.004), "negative": law(0.05, 0.04, 0.004, 1.0)},
                {
                    "angles": [-0.5, 0.0, 0.6],
                    "laws": [law(0.2, 0.15, 0.004), law(0.1, 0.06, 0.004), law(0.2, 0.2, 0.004)],
                },
            ],
        },
        {"name": "extensor", "stiffness": 6000.0, "moment_arms": [-0.006, -0.006]},
        {"name": "base_extensor", "stiffness": 5000.0, "moment_arms": [-0.006, 0.0]},
    ],
    "contact": {"threshold": [0.03, 0.02]},
}
SMALL_RANGES = np.array([[-0.5, 0.6], [-0.4, 0.4]])
