"""Other ways to do what `tendonfmu fit` does, for compare.py: scipy.optimize.least_squares, and the paper's
extended Kalman filter in numpy and in filterpy.

All are given the compiled Jacobian, dense, so that nothing but their own algebra is compared. The filters run sample
by sample, each sample linearised at the estimate before it; only their algebra is timed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.optimize import least_squares

from tendonfmu.arrays import Array
from tendonfmu.estimate import Estimator

CHUNK = 2000  # samples of Jacobian at a time: the compiled call's own arrays stay small


class Watch:
    """Adds up the time spent inside of `with`."""

    def __init__(self) -> None:
        self.seconds = self.cpu_seconds = 0.0

    def __enter__(self) -> Watch:
        self._begin = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self._begin[0]
        self.cpu_seconds += time.process_time() - self._begin[1]

    def times(self) -> dict[str, float]:
        return {"seconds": self.seconds, "cpu_seconds": self.cpu_seconds}


@dataclass(frozen=True)
class Task:
    """One recording in an estimator, [N] samples, n joints, U unknowns, and the numbers of its filter."""

    estimator: Estimator
    time: Array
    measured: Array  # [N, n] y, N·m
    noise: Array  # [N] (N·m)², R of each sample
    drift: float  # (N·m)²/s
    initial: float  # (N·m)²
    start: Array  # [U], as the next ones
    lower: Array
    upper: Array
    scale: Array


# --- least squares ----------------------------------------------------------------------------------------------------


def outer_products(rows: int, columns: int) -> dict[str, float]:
    """Times of Jᵀ J with J [rows, columns] dense; numpy gives it to the symmetric product (SYRK) of its BLAS."""
    J = np.random.default_rng(1).standard_normal((rows, columns))
    with Watch() as watch:
        J.T @ J
    return watch.times()


def least_squares_fit(task: Task, prior_std: float, most_calls: int) -> dict[str, Any]:
    """Maximum likelihood by scipy: whitened innovations and prior as residuals, trust region within bounds."""
    samples, n = task.measured.shape
    u = len(task.start)
    calls = {"residuals": 0, "jacobians": 0}

    def residuals(x: Array) -> Array:
        calls["residuals"] += 1
        e, variance, _ = task.estimator.innovations(0, x * task.scale)
        return np.concatenate([(e / np.sqrt(variance)[:, None])[1:].ravel(), (x - task.start / task.scale) / prior_std])

    def jacobian(x: Array) -> Array:
        calls["jacobians"] += 1
        _, variance, _ = task.estimator.innovations(0, x * task.scale)
        rows = np.zeros(((samples - 1) * n + u, u))
        whitened_rows(task, x * task.scale, variance, rows[:-u].reshape(samples - 1, n, u))
        rows[:-u] *= task.scale
        rows[-u:] = np.eye(u) / prior_std
        return rows

    bounds = (task.lower / task.scale, task.upper / task.scale)
    with Watch() as watch:
        solution = least_squares(
            residuals, task.start / task.scale, jacobian, bounds=bounds, method="trf", ftol=1e-6, max_nfev=most_calls
        )
    figures = {"cost": float(solution.cost), "converged": bool(solution.status > 0), "iterations": calls["jacobians"]}
    return watch.times() | figures | {"z": solution.x * task.scale}


def whitened_rows(task: Task, z: Array, variance: Array, rows: Array) -> None:
    """Fills rows [N − 1, n, U]: derivative of e/√S of each sample but the first, the bias carried along."""
    gain, std = 1.0 - task.noise / variance, np.sqrt(variance)
    bias = np.zeros(rows.shape[1:])
    for begin in range(0, len(task.time), CHUNK):
        end = min(begin + CHUNK, len(task.time))
        _, _, torque, jump = task.estimator.jacobian(0, z, begin, end)
        for k in range(begin, end):
            if k == 0:
                bias = -torque[0]
                continue
            bias += jump[k - begin]
            e = -torque[k - begin] - bias
            bias += gain[k] * e
            np.divide(e, std[k], out=rows[k - 1])


# --- Kalman filters ---------------------------------------------------------------------------------------------------


class Filter(Protocol):
    """State [U + n]: unknowns in units of their scale, then the biases. P [U + n, U + n]."""

    x: Array
    P: Array

    def predict(self, step: Array, slope: Array, drift: float) -> None:
        """The biases jump by `step` [n], `slope` [n, U] its derivative; their variances grow by `drift`."""

    def update(self, y: Array, expected: Array, H: Array, noise: float) -> None:
        """Takes y [n], expected from the state with derivative H [n, U + n]."""


class JosephFilter:
    """P = (I − K H) P (I − K H)ᵀ + K R Kᵀ, dense, as in textbooks; the prediction touches what changes only."""

    def __init__(self, x: Array, P: Array) -> None:
        self.x, self.P = x, P

    def predict(self, step: Array, slope: Array, drift: float) -> None:
        u = slope.shape[1]
        self.x[u:] += step
        if slope.any():
            self.P[u:] += slope @ self.P[:u]
            self.P[:, u:] += self.P[:, :u] @ slope.T
        self.P[range(u, len(self.P)), range(u, len(self.P))] += drift

    def update(self, y: Array, expected: Array, H: Array, noise: float) -> None:
        PHt = self.P @ H.T
        R = noise * np.eye(len(y))
        K = np.linalg.solve(H @ PHt + R, PHt.T).T
        self.x += K @ (y - expected)
        keep = np.eye(len(self.x)) - K @ H
        self.P = keep @ self.P @ keep.T + K @ R @ K.T


class SymmetricFilter(JosephFilter):
    """P −= W Wᵀ with W = P Hᵀ L⁻ᵀ, L Lᵀ = S: as little as numpy can do for a sample."""

    def update(self, y: Array, expected: Array, H: Array, noise: float) -> None:
        PHt = self.P @ H.T
        L = np.linalg.cholesky(H @ PHt + noise * np.eye(len(y)))
        W = np.linalg.solve(L, PHt.T)
        self.x += W.T @ np.linalg.solve(L, y - expected)
        self.P -= W.T @ W


def filterpy_filter(x: Array, P: Array, n: int) -> Filter:
    """filterpy's own ExtendedKalmanFilter. Raises ImportError where it is not installed."""
    from filterpy.kalman import ExtendedKalmanFilter

    class FilterpyFilter(ExtendedKalmanFilter):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(dim_x=len(x), dim_z=n)
            self.x, self.P, self.Q, self.step = x, P, np.zeros_like(P), np.zeros(n)

        def predict_x(self, u: Any = 0) -> None:
            self.x[-len(self.step) :] += self.step

        def predict(self, step: Array, slope: Array, drift: float) -> None:
            n, unknowns = slope.shape
            self.step = step
            self.F[unknowns:, :unknowns] = slope
            self.Q[range(unknowns, unknowns + n), range(unknowns, unknowns + n)] = drift
            super().predict()

        def update(self, y: Array, expected: Array, H: Array, noise: float) -> None:
            super().update(y, lambda _: H, lambda _: expected, R=noise * np.eye(len(y)))

    return FilterpyFilter()


