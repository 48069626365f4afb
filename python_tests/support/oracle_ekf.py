"""Naive extended Kalman filter of the estimation: sample by sample, dense, Joseph form, for tests alone.

State: the unknowns in units of their scale, and n biases. Each sample is linearised at the estimate before it. Where
the model finds a tendon slack, a sample foretells but does not teach.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_fit import Likelihood, Unknowns, derivatives

Array = NDArray[Any]


class JosephFilter:
    """z [U], covariance of z and the biases in units of scale, bias [n]. `run` takes a recording.

    scale, lower, upper: [U]. prior_std: in units of scale. parameter_drift: relative variance per second.
    """

    def __init__(
        self, unknowns: Unknowns, n: int, scale: Array, lower: Array, upper: Array, prior_std: float = 1.0,
        parameter_drift: float = 0.0,
    ) -> None:  # fmt: skip
        self.unknowns, self.n = unknowns, n
        self.scale, self.lower, self.upper = scale, lower, upper
        self.parameter_drift = parameter_drift
        self.z = unknowns.start.copy()
        self.bias = np.zeros(n)
        self.slack_samples = 0
        self.stopped_by_bounds = 0
        self.P = np.zeros((len(scale) + n, len(scale) + n))
        self.P[: len(scale), : len(scale)] = prior_std**2 * np.eye(len(scale))

    @property
    def covariance(self) -> Array:
        """[U, U] of z."""
        u = len(self.scale)
        return self.P[:u, :u] * np.outer(self.scale, self.scale)

    def run(self, part: Likelihood) -> tuple[Array, Array]:
        """Innovations e and their variances, [N, n]; NaN up to the sample that starts the bias."""
        time = part.trace.time
        e, S = (np.full((len(time), self.n), np.nan) for _ in range(2))
        for k in range(len(time)):
            torque, jump, H, G = self._linearised(part, k)
            if k == part.first:
                self._start_bias(part, k, torque, H)
                continue
            dt = time[k] - time[k - 1] if k > 0 else 0.0
            if k < part.first:
                continue
            self._predict(jump, G, part.drift * dt, dt)
            e[k] = part.y[k] - torque - self.bias
            slack = bool(part.use[k].all()) and bool(part.trace.slack(self.unknowns.theta(self.z), slice(k, k + 1))[0])
            self.slack_samples += slack
            S[k] = self._correct(H, e[k], part.noise[k], apply=bool(part.use[k].all()) and not slack)
        return e, S

    def _linearised(self, part: Likelihood, k: int) -> tuple[Array, Array, Array, Array]:
        """T [n], Δb [n] and their derivatives [n, U] by the scaled unknowns."""
        only = slice(k, k + 1)
        T, db = (each[0, 0].real for each in part.trace.evaluate(self.unknowns.theta(self.z), only))
        H, G = (each[0] * self.scale for each in derivatives(part.trace, self.unknowns, self.z, only))
        return T, db, H, G

    def _start_bias(self, part: Likelihood, k: int, torque: Array, H: Array) -> None:
        """b = y − T − e: what is unknown of T is unknown of b. Or b = initial_torque − e, itself an unknown."""
        u = len(self.scale)
        if part.given_start:
            theta = self.unknowns.theta(self.z)
            paths = [f"bias.initial_torque[{j + 1}]" for j in range(self.n)]
            self.bias = np.array([theta[path] for path in paths])
            slope = np.zeros((self.n, u))
            for j, path in enumerate(paths):
                for at, number in enumerate(self.unknowns.numbers):
                    slope[j, at] = self.scale[at] if self.unknowns.index[path] in number.parameters else 0.0
        else:
            self.bias = part.y[k] - torque
            slope = -H
        Pz = self.P[:u, :u]
        self.P[u:, :u] = slope @ Pz
        self.P[:u, u:] = self.P[u:, :u].T
        self.P[u:, u:] = slope @ Pz @ slope.T + part.initial_variance * np.eye(self.n)

    def _predict(self, jump: Array, G: Array, drift: float, dt: float) -> None:
        u = len(self.scale)
        self.bias = self.bias + jump
        self.P[:u, :u] += self.parameter_drift * dt * np.eye(u)  # the jump is that of the unknowns now
        # F P Fᵀ, F = [[1, 0], [G, 1]]
        self.P[u:] += G @ self.P[:u]
        self.P[:, u:] += self.P[:, :u] @ G.T
        self.P[u:, u:] += drift * np.eye(self.n)

    def _correct(self, H: Array, e: Array, noise: float, apply: bool) -> Array:
        """Variances of the innovation [n]; the state only where the sample is used."""
        u = len(self.scale)
        C = np.hstack([H, np.eye(self.n)])
        S = C @ self.P @ C.T + noise * np.eye(self.n)
        if apply:
            K = np.linalg.solve(S, C @ self.P).T
            kept = self.P - K @ (C @ self.P)  # (1 − K C) P (1 − K C)ᵀ + K noise Kᵀ, never a product of two [U, U]
            self.P = kept - (kept @ C.T) @ K.T + noise * K @ K.T
            step = self._within_bounds(K @ e)
            self.z = np.clip(self.z + self.scale * step[:u], self.lower, self.upper)
            self.bias = self.bias + step[u:]
        return np.diag(S)

    def _within_bounds(self, step: Array) -> Array:
        """Conditioned on each bound that it would cross, one after the other; what three rounds leave is clipped."""
        step, u = step.copy(), len(self.scale)
        for _ in range(3):
            reached = self.z + self.scale * step[:u]
            if ((reached >= self.lower) & (reached <= self.upper)).all():
                break
            for i in range(u):
                wanted = self.z[i] + self.scale[i] * step[i]
                excess = np.clip(wanted, self.lower[i], self.upper[i]) - wanted
                self.stopped_by_bounds += excess != 0.0
                step += excess / self.scale[i] * self.P[:, i] / self.P[i, i]
        return step
