"""Experiments that a diagnosis asks for, made on the matched rig: the same hand, another motion, pretension, load.

The known load stands in the recording as `external_torque`, as a reference sensor would have it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friction_physics import filtered_velocity, motion_of, read_finger
from matched_rig import Hand, Made, balanced_forces, coloured, columns_of, measure
from tendonfmu.diagnosis.experiments.discrimination import performed_of


def perform_experiment(hand: Hand, motion: Mapping[str, Any], seed: int) -> Made:
    """A recording of this hand that carries out a motion of `diagnose.result.Experiment` or `Invisible`."""
    finger = read_finger(hand.truth)
    _, plan = performed_of(hand.nominal, motion, hand.rate)
    encoders = plan.position
    angle = encoders
    for each in hand.hidden:
        if each.path is not None:
            angle = each.path(angle, each.magnitude)
    exact = np.gradient(angle, plan.time, axis=0)
    velocity = exact if hand.source == 3 else filtered_velocity(angle, 1.0 / hand.rate, finger.cutoff)
    moved = motion_of(plan.time, angle, velocity, finger.arms)
    for each in hand.hidden:
        if each.finger is not None:
            each.finger(finger, moved, each.magnitude)
    rng = np.random.default_rng([seed, 66])
    samples, step, noise = len(plan.time), 1.0 / hand.rate, hand.noise
    walk = noise.wander * np.sqrt(step) * np.cumsum(rng.standard_normal((samples, finger.joints)), axis=0)
    disturbance = coloured(rng, samples, finger.joints, step, noise)
    force = balanced_forces(finger, moved, plan.tension, disturbance + walk + plan.load)
    signals = {
        "time": plan.time,
        "tendon_force": force.copy(),
        "tendon_position": moved.angle @ finger.arms.T + force / finger.stiffness,
        "joint_position": encoders.copy(),
        "joint_velocity": exact,
    }
    for each in hand.hidden:
        if each.sensors is not None:
            each.sensors(signals, finger, each.magnitude)
    measure(rng, signals, noise)
    columns = columns_of(signals, hand.source)
    if plan.load.any():
        columns |= {f"external_torque[{j + 1}]": plan.load[:, j] for j in range(finger.joints)}
    return Made(hand, columns, moved, force, disturbance)
