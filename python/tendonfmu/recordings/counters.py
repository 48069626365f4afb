"""Counters that start again: signed words stored as unsigned, encoders of many turns, timers that overflow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.recordings.faults import value_step

EMPTY = 0.1  # of the range: the widest part that no sample reaches
GRID = 0.01  # of the smallest difference: others are as near to a multiple of it
LEAST_WORD = 128.0  # steps; sensors use each second or fourth step of a word, too
SAME = 0.02  # relative, between the jumps and the word
SHORT, OPPOSITE = 0.25, 0.8  # of the range: the steps of a turning encoder between its jumps; share of jumps backwards
# readings of one turn or word: powers of two, degrees and their parts, radians, whole turns, decimal encoders
DECIMAL = [float(digits * 10**k) for k in range(4) for digits in (1000, 2000, 2400, 4000, 5000, 8000)]
TURNS = np.array([2.0 * np.pi, *(2.0**k for k in range(7, 33)), *(360.0 * 10**k for k in range(4)), *DECIMAL])
# a counter of 16, 24, 31 or 32 bits, and one of 32 bits in ms or µs written in coarser units; a day in s, ms and ns
OVERFLOWS = (2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6, 86400.0, 86400e3, 86400e9)
FRACTIONS = (1e3, 1e6, 1e9)  # ms, µs and ns beyond a second, which start again many times


def unwrapped(readings: NDArray[Any], wrap: float, last: float) -> NDArray[np.float64]:
    """Return readings [N] of a counter without its jumps: each within half a turn of the one before, or of `last`."""
    steps = np.diff(readings, prepend=last)
    path = last + np.cumsum((steps + wrap / 2.0) % wrap - wrap / 2.0)
    # whole turns alone are added, so that readings do not change by rounding
    return np.asarray(readings + wrap * np.round((path - readings) / wrap), dtype=np.float64)


def overflow(times: NDArray[Any]) -> float | None:
    """Return the readings after which a timer [N] starts again at 0, or None."""
    steps = np.diff(times.astype(np.float64))
    falls = np.flatnonzero(steps < 0.0)
    rises = steps[steps > 0.0]
    if not len(falls) or not len(rises):
        return None
    beyond = max(10.0 * float(np.median(rises)), 1.0)  # a step over the end may be longer than the usual ones
    for word in (*OVERFLOWS, *(FRACTIONS if len(falls) > 1 else ())):
        over = word + steps[falls]
        is_over = (over >= 0.0).all() and (over < beyond).all() and beyond < 0.5 * word
        if is_over and (times <= word).all():
            return float(word)
    return None


def wrap_of(column: Numbers, turns: bool = True) -> float | None:
    """Return the readings after which a word, or with turns an encoder, [N] starts again, in its unit, or None."""
    if len(column) < 3 or not np.abs(np.diff(column)).max() > 0.5 * np.ptp(column):
        return None  # a counter jumps by nearly its range
    step = finest(column)
    steps = _word(column, step) if step else None
    if steps is None:
        return _turn(column, step) if turns else None
    return steps * step


def finest(column: Numbers) -> float:
    """Return the width of a column's steps [N], or 0 if it has none."""
    step = np.diff(column)
    if not step.any():
        return 0.0
    sizes = np.abs(step[step != 0.0])
    multiples = sizes / sizes.min()
    is_grid = np.abs(multiples - np.round(multiples)).max() < GRID
    return value_step(column) or (float(sizes.min()) if is_grid else 0.0)


def _word(column: Numbers, finest_step: float) -> float | None:
    """Return the steps by which a column jumps if they are those of a word of a computer and no value is between."""
    levels, step = np.unique(column), np.diff(column)
    if len(levels) < 3:
        return None
    widest = int(np.argmax(np.diff(levels)))
    above = column > (levels[widest] + levels[widest + 1]) / 2.0
    jumps = np.abs(step[np.diff(above)])
    if levels[widest + 1] - levels[widest] < EMPTY * float(np.ptp(column)) or not len(jumps):
        return None
    count = float(np.median(jumps)) / finest_step
    word = float(2.0 ** np.round(np.log2(count)))
    return word if word >= LEAST_WORD and abs(count / word - 1.0) < SAME else None


def _turn(column: Numbers, finest_step: float) -> float | None:
    """Return the readings of one turn of an encoder that jumps back from one end of its range to the other."""
    steps, span = np.diff(column), float(np.ptp(column))
    is_jump = np.abs(steps) > span / 2.0
    if not is_jump.any() or np.abs(steps[~is_jump]).max(initial=np.inf if is_jump.all() else 0.0) > SHORT * span:
        return None
    if np.diff(np.unique(column)).max() > EMPTY * span:
        return None
    smooth = np.where(is_jump, np.nan, steps)
    beside = np.stack([np.concatenate([[np.nan], smooth[:-1]]), np.concatenate([smooth[1:], [np.nan]])])
    known = ~np.isnan(beside)
    motion = np.where(known, beside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    jumps, motion = steps[is_jump], motion[is_jump]
    if (jumps * motion <= 0.0).mean() < OPPOSITE or not motion.any():
        return None
    size = float(np.median(np.abs(jumps - motion)))
    # in SI, a step of the encoder is the unit in which its turn is a round number
    units = [1.0, finest_step] if finest_step else [1.0]
    sizes = np.concatenate([TURNS * unit for unit in units])
    fitting = sizes[(sizes >= span * (1.0 - 1e-9)) & (np.abs(sizes / size - 1.0) < SAME)]
    if len(fitting):
        return float(fitting[np.argmin(np.abs(fitting - size))])
    usual = float(f"{span + finest_step:.3g}")  # an encoder of another number of steps, which has been all around
    return usual if len(jumps) > 2 and usual >= span and abs(usual / size - 1.0) < SAME else None