FILTERS: Mapping[str, Callable[[Array, Array], Filter]] = {"joseph": JosephFilter, "symmetric": SymmetricFilter}


def run_filter(task: Task, kind: str, prior_std: float, samples: int) -> dict[str, Any]:
    """The first `samples` samples through a filter of `kind`; times: of its algebra alone."""
    u, n = len(task.start), task.measured.shape[1]
    torque, _, H0, _ = (rows[0] for rows in task.estimator.jacobian(0, task.start, 0, 1))
    P = np.zeros((u + n, u + n))
    P[:u, :u] = prior_std**2 * np.eye(u)
    P[u:, :u] = -(H0 * task.scale) * prior_std**2
    P[:u, u:] = P[u:, :u].T
    P[u:, u:] = P[u:, :u] @ P[:u, u:] / prior_std**2 + task.initial * np.eye(n)
    x = np.concatenate([task.start / task.scale, task.measured[0] - torque])
    kalman = filterpy_filter(x, P, n) if kind == "filterpy" else FILTERS[kind](x, P)
    lower, upper = task.lower / task.scale, task.upper / task.scale
    watch = Watch()
    for k in range(1, samples):
        torque, jump, dT, dJ = (rows[0] for rows in task.estimator.jacobian(0, kalman.x[:u] * task.scale, k, k + 1))
        H = np.hstack([dT * task.scale, np.eye(n)])
        slope = dJ * task.scale
        with watch:
            kalman.predict(jump, slope, task.drift * (task.time[k] - task.time[k - 1]))
            kalman.update(task.measured[k], torque + kalman.x[u:], H, float(task.noise[k]))
            np.clip(kalman.x[:u], lower, upper, out=kalman.x[:u])
    z = kalman.x[:u] * task.scale
    return watch.times() | {"z": z, "std": np.sqrt(np.diag(kalman.P)[:u]) * task.scale}
