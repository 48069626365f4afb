"""How much of a hidden effect survives refitting the nominal model: by the rig's own equations and least squares.

Strength: variance of what survives over the variance of the noise, at the joint where it shows most. Surviving share:
its part of the effect's own variance. Both of the whole chain, sensors included: the quiet recording of the hand with
the effect, seen through the nominal model at its true numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from matched_physics import (
    Array,
    Finger,
    Motion,
    filtered_velocity,
    friction_torque,
    motion_of,
    read_finger,
    values_of,
)
from matched_rig import Hand, Made

BLOCK = 0.01  # s, over which series are averaged
KNOTS = 2.0  # s, of the slow bias, which looks like a slow effect
STEP = 1e-4  # relative, of the numeric derivative


@dataclass(frozen=True)
class Seen:
    """effect [N, n] N·m: residual of the nominal at its true numbers, quiet. nuisance [n·B, p]: orthonormal."""

    effect: Array
    nuisance: Array


def group(columns: dict[str, Array], name: str) -> Array:
    return np.column_stack([column for key, column in columns.items() if key.startswith(name + "[")])


def kinematics(hand: Hand, finger: Finger, columns: dict[str, Array]) -> tuple[Motion, Array]:
    """Joint angles and velocities by docs/reference/semantics/kinematics.md, and the measured forces [N, m]."""
    force, time = group(columns, "tendon_force"), columns["time"]
    if hand.source == 1:
        positions = group(columns, "tendon_position") - force / finger.stiffness
        angle = positions @ np.linalg.pinv(finger.arms).T
    else:
        angle = group(columns, "joint_position")
    if hand.source == 3:
        velocity = group(columns, "joint_velocity")
    else:
        velocity = filtered_velocity(angle, 1.0 / hand.rate, finger.cutoff)
    return motion_of(time, angle, velocity, finger.arms), force


def averaged(series: Array, size: int) -> Array:
    """[B, ...] block means, an incomplete last block left out."""
    blocks = len(series) // size
    return np.asarray(series[: blocks * size].reshape(blocks, size, *series.shape[1:]).mean(axis=1))


def derivatives(finger: Finger, motion: Motion, force: Array) -> Iterator[Array]:
    """[N, n] each: derivative of the torque by every number that the nominal has, relative to the number."""
    values = [values_of(effect, motion, finger) for effect in finger.effects]
    start = friction_torque(finger, motion, values, force)
    for place, effect in enumerate(finger.effects):

        def moved(place: int = place) -> Array:
            changed = list(values)
            changed[place] = values_of(finger.effects[place], motion, finger)
            return (friction_torque(finger, motion, changed, force) - start) / STEP

        alike = bool(np.array_equal(effect.sides[0], effect.sides[1]))
        for sides in [slice(0, 2)] if alike else [slice(0, 1), slice(1, 2)]:
            for number in range(4):
                kept = effect.sides.copy()
                if not kept[sides, number].any() or (number == 2 and not kept[sides, 1].any()):
                    continue
                effect.sides[sides, number] *= 1.0 + STEP
                yield moved()
                effect.sides[:] = kept
        if effect.memory is not None:
            kept_memory = effect.memory
            effect.memory = kept_memory * (1.0 + STEP)
            yield moved()
            effect.memory = kept_memory
    for j in np.flatnonzero(finger.cover):
        column = np.zeros_like(start)
        column[:, j] = finger.cover[j] * (motion.angle[:, j] - finger.rest[j])
        yield column


def splines(time: Array) -> Array:
    """[B, s] cubic B-splines with knots KNOTS apart: the slow bias of one joint."""
    inner = np.linspace(time[0], time[-1], max(2, int(np.ceil((time[-1] - time[0]) / KNOTS)) + 1))
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    return np.asarray(BSpline.design_matrix(time, knots, 3).toarray())


def look(hand: Hand, made: Made) -> Seen:
    """What the nominal model at its true numbers leaves of a quiet recording, and all that refitting can bend."""
    columns = np.hstack([number_columns(hand, made), bias_columns(hand, made)])
    return Seen(residual(hand, made), orthonormal(columns))


def number_columns(hand: Hand, made: Made) -> Array:
    """[n·B, p] block means of the torque's derivatives by the nominal's numbers, one joint after the other."""
    finger = read_finger(hand.truth)
    motion, force = kinematics(hand, finger, made.columns)
    size = max(1, round(BLOCK * hand.rate))
    columns = [averaged(column, size).T.ravel() for column in derivatives(finger, motion, force)]
    blocks = len(made.columns["time"]) // size
    return np.column_stack(columns) if columns else np.zeros((finger.joints * blocks, 0))


def bias_columns(hand: Hand, made: Made) -> Array:
    """[n·B, n·s] the slow bias of every joint."""
    slow = splines(averaged(made.columns["time"], max(1, round(BLOCK * hand.rate))))
    return np.kron(np.eye(len(hand.truth["joints"])), slow)


def orthonormal(columns: Array) -> Array:
    """[N, r] a basis of what the columns can do."""
    columns = columns[:, np.linalg.norm(columns, axis=0) > 0.0]
    left, size, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * size[0]])


def residual(hand: Hand, made: Made) -> Array:
    """[N, n] N·m: measured torque minus that of the nominal at its true numbers, by what was measured."""
    finger = read_finger(hand.truth)
    motion, force = kinematics(hand, finger, made.columns)
    values = [values_of(effect, motion, finger) for effect in finger.effects]
    return force @ finger.arms - friction_torque(finger, motion, values, force)


def surviving(seen: Seen, effect: Array, hand: Hand) -> tuple[float, float]:
    """(strength, share that survives) of an effect [N, n]."""
    joints = effect.shape[1]
    flat = averaged(effect, max(1, round(BLOCK * hand.rate))).T.ravel()
    flat = (flat.reshape(joints, -1) - flat.reshape(joints, -1).mean(axis=1, keepdims=True)).ravel()
    left = flat - seen.nuisance @ (seen.nuisance.T @ flat)
    by_joint = np.mean(left.reshape(joints, -1) ** 2, axis=1)
    whole = float(flat @ flat)
    return float(by_joint.max() / hand.noise.std**2), float(left @ left) / whole if whole > 0.0 else 0.0
