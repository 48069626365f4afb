"""Whether zeros of tendons are off one by one, or because a joint's encoder is: then all tendons of the joint agree.

An encoder that reads δ too much makes the zero of every tendon over its joint seem off by −r δ. The fewest offsets and
single zeros that explain all zeros are the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tendonfmu.arrays import Flags, Indices, Numbers

AGREE = 0.05  # of what an offset does to a zero: arms are known and constant to this share
MOST = 3  # offsets that are looked for together
FEWEST = 2  # tendons that have to agree on an offset


@dataclass(frozen=True)
class Offsets:
    """What the encoders read too much."""

    joints: Indices  # from 0 [k]
    offset: Numbers  # rad [k]
    half: Numbers  # of the 95 % intervals [k]
    single: Flags  # zeros [t] that no offset explains


def encoder_offsets(off: Numbers, known_to: Numbers, arms: Numbers) -> Offsets:
    """Explain zeros by the fewest offsets and single zeros."""
    # off: [t] m, how far zeros are off; known_to: [t] m, less is none; arms: [t, n] m
    joints = [int(j) for j in np.flatnonzero((arms != 0.0).sum(axis=0) >= FEWEST)]
    sets = (chosen for count in range(min(MOST, len(joints)) + 1) for chosen in combinations(joints, count))
    # of equally many, the fewest offsets: two zeros are no coincidence, an offset and a zero in one direction are
    return min(_explained(off, known_to, arms, sets), key=lambda each: len(each.joints) + int(each.single.sum()))


def offset_of(off: Numbers, known_to: Numbers, arms: Numbers) -> tuple[Numbers, Numbers]:
    """Return the offsets [k] that fit zeros best, and halves of their intervals; arms: [t, k]."""
    weighted = -arms / known_to[:, None]
    inverse = np.linalg.pinv(weighted.T @ weighted)
    return inverse @ weighted.T @ (off / known_to), np.sqrt(np.diag(inverse))


def _explained(off: Numbers, known_to: Numbers, arms: Numbers, sets: Iterator[Sequence[int]]) -> Iterator[Offsets]:
    for chosen in sets:
        own, kept = arms[:, list(chosen)], np.ones(len(off), dtype=bool)
        while ((own[kept] != 0.0).sum(axis=0) >= FEWEST).all():
            offset, half = offset_of(off[kept], known_to[kept], own[kept])
            beyond = np.where(kept, _beyond(off, known_to, own, offset), 0.0)
            if beyond.max(initial=0.0) <= 1.0:
                yield Offsets(np.array(chosen, dtype=np.intp), offset, half, ~kept)
                break
            # without which zero do the others agree best?
            options = np.flatnonzero(beyond > 1.0)
            left = [_left(off, known_to, own, kept & (np.arange(len(off)) != i)) for i in options]
            kept[options[int(np.argmin(left))]] = False


def _left(off: Numbers, known_to: Numbers, arms: Numbers, kept: Flags) -> float:
    offset, _ = offset_of(off[kept], known_to[kept], arms[kept])
    return float((_beyond(off, known_to, arms, offset)[kept] ** 2).sum())


def _beyond(off: Numbers, known_to: Numbers, arms: Numbers, offset: Numbers) -> Numbers:
    """Return how far each zero is from what offsets explain, in units of what is none [t]."""
    agree = AGREE * np.abs(arms * offset).max(axis=1, initial=0.0)
    return np.asarray(np.abs(off + arms @ offset) / np.maximum(known_to, agree))
