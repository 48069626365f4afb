# Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit.
"""Defaults and ranges of the numbers of a finger description, and expected sizes of those of its extensions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class EffectNumber:
    """A number of an extension, in SI units."""

    least: float  # its range
    most: float
    missing: float | None  # its value where it is left out; None if it is required
    scale: float  # its expected magnitude


# Default by path: SI units.
DEFAULTS: Mapping[str, float] = {
    "joints.cover.rest_angle": 0.0,
    "velocity_threshold.tendon": 0.0005,
    "velocity_threshold.joint": 0.01,
    "velocity_filter_cutoff": 20.0,
    "position_filter.jerk_density": 1.0,
    "bias.drift_variance": 1e-06,
    "bias.noise_std": 0.01,
    "bias.noise_std_per_force": 0.0,
    "bias.forget_rate": 5.0,
    "contact.threshold_per_force": 0.0,
    "velocity_threshold.hysteresis": 0.0,
    "contact.innovation.threshold_per_force": 0.0,
    "contact.friction_bound.stuck_share": 0.0,
    "contact.friction_bound.stuck_time": 0.0,
    "contact.friction_bound.jump_share": 0.0,
    "contact.friction_bound.jump_time": 0.06,
    "contact.uncertainty": 0.0,
    "contact.uncertainty_level": 3.0,
    "contact.deviation": 0.0,
    "contact.deviation_per_force": 0.0,
    "contact.release_ratio": 1.0,
    "contact.hold_time": 0.0,
    "contact.drift.quick_time": 0.3,
    "contact.drift.slow_time": 10.0,
    "contact.drift.threshold_per_force": 0.0,
    "contact.rest.settle_time": 0.3,
    "contact.rest.averaging_time": 0.03,
    "contact.rest.threshold_per_force": 0.0,
    "contact.rest.creep": 0.0,
    "contact.rest.fall_share": 0.05,
    "sensor_fault.hold_time": 0.05,
    "sensor_fault.force_resolution": 0.01,
    "sensor_fault.position_resolution": 2e-06,
    "sensor_fault.jump_margin": 1.0,
    "sensor_fault.recovery_time": 0.5,
    "links.offset": 0.0,
}

# Least and largest value by path: SI units.
RANGES: Mapping[str, tuple[float, float]] = {
    "joints.cover.stiffness": (0.0, 1000000000.0),
    "joints.cover.rest_angle": (-1000000.0, 1000000.0),
    "tendons.stiffness": (0.0, 1000000000000.0),
    "tendons.moment_arms": (-1000.0, 1000.0),
    "tendons.edge_friction.angles": (-1000000.0, 1000000.0),
    "velocity_threshold.tendon": (0.0, 1000000000.0),
    "velocity_threshold.joint": (0.0, 1000000000.0),
    "velocity_filter_cutoff": (0.0, 1000000000.0),
    "position_filter.noise": (1e-06, 1000.0),
    "position_filter.jerk_density": (0.0, 1000000000.0),
    "bias.drift_variance": (0.0, 1000000000.0),
    "bias.noise_std": (0.0, 1000000000.0),
    "bias.noise_std_per_force": (0.0, 1000000000.0),
    "bias.initial_variance": (0.0, 1000000000.0),
    "bias.forget_rate": (0.0, 1000000000.0),
    "bias.initial_torque": (-1000000000.0, 1000000000.0),
    "bias.noise_time": (0.0, 1000000000.0),
    "bias.start_share": (0.0, 1.0),
    "contact.threshold": (0.0, 1000000000.0),
    "contact.threshold_per_force": (0.0, 1000000000.0),
    "velocity_threshold.hysteresis": (0.0, 1.0),
    "contact.innovation.time": (0.0, 1000000000.0),
    "contact.innovation.threshold": (0.0, 1000000000.0),
    "contact.innovation.threshold_per_force": (0.0, 1000000000.0),
    "contact.innovation.evidence_time": (0.0, 1000000000.0),
    "contact.friction_bound.stuck_share": (0.0, 10.0),
    "contact.friction_bound.stuck_time": (0.0, 1000000000.0),
    "contact.friction_bound.jump_share": (0.0, 10.0),
    "contact.friction_bound.jump_time": (0.0, 1000000000.0),
    "contact.uncertainty": (-1000000000.0, 1000000000.0),
    "contact.uncertainty_level": (0.0, 100.0),
    "contact.deviation": (0.0, 1000000000.0),
    "contact.deviation_per_force": (0.0, 1000000000.0),
    "contact.release_ratio": (0.0, 1.0),
    "contact.hold_time": (0.0, 1000000000.0),
    "contact.release_time": (0.0, 1000000000.0),
    "contact.drift.quick_time": (0.0, 1000000000.0),
    "contact.drift.slow_time": (0.0, 1000000000.0),
    "contact.drift.threshold": (0.0, 1000000000.0),
    "contact.drift.threshold_per_force": (0.0, 1000000000.0),
    "contact.rest.travel": (0.0, 1000000000.0),
    "contact.rest.settle_time": (0.0, 1000000000.0),
    "contact.rest.averaging_time": (0.0, 1000000000.0),
    "contact.rest.threshold": (0.0, 1000000000.0),
    "contact.rest.threshold_per_force": (0.0, 1000000000.0),
    "contact.rest.creep": (0.0, 1000000000.0),
    "contact.rest.fall_share": (0.0, 1.0),
    "contact.rest.innovation.time": (0.0, 1000000000.0),
    "contact.rest.innovation.threshold": (0.0, 1000000000.0),
    "sensor_fault.hold_time": (0.0, 1000000000.0),
    "sensor_fault.force_resolution": (0.0, 1000000000.0),
    "sensor_fault.position_resolution": (0.0, 1000000000.0),
    "sensor_fault.jump_margin": (0.0, 1000000000.0),
    "sensor_fault.recovery_time": (0.0, 1000000000.0),
    "links.axis": (-1000000.0, 1000000.0),
    "links.offset": (-10.0, 10.0),
    "tip": (-10.0, 10.0),
}

# Largest number of each in one description.
LIMITS: Mapping[str, int] = {
    "joints": 16,
    "tendons": 64,
    "points": 256,
    "directions": 4,
    "extensions": 1024,
}

# By effect, in the order of the FMU's parameters.
EFFECT_NUMBERS: Mapping[str, Mapping[str, EffectNumber]] = {
    "cover_hardening": {
        "stiffness": EffectNumber(-1000000000.0, 1000000000.0, None, 0.05),
    },
    "gravity": {
        "sine": EffectNumber(-1000000000.0, 1000000000.0, 0.0, 0.005),
        "cosine": EffectNumber(-1000000000.0, 1000000000.0, 0.0, 0.005),
    },
    "inertia": {
        "inertia": EffectNumber(-1000000000.0, 1000000000.0, None, 1e-05),
    },
    "joint_coupling": {
        "stiffness": EffectNumber(-1000000000.0, 1000000000.0, None, 0.02),
        "reaction": EffectNumber(-10.0, 10.0, 1.0, 1.0),
    },
    "preload_friction": {
        "coulomb": EffectNumber(-1000000000.0, 1000000000.0, None, 0.2),
        "beyond": EffectNumber(-10.0, 10.0, 1.0, 1.0),
    },
    "load_friction": {
        "coulomb": EffectNumber(-1000000000.0, 1000000000.0, None, 0.0001),
    },
    "force_gain": {
        "correction": EffectNumber(-1.0, 1000000000.0, None, 0.05),
    },
    "force_offset": {
        "correction": EffectNumber(-1000000000.0, 1000000000.0, None, 0.5),
    },
    "moment_arm": {
        "correction": EffectNumber(-1000000000.0, 1000000000.0, None, 0.0005),
    },
    "moment_arm_variation": {
        "slope": EffectNumber(-1000000000.0, 1000000000.0, None, 0.0005),
    },
    "pulley_eccentricity": {
        "sine": EffectNumber(-1000000000.0, 1000000000.0, 0.0, 0.0005),
        "cosine": EffectNumber(-1000000000.0, 1000000000.0, 0.0, 0.0005),
        "turns": EffectNumber(0.0, 1000.0, 1.0, 1.0),
    },
    "presliding": {
        "displacement": EffectNumber(0.0, 1000000000.0, None, 0.0001),
    },
    "friction_drift": {
        "amplitude": EffectNumber(-0.9, 1000000000.0, None, 0.3),
        "time_constant": EffectNumber(0.0, 1000000000.0, None, 100.0),
    },
    "tendon_nonlinearity": {
        "hardening": EffectNumber(0.0, 1000000000000.0, None, 100000.0),
    },
    "backlash": {
        "width": EffectNumber(0.0, 1000000000.0, None, 0.0001),
    },
    "time_delay": {
        "delay": EffectNumber(-0.05, 0.05, None, 0.002),
    },
    "stribeck": {
        "amplitude": EffectNumber(-0.99, 1000000000.0, None, 0.3),
        "stribeck_velocity": EffectNumber(0.0, 1000000000.0, None, 0.01),
    },
}
