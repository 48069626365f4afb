"""Regression on noisy columns, whose noise is taken out of their moments, with intervals from sums over blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr, stdtrit

from tendonfmu.arrays import Flags, Indices, Numbers

LEVEL = 0.975  # of Student's t: intervals of 95 %
OF_NOISE = 0.05  # of the variance in any direction of the columns: with more, they do not tell
NOISE_KNOWN = 0.2  # of its variance, to which the noise is known


@dataclass(frozen=True)
class Estimate:
    """Slopes of the columns, then the zero of each side."""

    value: Numbers  # [p + s]
    covariance: Numbers  # [p + s, p + s]
    known: Flags  # [p + s] a column that stands still tells nothing
    free: int  # degrees of freedom
    share: float  # of the variance that is noise, in the worst direction

    def change(self, at: int, then: int) -> float:
        """Return by how much a number differs from another."""
        return float(self.value[at] - self.value[then])

    def difference(self, at: int, then: int | None = None) -> tuple[float, float, float]:
        """Return a number, half of the interval of it or of its difference from another, and the p-value of that."""
        rows = [at] if then is None else [at, then]
        signs = np.array([1.0, -1.0][: len(rows)])
        if not self.known[rows].all():
            return 0.0, np.inf, 1.0
        error = float(np.sqrt(max(signs @ self.covariance[np.ix_(rows, rows)] @ signs, 0.0)))
        slack = NOISE_KNOWN * self.share * abs(self.value[at]) * (at >= 0)
        off = abs(float(signs @ self.value[rows]))
        p_value = 2.0 * float(stdtr(self.free, -max(off - slack, 0.0) / max(error, 1e-300)))
        return float(self.value[at]), float(stdtrit(self.free, LEVEL) * error + slack), p_value


def noisy_regression(
    columns: Numbers, noise: Numbers, target: Numbers, block: Indices, side: Indices, own: int
) -> Estimate | None:
    """Regress on noisy columns and a constant of each side; the first `own` columns of each side are its own."""
    # columns: [N, p]; noise: [p] variances of the columns; target: [N]; block, side: [N]
    rows = (side[:, None] == np.arange(side.max() + 1)).astype(float)  # [N, s]
    owner = np.full(columns.shape[1], -1)
    owner[: own * rows.shape[1]] = np.repeat(np.arange(rows.shape[1]), own)
    counted = np.column_stack([rows, np.ones(len(rows))])[:, owner]  # where a column counts [N, p]
    many = counted.sum(axis=0)
    middle = (columns * counted).sum(axis=0) / many
    centred = (columns - middle) * counted
    variance = (centred**2).sum(axis=0) / many
    used = variance > np.maximum(4.0 * noise, 1e-24)  # others stand still; what they do is not known
    scale = np.sqrt(variance[used])
    design = np.column_stack([centred[:, used] / scale, rows])
    of_noise = np.append(noise[used] / scale**2, np.zeros(rows.shape[1]))
    in_all = np.append(many[used], rows.sum(axis=0))
    moments = design.T @ design - np.diag(in_all * of_noise)
    _, number = np.unique(block, return_inverse=True)
    blocks, free = int(number.max()) + 1, int(number.max()) + 1 - design.shape[1]
    if free < 1 or np.linalg.eigvalsh(moments)[0] < 1e-9 * len(design):
        return None
    share = float(np.linalg.eigvals(np.linalg.solve(design.T @ design, np.diag(in_all * of_noise))).real.max())
    if share > OF_NOISE:
        return None
    inverse = np.linalg.inv(moments)
    beta = inverse @ (design.T @ target)
    scores = np.zeros((blocks, len(beta)))
    np.add.at(scores, number, design * (target - design @ beta)[:, None])
    in_block = np.zeros((blocks, len(beta)))
    np.add.at(in_block, number, np.column_stack([counted[:, used], rows]))
    scores += in_block * (of_noise * beta)
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / free
    turn = np.zeros((len(used) + rows.shape[1], len(beta)))
    at = np.flatnonzero(used)
    turn[at, np.arange(len(at))] = 1.0 / scale
    for k in range(rows.shape[1]):  # the zero: where all columns of the side are 0
        turn[len(used) + k, len(at) + k] = 1.0
        turn[len(used) + k, : len(at)] = np.where(np.isin(owner[at], (k, -1)), -middle[at] / scale, 0.0)
    known = np.append(used, np.ones(rows.shape[1], dtype=bool))
    return Estimate(turn @ beta, turn @ covariance @ turn.T, known, free, share)
