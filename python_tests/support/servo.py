"""A servo that moves and rests: a mass with Coulomb, viscous and load friction under a position controller.

It shares no code with the product. While the mass sticks, the motor holds with any torque up to Coulomb friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

COULOMB, VISCOUS, INERTIA, LOAD_SHARE = 0.30, 0.25, 0.02, 0.1
GAINS = 60.0, 1.5, 40.0  # N·m/rad, N·m·s/rad, N·m/(rad·s)
FINE = 5e-4  # s, a step of the simulation
ENCODER = 2e-4  # rad
RELAXES = 0.3  # s, with which the controller lets go while the mass sticks


def servo_log(
    seed: int,
    *,
    share: float = 0.5,
    duration: float = 60.0,
    rate: float = 100.0,
    begins_at_rest: bool = True,
    noise: float = 0.01,
    angle_noise: float = 0.0,
    load: float = 0.0,
    offset: float = 0.0,
) -> dict[str, Any]:
    """Return t, torque, angle, velocity (exact), known load and the share of samples that stick.

    share: of the time at rest; noise: N·m; angle_noise: rad, 0: an encoder; load: N·m, amplitude of a known weight.
    """
    random = np.random.default_rng(seed)
    reference = _reference(random, share, duration, begins_at_rest)
    angle, velocity, integral, target = 0.0, 0.0, 0.0, 0.0
    rows = []
    every = round(1.0 / (rate * FINE))
    for k, (wanted, wanted_velocity, moves) in enumerate(reference):
        weight = load * np.sin(angle)
        coulomb = COULOMB + LOAD_SHARE * abs(weight)
        # at rest the integral goes to a level of its own: a motor's dead band, its current ripple, another task
        if moves:
            integral += GAINS[2] * (wanted - angle) * FINE
            target = random.uniform(-0.8, 0.8) * COULOMB
        elif velocity == 0.0:
            integral += (target - (GAINS[0] * (wanted - angle) + integral)) * FINE / RELAXES
        torque = GAINS[0] * (wanted - angle) + GAINS[1] * (wanted_velocity - velocity) + integral + weight
        free = torque - weight - VISCOUS * velocity
        slides = velocity != 0.0 or abs(free) > coulomb
        way = np.sign(velocity) if velocity else np.sign(free)
        after = velocity + (free - way * coulomb) / INERTIA * FINE if slides else 0.0
        acceleration = (after - velocity) / FINE
        if velocity * after < 0.0:  # it stops within the step
            after = 0.0
        velocity = after
        angle += velocity * FINE
        if k % every == 0:
            rows.append((k * FINE, torque, angle, velocity, weight + INERTIA * acceleration, velocity == 0.0))
    time, torque, position, speed, known, sticks = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    torque += offset + random.normal(0.0, noise, len(time))
    if angle_noise:
        position += random.normal(0.0, angle_noise, len(time))
    else:
        position = np.round(position / ENCODER) * ENCODER
    signals = {"t": time, "torque": torque, "angle": position, "velocity": speed, "known": known}
    return {**signals, "sticks": float(sticks.mean())}


def _reference(
    random: np.random.Generator, share: float, duration: float, begins_at_rest: bool
) -> list[tuple[float, float, bool]]:
    """Return the commanded angle (rad), velocity (rad/s), and whether it moves, at each step."""
    steps: list[tuple[float, float, bool]] = []
    place, rests = 0.0, begins_at_rest
    while len(steps) * FINE < duration:
        length = random.uniform(0.8, 1.6)
        if rests:
            steps += [(place, 0.0, False)] * int(length * share / max(1.0 - share, 1e-3) / FINE)
        else:
            way = random.uniform(0.3, 0.9) * (random.choice((-1.0, 1.0)) if abs(place) < 1.0 else -np.sign(place))
            at = np.arange(int(length / FINE)) * FINE / length
            angle = place + way * (10 * at**3 - 15 * at**4 + 6 * at**5)
            speed = way / length * 30 * at**2 * (1 - at) ** 2
            steps += [(float(a), float(v), True) for a, v in zip(angle, speed, strict=True)]
            place += way
        rests = not rests and share > 0.0
    return steps
