"""One valid row of each effect, and of each kind of place that it has, for a finger of two joints and three tendons."""

from __future__ import annotations

from typing import Any

ROWS: list[dict[str, Any]] = [
    {"effect": "cover_hardening", "joint": 2, "stiffness": 0.1},
    {"effect": "gravity", "joint": 2, "sine": 0.02, "cosine": -0.03},
    {"effect": "gravity", "joint": 1, "sine": 0.02},
    {"effect": "inertia", "joint": 1, "inertia": 1e-4},
    {"effect": "inertia_variation", "joint": 1, "sine": 2e-5, "cosine": -1e-4},
    {"effect": "joint_coupling", "joint": 1, "stiffness": 0.05},
    {"effect": "joint_coupling", "joint": 1, "stiffness": 0.05, "reaction": 0.3},
    {"effect": "preload_friction", "tendon": 1, "coulomb": 0.4},
    {"effect": "preload_friction", "joint": 2, "tendon": 2, "coulomb": 0.4},
    {"effect": "preload_friction", "joint": 1, "tendon": 2, "coulomb": 0.4, "beyond": 0.25},
    {"effect": "load_friction", "joint": 2, "tendon": 1, "coulomb": 2e-4},
    {"effect": "force_gain", "tendon": 2, "correction": 0.07},
    {"effect": "force_offset", "tendon": 1, "correction": -0.5},
    {"effect": "moment_arm", "joint": 1, "tendon": 3, "correction": 6e-4},
    {"effect": "moment_arm_variation", "joint": 2, "tendon": 2, "slope": -4e-4},
    {"effect": "pulley_eccentricity", "joint": 1, "tendon": 1, "sine": 5e-4, "cosine": 3e-4},
    {"effect": "pulley_eccentricity", "joint": 2, "tendon": 2, "sine": -3e-4, "cosine": 2e-4, "turns": 6.5},
    {"effect": "presliding", "joint": 1, "displacement": 0.02},
    {"effect": "presliding", "tendon": 2, "displacement": 2e-4},
    {"effect": "friction_drift", "amplitude": 0.3, "time_constant": 20.0},
    {"effect": "friction_drift", "joint": 1, "amplitude": -0.2, "time_constant": 5.0},
    {"effect": "friction_drift", "tendon": 2, "amplitude": 0.2, "time_constant": 5.0},
    {"effect": "tendon_nonlinearity", "tendon": 2, "hardening": 1e5},
    {"effect": "backlash", "joint": 2, "width": 0.02},
    {"effect": "backlash", "tendon": 1, "width": 2e-4},
    {"effect": "time_delay", "delay": 0.0013},
    {"effect": "stribeck", "joint": 1, "amplitude": -0.4, "stribeck_velocity": 0.3},
    {"effect": "stribeck", "tendon": 2, "amplitude": 0.4, "stribeck_velocity": 0.004},
    {"effect": "presliding", "displacement": 0.3},
    {"effect": "presliding", "level": 2, "displacement": 2e-4, "relaxation_time": 2.0},
    {"effect": "presliding", "joint": 1, "tendon": 2, "stiffness": 2e4},
    {"effect": "presliding", "stiffness": 2e4, "share": 2.0},
    {"effect": "cord_stretch", "stiffness": 5e4},
]


def name_of(row: dict[str, Any]) -> str:
    """Effect and place, for the name of a test."""
    return "-".join(str(row[key]) for key in ("effect", "joint", "tendon", "level") if key in row)
