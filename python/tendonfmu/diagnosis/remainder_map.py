"""Where the predictable part of what is left shows: over the two recorded signals that it follows best."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.diagnosis.remainder import Remainder
from tendonfmu.diagnosis.result import RemainderMap
from tendonfmu.diagnosis.series import Series

CELLS = 14  # on each side
COARSE = 2  # cells on each side of those in which the choice of the signals is made
FEWEST = 5  # blocks in a cell that is drawn


def remainder_map(
    series: Series, left: Numbers, remainder: Remainder, joints: Sequence[str], tendons: Sequence[str]
) -> RemainderMap | None:
    """Return the map of the joint with the largest prediction [B, n], N·m; None if nothing is predicted."""
    power = np.sum(remainder.prediction[series.used] ** 2, axis=0)
    joint = int(np.argmax(power))
    if not power[joint]:
        return None
    signals = _signals(series, joints, tendons)
    followed = {finding.group for finding in remainder.findings if finding.joint == joint + 1}
    if "angle" in followed and len(joints) > 1:
        signals = {label: values for label, values in signals.items() if label.startswith("angle")}
    cells = {name: _cells(values[series.used]) for name, values in signals.items()}
    if len(cells) < 2:
        return None
    wave = left[series.used, joint]
    one, two = max(combinations(cells, 2), key=lambda pair: _comes_back(wave, *(cells[name][1] for name in pair)))
    (columns, column), (rows, row) = cells[one], cells[two]
    number = row * CELLS + column
    count = np.bincount(number, minlength=CELLS**2)
    total = np.bincount(number, left[series.used, joint], minlength=CELLS**2)
    mean = np.where(count >= FEWEST, total / np.maximum(count, 1), np.nan)
    return RemainderMap(joint + 1, (one, two), (columns, rows), mean.reshape(CELLS, CELLS))


def _signals(series: Series, joints: Sequence[str], tendons: Sequence[str]) -> dict[str, Numbers]:
    """Return the recorded signals [B] that vary, by their labels."""
    signals = {f"angle of {name} (rad)": series.angle[:, j] for j, name in enumerate(joints)}
    signals |= {f"velocity of {name} (rad/s)": series.velocity[:, j] for j, name in enumerate(joints)}
    signals |= {f"force of {name} (N)": series.force[:, i] for i, name in enumerate(tendons)}
    return {label: values for label, values in signals.items() if np.ptp(values[series.used]) > 1e-12}


def _cells(values: Numbers) -> tuple[Numbers, Indices]:
    """Return the edges of cells of equal width between the outer hundredths of the values, and the cell of each."""
    low, high = np.quantile(values, (0.01, 0.99))
    edges = np.linspace(low, max(high, low + 1e-12), CELLS + 1)
    return edges, np.clip(np.searchsorted(edges, values, side="right") - 1, 0, CELLS - 1)


def _comes_back(wave: Numbers, column: Indices, row: Indices) -> float:
    """Return by how much the cells' means of one half of a wave [R] lower the squares of the other half."""
    # slow signals such as the pretension are never twice at one place, so they would follow any wave within a half
    number = row // COARSE * CELLS + column // COARSE
    gain, middle = 0.0, len(wave) // 2
    for seen, unseen in ((slice(middle), slice(middle, None)), (slice(middle, None), slice(middle))):
        count = np.bincount(number[seen], minlength=CELLS**2)
        mean: Numbers = np.bincount(number[seen], wave[seen], minlength=CELLS**2) / (count + FEWEST)
        gain += float(np.sum(wave[unseen] ** 2 - (wave[unseen] - mean[number[unseen]]) ** 2))
    return gain
