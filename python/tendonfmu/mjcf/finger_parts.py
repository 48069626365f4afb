"""What a finger takes of a MuJoCo model: its tendons and what drives them, moment arms, links and their weight.

MuJoCo computes them at many angles. A pull shortens its tendon, so the moment arm is minus the change of the tendon's
length with the joint angle: r_ij(q) = −∂L_i/∂q_j.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, Tendon

SAMPLES = 256  # spread over all joint ranges
STEPS = 33  # along each joint's range, the others in the middle of theirs
NO_ARM = 1e-6  # m; shorter arms are none
NEGLIGIBLE = 0.01  # of the largest arm at the joint; a smaller constant is what the samples happen to average to
WORTH = 0.8  # the line must leave no more than this share of the deviation from a constant
WEIGHTLESS = 1e-9  # N·m
RIGID = 1e9  # N/m; as of a machine with one joint, whose drive counts as rigid

# --- moment arms ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MomentArm:
    """Moment arm of a tendon at a joint."""

    arm: float  # arm + slope·q_j (m; m/rad)
    slope: float
    low: float  # least and largest over all joint ranges (m)
    high: float
    varies: float  # largest deviation from the constant, as a share of the largest magnitude
    left: float  # the same with the slope


def sampled_angles(ranges: Numbers) -> Numbers:
    """Return angles that cover the ranges of all joints. ranges: [n, 2] (rad); returns [K, n] (rad)."""
    low, high = ranges[:, 0], ranges[:, 1]
    rows = [np.tile((low + high) / 2, (STEPS, 1)) for _ in ranges]
    for j, row in enumerate(rows):
        row[:, j] = np.linspace(low[j], high[j], STEPS)
    spread = qmc.Halton(len(ranges), scramble=False).random(SAMPLES)
    return np.concatenate([*rows, low + (high - low) * spread])


def moment_arms(
    model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon], angles: Numbers, tolerance: float
) -> list[list[MomentArm]]:
    """Read the moment arms of a model. angles: [K, n] (rad); returns [m][n]."""
    rows, columns = [tendon.index for tendon in tendons], [joint.velocity for joint in joints]
    arms = np.empty((len(angles), len(tendons), len(joints)))
    for k, placed in enumerate(angles):
        model.place(joints, placed)
        arms[k] = -model.tendon_jacobian()[np.ix_(rows, columns)]
    return [[_fitted(arms[:, i, j], angles[:, j], tolerance) for j in range(len(joints))] for i in range(len(tendons))]


def _fitted(values: Numbers, angle: Numbers, tolerance: float) -> MomentArm:
    """Describe an arm [K] over its own joint's angle [K]."""
    low, high = float(values.min()), float(values.max())
    largest = max(abs(low), abs(high))
    if largest < NO_ARM:
        return MomentArm(0.0, 0.0, low, high, 0.0, 0.0)
    mean = float(values.mean())
    varies = float(np.abs(values - mean).max()) / largest
    constant = MomentArm(_constant(mean, largest), 0.0, low, high, varies, varies)
    if varies <= tolerance:
        return constant
    slope, arm = np.polyfit(angle, values, 1)
    left = float(np.abs(values - arm - slope * angle).max()) / largest
    if left > WORTH * varies:
        return constant
    return MomentArm(_constant(float(arm), largest), _rounded(float(slope)), low, high, varies, left)


def _constant(arm: float, largest: float) -> float:
    return _rounded(arm) if abs(arm) > NEGLIGIBLE * largest else 0.0


def _rounded(value: float) -> float:
    """Return a length without the last digits, which are those of MuJoCo's rotations: 1e-12 m and less."""
    return round(value, 11)


# --- links ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LinkGeometry:
    """Where the joints are."""

    links: list[dict[str, Any]]  # rows of the description's `links` [n]
    tip: list[float]  # place of the fingertip in the frame of the last link [3] (m)
    axes: Numbers  # axes of the joints at angle 0 [n, 3], of length 1


def link_geometry(model: CompiledModel, joints: Sequence[Joint], tip: str) -> LinkGeometry:
    """Read the links' geometry with all joints at angle 0."""
    model.place(joints, np.zeros(len(joints)))
    body, place = model.point(tip)
    if joints[-1].body not in model.ancestors(body):
        raise InputError(f"{model.path}: {tip}: not beyond joint {joints[-1].name}; expected a point on the last link")
    turned, origin = model.base_frame(joints[0])
    axes, before = [], origin
    links = []
    for joint in joints:
        axis, anchor = (np.asarray(vector) for vector in model.axis_and_anchor(joint))
        axes.append(turned.T @ axis)
        links.append({"axis": _listed(axes[-1]), "offset": _listed(turned.T @ (anchor - before))})
        before = anchor
    return LinkGeometry(links, _listed(turned.T @ (place - before)), np.array(axes))


def _listed(vector: Numbers) -> list[float]:
    return [round(float(value), 12) + 0.0 for value in vector]


# --- their weight -----------------------------------------------------------------------------------------------------


