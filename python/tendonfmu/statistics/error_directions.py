"""Which few relative errors of the parts of a torque give its standard deviation.

A direction w stands for an error Σ_i w_i φ_i of a torque with the parts φ. Several independent directions give the
standard deviation (Σ_d (w_d·φ)²)^½.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from tendonfmu.arrays import Numbers

MOST = 4  # directions; docs/reference/semantics/detection.md#uncertainty
_UNSEEN = 1e-12  # of the largest second moment; the motion does not show combinations of parts with less
_NOTHING = 1e-12  # of the variance; directions with less are left out
_ROUNDS = 40  # of the least squares


def predicted(parts: Numbers, directions: Numbers) -> Numbers:
    """Return the standard deviation of torques."""
    # parts: [K, q] (N·m); directions: [d, q]; returns [K] (N·m)
    return np.asarray(np.sqrt(squares(parts @ directions.T)))


def squares(rows: Numbers) -> Numbers:
    """Return the sum of squares of each row [K], without a copy of the rows."""
    return np.asarray(np.einsum("ku,ku->k", rows, rows))


def few_directions(parts: Numbers, slopes: Numbers, most: int = MOST) -> tuple[Numbers, float]:
    """Find a few directions that give the standard deviation of torques."""
    # To make up for this, they are scaled to the mean variance and then adjusted by least squares, so that their
    # prediction is as near as possible to the standard deviation of each sample.
    # parts: [K, q] (N·m); slopes: [K, u] (N·m); returns [d, q], d at most `most`
    std = np.sqrt(squares(slopes))
    variance = float(np.mean(std**2))
    moment, axes = np.linalg.eigh(parts.T @ parts / len(parts))
    seen = moment > _UNSEEN * max(float(moment[-1]), 1e-300)
    if not variance > 0 or not seen.any():
        return np.zeros((0, parts.shape[1])), 1.0
    white = axes[:, seen] / np.sqrt(moment[seen])  # [q, r]: parts·white has the second moment 1
    shown = parts @ white
    eigenvalues, leading = _leading(shown.T @ slopes / len(parts), most)
    captured = float(np.sum(eigenvalues)) / variance
    start = leading * np.sqrt(eigenvalues / max(captured, 1e-300))
    turned = _principal(_matched(shown, start.T, std))
    directions = turned[np.sum(turned**2, axis=1) > _NOTHING * variance] @ white.T
    return directions * _signs(directions), min(captured, 1.0)


def _leading(regression: Numbers, most: int) -> tuple[Numbers, Numbers]:
    """Return the largest eigenvalues [d] of A Aᵀ and their vectors [r, d], for A [r, u]."""
    values, vectors = np.linalg.eigh(regression @ regression.T)
    chosen = np.argsort(-values)[:most]
    return np.maximum(values[chosen], 0.0), vectors[:, chosen]


def _matched(shown: Numbers, start: Numbers, std: Numbers) -> Numbers:
    """Return the directions [d, r] that predict std [K] best by least squares. start: [d, r]."""
    size = max(float(np.sqrt(np.mean(std**2))), 1e-300)
    small = 1e-9 * size  # the root has no slope where all parts are zero

    def project(flat: Numbers) -> tuple[Numbers, Numbers]:
        torques = shown @ flat.reshape(start.shape).T
        return torques, np.sqrt(squares(torques) + small**2)

    def error(flat: Numbers) -> Numbers:
        return (project(flat)[1] - std) / size

    def slope(flat: Numbers) -> Numbers:
        torques, total = project(flat)
        share = torques / (total * size)[:, None]
        return (share[:, :, None] * shown[:, None, :]).reshape(len(shown), -1)

    if len(shown) < start.size:
        return start
    solution = least_squares(error, start.ravel(), slope, method="lm", max_nfev=_ROUNDS)
    return np.asarray(solution.x.reshape(start.shape))


def _principal(directions: Numbers) -> Numbers:
    """Return orthogonal directions with the same predictions, the largest first. Rotations change no prediction."""
    _, size, axes = np.linalg.svd(directions, full_matrices=False)
    return np.asarray(size[:, None] * axes)


def _signs(directions: Numbers) -> Numbers:
    """Return signs [d, 1] that make the largest number of each direction positive. Opposite errors are equivalent."""
    largest = np.argmax(np.abs(directions), axis=1)
    return np.asarray(np.where(directions[np.arange(len(directions)), largest] < 0, -1.0, 1.0)[:, None])
