"""Which sudden torques a finger finds: pushes of random sizes are added to free motion, and the finger runs over it.

A push of torque t at a joint turns the joints by Δq = −(RᵀKR)⁻¹·t and changes the tendon forces by −K·R·Δq, as with
motors that stand firm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.detect.free_motion import FreePart, runs_of

EVERY = (2.5, 3.5)  # s, from one push to the next
RISE, HELD = 0.02, 0.3  # s
SIZES = (1.0, 40.0)  # times the rms of the residual
WITHIN = 0.06  # s after its onset in which a push is found
SURE = 0.9  # share of the pushes of a size that are found
LONGEST = 1200.0  # s of motion, for each joint
SLOPES = (0.5, 20.0)  # of the log odds over the log of the size


def push_sizes(data: Data, parts: Sequence[FreePart], rms: Numbers) -> Numbers:
    """Return by joint [n] the torque of which `SURE` are found within `WITHIN`; NaN if that is beyond `SIZES` (N·m)."""
    seconds = sum(float(part.seconds.sum()) for part in parts)
    used = [part.cut(np.arange(int(len(part.time) * min(1.0, LONGEST / seconds)))) for part in parts]
    used = [part for part in used if part.counted.any()]
    sizes = np.full(len(rms), np.nan)
    for j, left in enumerate(rms):
        random = np.random.default_rng(j)
        pushes = [_pushes(part, left, random) for part in used]
        loaded = [pushed_part(data, part, j, *each) for part, each in zip(used, pushes, strict=True)]
        found = [
            _found(part.time, outputs["contact"].ravel().astype(bool), onset)
            for (part, outputs), (onset, _) in zip(runs_of(data, loaded), pushes, strict=True)
        ]
        sizes[j] = size_found(np.abs(np.concatenate([size for _, size in pushes])), np.concatenate(found))
    return np.where(sizes <= SIZES[1] * rms, sizes, np.nan)


def size_found(sizes: Numbers, found: Flags) -> float:
    """Return the size of which `SURE` are found, by logistic regression of found [p] on the log of the sizes [p]."""
    if not found.any():
        return float("nan")
    middle = float(np.log(sizes).mean())
    x, sign = np.log(sizes) - middle, np.where(found, 1.0, -1.0)

    def loss(line: Numbers) -> float:
        return float(np.logaddexp(0.0, -sign * (line[0] + line[1] * x)).sum())

    level, slope = minimize(loss, np.array([0.0, 2.0]), method="L-BFGS-B", bounds=[(None, None), SLOPES]).x
    return float(np.exp(middle + (np.log(SURE / (1.0 - SURE)) - level) / slope))


def _pushes(part: FreePart, rms: float, random: np.random.Generator) -> tuple[Numbers, Numbers]:
    """Return the onsets [p] (s) and the torques [p] (N·m) of pushes in counted time."""
    count = int((part.time[-1] - part.time[0]) / EVERY[0]) + 1
    onset = part.time[0] + np.cumsum(random.uniform(*EVERY, count))
    factor = np.exp(random.uniform(np.log(SIZES[0]), np.log(SIZES[1]), count))
    size = rms * factor * random.choice([-1.0, 1.0], count)
    rows = np.searchsorted(part.time, onset)
    kept = onset < part.time[-1] - HELD
    kept[kept] = part.counted[rows[kept]]
    return onset[kept], size[kept]


def pushed_part(data: Data, part: FreePart, joint: int, onset: Numbers, size: Numbers) -> FreePart:
    """Return the part with pushes at a joint."""
    torque, time = np.zeros(len(part.time)), part.time
    for at, own in zip(onset, size, strict=True):
        rows = slice(*np.searchsorted(time, [at, at + HELD]))
        since = np.minimum(time[rows] - at, at + HELD - time[rows])
        torque[rows] = own * np.clip(since / RISE, 0.0, 1.0)
    arms = np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]], dtype=float)
    turned = -np.linalg.pinv(arms.T * stiffness @ arms)[joint]
    arrays = dict(part.arrays)
    arrays["tendon_force"] = arrays["tendon_force"] - np.outer(torque, stiffness * (arms @ turned))
    if "joint_position" in arrays:
        arrays["joint_position"] = arrays["joint_position"] + np.outer(torque, turned)
    if "joint_velocity" in arrays:
        arrays["joint_velocity"] = arrays["joint_velocity"] + np.outer(np.gradient(torque, time), turned)
    return replace(part, arrays=arrays)


def _found(time: Numbers, contact: Flags, onset: Numbers) -> Flags:
    """Return [p] whether contact begins within `WITHIN` of an onset."""
    first, end = np.searchsorted(time, onset), np.searchsorted(time, onset + WITHIN, side="right")
    return np.array([contact[a:b].any() and not contact[a - 1] for a, b in zip(first, end, strict=True)], dtype=bool)
