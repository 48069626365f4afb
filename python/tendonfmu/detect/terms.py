"""What runs over free motion with nothing in contact say about the bounds of `contact.bands`, by cell of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array, Data, Flags, Indices, Numbers, rounded
from tendonfmu.detect.free_motion import FreePart
from tendonfmu.errors import InputError
from tendonfmu.model import native

NAMES = ("noise", "friction", "friction_limit", "motor_load", "friction_change", "friction_reserve")
BANDS = 4
CELL = 0.01  # s, of which only the sample with the largest distance counts, by joint and band
_NEVER = 1e6  # N·m, a noise that no residual exceeds
_BLOCK = 50_000  # samples at once: the terms are 32 numbers for each joint
_KEPT = ("residual", "compensated_torque_std")


Signal = NDArray[np.float32]  # saves memory for millions of samples


@dataclass(frozen=True)
class Terms:
    """Distances and squared terms of a stretch of free motion, by cell, joint and band."""

    level: Signal  # [c, n, 4] the distance that decides: the lesser of those from m and from the slow mean (N·m)
    squares: Signal  # [c, n, 4, 6] of 1, |T|, B, D, min(|ΔT|, D), min(S, D_3)
    time: Numbers  # [c] (s)


def terms_of(time: Numbers, values: Numbers, counted: Flags) -> Terms:
    """Reduce the output `contact_terms` [N, n, 4, 8] to cells; samples that do not count are left out."""
    rows = np.flatnonzero(counted)
    if not len(rows):
        empty = np.zeros((0, *values.shape[1:3]), dtype=np.float32)
        return Terms(empty, np.zeros((*empty.shape, len(NAMES)), dtype=np.float32), np.zeros(0))
    first = begins(np.floor(time[rows] / CELL + 1e-6))
    farthest = rows[largest(np.abs(values[rows, :, :, 1]), first)]
    picked = np.take_along_axis(values, farthest[..., None], axis=0).astype(np.float32)
    return Terms(picked[..., 1], picked[..., 2:] ** 2, time[rows[first]])


def begins(number: Numbers) -> Indices:
    """Return the first index of each run of equal numbers."""
    return np.flatnonzero(np.diff(number, prepend=np.nan) != 0)


def largest(values: Numbers | Signal, first: Indices) -> Indices:
    """Return the index of the largest value along axis 0 in each block that begins at `first`."""
    most = np.repeat(np.maximum.reduceat(values, first, axis=0), np.diff(np.append(first, len(values))), axis=0)
    index = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.minimum.reduceat(np.where(values == most, index, len(values)), first, axis=0))


def run_free(data: Data, parts: Sequence[FreePart]) -> tuple[list[Terms], list[dict[str, Array]]]:
    """Run the finger over every part with nothing in contact; return terms, and residual and std [N, n] (N·m)."""
    finger = native.Instance.from_description(_without_contact(data, parts), parts[0].kinematics)
    start = finger.save_state()
    terms, kept = [], []
    for part in parts:
        finger.restore_state(start)
        pieces, outputs = [], []
        for begin in range(0, len(part.time), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            try:
                run = finger.run({name: values[rows] for name, values in part.arrays.items()}, terms=True)
            except native.NativeError as refused:
                raise InputError(f"{part.source}: {refused}") from None
            pieces.append(terms_of(part.time[rows], run["contact_terms"], part.counted[rows]))
            outputs.append({name: run[name] for name in _KEPT})
        terms.append(Terms(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in vars(pieces[0]))))
        kept.append({name: np.concatenate([each[name] for each in outputs]) for name in _KEPT})
    return terms, kept


def _without_contact(data: Data, parts: Sequence[FreePart]) -> dict[str, Any]:
    """Return the description with bounds that nothing exceeds."""
    joints = len(data["joints"])
    contact: dict[str, Any] = {"threshold": [_NEVER] * joints, **motors_of(parts)}
    return {**data, "contact": {**contact, "method": "bands", "bands": [{"noise": [_NEVER] * joints}] * BANDS}}


def motors_of(parts: Sequence[FreePart]) -> dict[str, bool]:
    """Return the key that makes bounds use the tendon positions, if all parts have them."""
    known = all(np.isfinite(part.arrays.get("tendon_position", np.nan)).all() for part in parts)
    return {"watches_motors": True} if known else {}


def bands_of(numbers: Numbers, digits: int = 4) -> list[dict[str, list[float]]]:
    """Return `contact.bands` of numbers [n, 4, 6]; what is 0 at all joints is left out."""
    return [
        {name: rounded(numbers[:, k, p], digits) for p, name in enumerate(NAMES) if numbers[:, k, p].any()}
        for k in range(numbers.shape[1])
    ]
