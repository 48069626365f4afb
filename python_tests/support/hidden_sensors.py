"""Hidden effects in the sensors, the arms and the tendons: what is measured differs from what acts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from matched_physics import Array, Finger, Motion
from matched_rig import Hand, Hidden

Random = np.random.Generator
CROSSING = 0.03  # s in which the drive crosses the play at a reversal


def wrong_force(name: str, size: float, measured: Callable[[Array, float], Array]) -> Callable[..., Any]:
    def build(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
        i = int(rng.integers(len(hand.truth["tendons"])))
        sign = 1.0 if rng.random() < 0.5 else -1.0

        def change(signals: dict[str, Array], finger: Finger, magnitude: float) -> None:
            signals["tendon_force"][:, i] = measured(signals["tendon_force"][:, i], sign * magnitude)

        return hand, Hidden(name, tendon=i + 1, magnitude=size, sensors=change)

    return build


def wrong_arm(name: str, size: float, arm: Callable[[Array, Array], Array], path: Callable[..., Array]) -> Any:
    """An arm that differs by magnitude·arm(q), and the tendon that it winds up: magnitude·path(q), its integral."""

    def build(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
        i, j = int(rng.integers(len(hand.truth["tendons"]))), int(rng.integers(len(hand.truth["joints"])))
        draw = rng.uniform(-1.0, 1.0, 2)

        def turn(finger: Finger, motion: Motion, magnitude: float) -> None:
            def torque(motion: Motion, force: Array) -> Array:
                lost = np.zeros_like(motion.angle)
                lost[:, j] = -magnitude * arm(motion.angle[:, j], draw) * force[:, i]
                return lost

            finger.extras.append(torque)

        def wind(signals: dict[str, Array], finger: Finger, magnitude: float) -> None:
            angle = signals["joint_position"][:, j]
            signals["tendon_position"][:, i] += magnitude * path(angle, draw)

        return hand, Hidden(name, joint=j + 1, tendon=i + 1, magnitude=size, finger=turn, sensors=wind)

    return build


def sign_of(draw: Array) -> float:
    return 1.0 if draw[0] > 0.0 else -1.0


def late(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """The forces come later than the positions, or earlier."""
    sign = 1.0 if rng.random() < 0.5 else -1.0

    def change(signals: dict[str, Array], finger: Finger, magnitude: float) -> None:
        time, force = signals["time"], signals["tendon_force"]
        for i in range(force.shape[1]):
            force[:, i] = np.interp(time - sign * magnitude, time, force[:, i].copy())

    return hand, Hidden("time_delay", magnitude=0.01, note="late" if sign > 0 else "early", sensors=change)


def progressive(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """A tendon whose spring hardens: |f| = k e + hardening e² of its stretch e. Seen through the tendon positions."""
    i = int(rng.integers(len(hand.truth["tendons"])))

    def change(signals: dict[str, Array], finger: Finger, magnitude: float) -> None:
        force, k = signals["tendon_force"][:, i], finger.stiffness[i]
        stretch = (np.sqrt(k**2 + 4.0 * magnitude * np.abs(force)) - k) / (2.0 * magnitude)
        signals["tendon_position"][:, i] += np.sign(force) * stretch - force / k

    usual = 0.3 * hand.truth["tendons"][i]["stiffness"] ** 2 / hand.level
    return hand, Hidden("tendon_nonlinearity", tendon=i + 1, magnitude=usual, sensors=change)


def before_play(passed: Array, time: Array, width: float) -> Array:
    """A position whose play is `passed`: on the side to which it moves, crossing the gap where it turns round."""
    step = np.concatenate([[0.0], np.diff(passed)])
    noise = 1e-9 * np.ptp(passed)
    sign = np.sign(step) * (np.abs(step) > noise)
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(step)), 0))
    side = np.where(sign[last] == 0.0, 1.0, sign[last])
    count = max(1, round(CROSSING / (time[1] - time[0])))
    smooth = np.convolve(
        np.pad(side, (count // 2, count - 1 - count // 2), mode="edge"), np.ones(count) / count, "valid"
    )
    return np.asarray(passed + width / 2.0 * smooth)


def after_play(position: Array, width: float) -> Array:
    """What passes on: it follows where the play is used up."""
    passed, at, half = np.empty_like(position), float(position[0]), width / 2.0
    for k, x in enumerate(position.tolist()):
        at = x - half if x - half > at else x + half if x + half < at else at
        passed[k] = at
    return passed


def play(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """Play between a motor and its tendon (kinematics 1), or between a joint and its encoder (2)."""
    at_tendon = hand.source == 1
    place = int(rng.integers(len(hand.truth["tendons" if at_tendon else "joints"])))

    def motor(signals: dict[str, Array], finger: Finger, magnitude: float) -> None:
        x = signals["tendon_position"]
        x[:, place] = before_play(x[:, place], signals["time"], magnitude)

    def joint(angle: Array, magnitude: float) -> Array:
        turned: Array = angle.copy()
        turned[:, place] = after_play(angle[:, place], magnitude)
        return turned

    if at_tendon:
        return hand, Hidden("backlash", tendon=place + 1, magnitude=2e-4, sensors=motor)
    return hand, Hidden("backlash", joint=place + 1, magnitude=0.02, path=joint)


SENSORS: dict[str, Callable[..., tuple[Hand, Hidden]]] = {
    "force_gain": wrong_force("force_gain", 0.05, lambda force, size: force / (1.0 + size)),
    "force_offset": wrong_force("force_offset", 0.5, lambda force, size: force - size),
    "time_delay": late,
    "moment_arm": wrong_arm("moment_arm", 3e-4, lambda q, d: sign_of(d) + 0.0 * q, lambda q, d: sign_of(d) * q),
    "moment_arm_variation": wrong_arm(
        "moment_arm_variation", 5e-4, lambda q, d: sign_of(d) * q, lambda q, d: sign_of(d) * q**2 / 2.0
    ),
    "pulley_eccentricity": wrong_arm(
        "pulley_eccentricity",
        5e-4,
        lambda q, d: np.sin(q + np.pi * d[1]),
        lambda q, d: np.cos(np.pi * d[1]) - np.cos(q + np.pi * d[1]),
    ),
    "tendon_nonlinearity": progressive,
    "backlash": play,
}
