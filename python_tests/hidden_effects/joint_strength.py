"""How strong an absorbed effect is once another motion has been recorded as well, by the rig's own equations.

The first recording and one more are refitted together: the nominal's numbers are the same in both, the slow bias is
each recording's own. The other recordings are the rig's, not the menu of the product: pretension at other levels that
swings within a second, faster strokes, and a known load that changes sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from matched_rig import Hand, Made, record
from strength import BLOCK, averaged, bias_columns, number_columns, orthonormal, residual

Array = NDArray[Any]
QUICK_TENSION = 0.7  # s in which the pretension changes: a slow bias does not follow
LEVELS = (0.5, 2.0, 4.0)  # of the usual pretension
FASTER = 2.5  # times the usual speed
LOAD, LOAD_PERIOD = 0.1, 4.0  # N·m at every joint, s from one side to the other and back
LONGEST = 30.0  # s, of the other recordings: their strengths differ by a few percent from those of 60 s


def shown_strength(hand: Hand, seed: int, seconds: float) -> float:
    """Largest strength of what the hand hides in any of the other recordings, once both are refitted together."""
    first = record(hand, seed, seconds, quiet=True)
    known = residual(hand, first)
    return max(
        strength_of_both(hand, (first, other), (known, residual(hand, other) - load))
        for other, load in others(hand, seed + 1, min(seconds, LONGEST))
    )


def others(hand: Hand, seed: int, seconds: float) -> Iterator[tuple[Made, Array]]:
    """Quiet recordings of the hand, each with its known load [N, n] N·m."""
    samples, joints = round(seconds * hand.rate), len(hand.truth["joints"])
    none = np.zeros((samples, joints))
    swinging = replace(hand, tension_time=QUICK_TENSION)
    for level in LEVELS:
        yield record(swinging, seed, seconds, quiet=True, level=level), none
    yield record(swinging, seed, seconds, quiet=True, speed=FASTER), none
    phase = np.arange(samples) / hand.rate / LOAD_PERIOD
    # joints change sides at different times, so that one does not stand for another
    load = LOAD * np.sign(np.sin(2.0 * np.pi * phase[:, None] / (1.0 + 0.3 * np.arange(joints))))
    yield record(hand, seed, seconds, quiet=True, external=load), load


def strength_of_both(hand: Hand, recordings: tuple[Made, ...], effects: tuple[Array, ...]) -> float:
    """Variance over that of the noise, at the joint of the last recording where it shows most."""
    size = max(1, round(BLOCK * hand.rate))
    flat = [averaged(effect, size).T.ravel() for effect in effects]
    numbers = np.vstack([number_columns(hand, made) for made in recordings])
    bias = [bias_columns(hand, made) for made in recordings]
    own = np.zeros((len(numbers), sum(each.shape[1] for each in bias)))
    row = column = 0
    for each in bias:
        own[row : row + len(each), column : column + each.shape[1]] = each
        row, column = row + len(each), column + each.shape[1]
    nuisance = orthonormal(np.hstack([numbers, own]))
    whole = np.concatenate(flat)
    left = whole - nuisance @ (nuisance.T @ whole)
    by_joint = left[-len(flat[-1]) :].reshape(len(hand.truth["joints"]), -1)
    return float(np.mean(by_joint**2, axis=1).max() / hand.noise.std**2)