def holding_torques(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Numbers:
    """Return the torques that hold the links' weight. angles: [K, n] (rad); returns [K, n] (N·m)."""
    rows = []
    for placed in angles:
        model.place(joints, placed)
        rows.append(model.holding_torque(joints))
    return np.array(rows)


def gravity_rows(angles: Numbers, torques: Numbers, axes: Numbers | None) -> tuple[list[dict[str, Any]], float]:
    """Fit rows `gravity` to torques."""
    # angles: [K, n] (rad); torques: [K, n] (N·m); axes: [n, 3]; returns largest torque that the rows miss (N·m)
    n = angles.shape[1]
    columns = []
    for last in range(n):
        weight = np.array([1.0 if axes is None else float(axes[k] @ axes[last]) for k in range(last + 1)])
        theta = angles[:, : last + 1] @ weight
        for shape in (np.sin(theta), np.cos(theta)):
            column = np.zeros_like(torques)
            column[:, : last + 1] = shape[:, None] * weight
            columns.append(column.ravel())
    matrix = np.array(columns).T
    numbers = np.linalg.lstsq(matrix, torques.ravel(), rcond=None)[0]
    missed = float(np.abs(torques.ravel() - matrix @ numbers).max())
    rows = []
    for j, pair in enumerate(numbers.reshape(n, 2)):
        felt = {
            name: round(float(x), 12) for name, x in zip(("sine", "cosine"), pair, strict=True) if abs(x) > WEIGHTLESS
        }
        if felt:
            rows.append({"effect": "gravity", "joint": j + 1, **felt})
    return rows, missed


# --- tendons ----------------------------------------------------------------------------------------------------------


def moved_velocities(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> NDArray[np.bool_]:
    """Return which velocities of the model each tendon moves. angles: [K, n] (rad); returns [tendons, velocities]."""
    largest = np.zeros((len(model.tendons), 0))
    for placed in angles[:: max(1, len(angles) // 32)]:
        model.place(joints, placed)
        size = np.abs(model.tendon_jacobian())
        largest = np.maximum(largest, size) if largest.size else size
    return np.array(largest >= NO_ARM, dtype=np.bool_)


def choose_tendons(
    model: CompiledModel, joints: Sequence[Joint], angles: Numbers, names: Sequence[str] | None
) -> list[Tendon]:
    """Return the tendons of a finger. angles: [K, n] (rad)."""
    velocities = [joint.velocity for joint in joints]
    moves = np.array(moved_velocities(model, joints, angles)[:, velocities].any(axis=1), ndmin=1)
    if names is None:
        chosen = [tendon for tendon in model.tendons if moves[tendon.index] and is_driven(model, tendon)]
        if chosen:
            return chosen
        others = ", ".join(tendon.name for tendon in model.tendons if moves[tendon.index]) or "none"
        none = f"no tendon with a drive moves the joints {', '.join(joint.name for joint in joints)}"
        raise InputError(f"{model.path}: {none}; expected --tendons with some of: {others}")
    chosen = [model.tendon_named(name) for name in names]
    for tendon in chosen:
        if list(names).count(tendon.name) > 1:
            raise InputError(f"{model.path}: tendon {tendon.name}: given twice; expected once")
        if not moves[tendon.index]:
            what = f"moves none of the joints {', '.join(joint.name for joint in joints)}"
            raise InputError(f"{model.path}: tendon {tendon.name}: {what}; expected one that does")
    return chosen


def motors_of(model: CompiledModel, tendon: Tendon) -> list[Joint]:
    """Return the slides with an actuator that pull a tendon."""
    model.place([], np.empty(0))
    row = np.abs(model.tendon_jacobian()[tendon.index])
    driven = {actuator.joint for actuator in model.actuators}
    return [
        joint
        for joint in model.joints
        if joint.kind == "slide" and joint.index in driven and row[joint.velocity] >= NO_ARM
    ]


def is_driven(model: CompiledModel, tendon: Tendon) -> bool:
    """Return whether an actuator acts on a tendon, or on a slide that pulls it."""
    return any(actuator.tendon == tendon.index for actuator in model.actuators) or bool(motors_of(model, tendon))


def stiffness_of(model: CompiledModel, tendon: Tendon, otherwise: float | None) -> tuple[float, str]:
    """Return the stiffness of a tendon between its drive and the finger."""
    # otherwise: (N/m); returns (N/m)
    actuators = [actuator for actuator in model.actuators if actuator.tendon == tendon.index]
    gains = [actuator.position_gain for actuator in actuators if actuator.position_gain]
    if gains:
        return sum(gains), f"{sum(gains):g} N/m, the gain of its position servo"
    if tendon.stiffness and not actuators:
        return tendon.stiffness, f"{tendon.stiffness:g} N/m, its own"
    if otherwise is not None:
        return otherwise, f"{otherwise:g} N/m, as given"
    return RIGID, f"not in the model, taken as rigid ({RIGID:g} N/m); --stiffness sets another"


def drives_of(model: CompiledModel, tendon: Tendon) -> Iterator[str]:
    """Yield what to record of each drive of a tendon."""
    for actuator in model.actuators:
        if actuator.tendon == tendon.index:
            yield f"tendon_force is {-actuator.gear:g} times the force of actuator {actuator.name}"
    for joint in motors_of(model, tendon):
        yield f"tendon_position is the motor's, joint {joint.name}"
