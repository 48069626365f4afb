"""What the demo finger is told to do: slow random joint motions and pushes on its tip."""

from __future__ import annotations

import contacts as c
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def joint_motion(time: Array, rng: np.random.Generator, still: float) -> Array:
    """Commanded joint angles (samples, 4) in rad: each joint goes its own way between random targets.

    A stroke is a quintic of zero velocity and acceleration at both ends, its peak speed is 0.15 to
    0.9 rad/s; one stroke in four is followed by a rest of 0.3 to 1.5 s. The first and last `still`
    seconds are a rest of all joints.
    """
    motion = np.empty((len(time), 4))
    for j, (middle, half_range) in enumerate(zip(c.JOINT_MIDDLE, c.JOINT_HALF_RANGE, strict=True)):
        angle, now = c.COVER_REST_ANGLE[j], still
        motion[:, j] = angle
        end = time[-1] - still
        while now < end - 0.5:
            target = middle + 0.9 * half_range * rng.uniform(-1.0, 1.0)
            # the quintic's peak speed is 15/8 of its mean speed
            duration = max(0.4, 1.875 * abs(target - angle) / rng.uniform(0.15, 0.9))
            duration = min(duration, end - now)
            s = np.clip((time - now) / duration, 0.0, 1.0)
            motion[:, j] += (target - angle) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            angle, now = target, now + duration
            if rng.random() < 0.25:
                now += rng.uniform(0.3, 1.5)
    return motion


def pushes(time: Array, rng: np.random.Generator, count: int, first: float) -> Array:
    """Force on the fingertip (samples, 3) in N, in the tip's frame (along, sideways, pad to nail).

    `count` pushes of 0.5 to 1.5 s, 0.8 to 2.5 N at the plateau, with ramps of 0.1 to 0.25 s, the
    first not before `first` s; in turn on the pad or the nail, sideways, and from any direction.
    """
    force = np.zeros((len(time), 3))
    slot = (time[-1] - 2.0 - first) / count
    for k in range(count):
        length, ramp = rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.25)
        start = first + k * slot + rng.uniform(0.0, slot - length - 1.0)
        direction = rng.standard_normal(3)
        if k % 3 < 2:
            # keep the component on the pad or nail, or the sideways one
            direction *= np.eye(3)[2 - k % 3]
        direction /= np.linalg.norm(direction)
        shape = np.clip(np.minimum(time - start, start + length - time) / ramp, 0.0, 1.0)
        force += rng.uniform(0.8, 2.5) * shape[:, None] * direction
    return force


def load_of_push(angle: Array, force: Array) -> Array:
    """Joint torques (4,) in N.m that hold a `force` (3,) on the tip: minus the force's own torque.

    Serial chain: abduction about the vertical axis through the knuckle, then three flexions in the
    plane of the finger, link lengths of `contacts.LINK_LENGTH`.
    """
    lengths = np.array(c.LINK_LENGTH)
    heading = np.cumsum(angle[1:])
    forward, down = np.cos(heading), np.sin(heading)
    # tip seen from each flexion axis, in the plane of the finger
    ahead = np.cumsum((lengths * forward)[::-1])[::-1]
    below = np.cumsum((lengths * down)[::-1])[::-1]
    # the force in the plane: forward and downward; a push on the pad opens the finger
    along, sideways, on_pad = force
    push_forward = along * forward[2] + on_pad * down[2]
    push_down = along * down[2] - on_pad * forward[2]
    flexion = ahead * push_down - below * push_forward
    abduction = ahead[0] * sideways
    return -np.concatenate([[abduction], flexion])
