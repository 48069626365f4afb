"""Which tendons of a model a finger takes, and what drives and stretches them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, Tendon
from tendonfmu.mjcf.geometry import NO_ARM

RIGID = 1e9  # N/m; as of a machine with one joint, whose drive counts as rigid


def moved_velocities(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> NDArray[np.bool_]:
    """Return which velocities of the model each tendon moves."""
    # angles: [K, n] (rad); returns [tendons, velocities]
    largest = np.zeros((len(model.tendons), 0))
    for placed in angles[:: max(1, len(angles) // 32)]:
        model.place(joints, placed)
        size = np.abs(model.tendon_jacobian())
        largest = np.maximum(largest, size) if largest.size else size
    return np.array(largest >= NO_ARM, dtype=np.bool_)


def choose_tendons(
    model: CompiledModel, joints: Sequence[Joint], angles: Numbers, names: Sequence[str] | None
) -> list[Tendon]:
    """Return the tendons of a finger."""
    # angles: [K, n] (rad)
    velocities = [joint.velocity for joint in joints]
    moves = np.array(moved_velocities(model, joints, angles)[:, velocities].any(axis=1), ndmin=1)
    if names is None:
        chosen = [tendon for tendon in model.tendons if moves[tendon.index] and is_driven(model, tendon)]
        if chosen:
            return chosen
        others = ", ".join(tendon.name for tendon in model.tendons if moves[tendon.index]) or "none"
        raise InputError(
            f"{model.path}: no tendon with an actuator or a motor on a slide moves the joints "
            f"{', '.join(joint.name for joint in joints)}; expected --tendons with some of: {others}"
        )
    chosen = [model.tendon_named(name) for name in names]
    for tendon in chosen:
        if list(names).count(tendon.name) > 1:
            raise InputError(f"{model.path}: tendon {tendon.name}: given twice; expected once")
        if not moves[tendon.index]:
            raise InputError(
                f"{model.path}: tendon {tendon.name}: moves none of the joints "
                f"{', '.join(joint.name for joint in joints)}; expected one that does, or to leave it out"
            )
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
    own = [actuator for actuator in model.actuators if actuator.tendon == tendon.index]
    gains = [actuator.position_gain for actuator in own if actuator.position_gain]
    if gains:
        return sum(gains), f"{sum(gains):g} N/m, the gain of its position servo"
    if tendon.stiffness and not own:
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
