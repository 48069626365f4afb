"""Naive twin of the estimation: unknowns, exact derivatives and the likelihood by a dense covariance.

Written from the design alone. The bias is never filtered here: y − T − Σ Δb of one joint is one normal vector whose
covariance (random walk + noise + what the first sample leaves open) is written out in full and factorised by Cholesky.
Its whitened entries are what a Kalman filter calls innovations over their standard deviation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import given
from oracle_trace import Trace

Array = NDArray[Any]
H = 1e-20  # complex step, in units of an unknown's size: no cancellation, so no need to balance it


@dataclass
class Number:
    """One unknown: its role, the indices of the parameters that it moves, its start."""

    role: str
    parameters: tuple[int, ...]
    start: float


def family(path: str) -> tuple[str, str]:
    """The side of a law (or the table) that a parameter belongs to, and its own name ("number" of an extension's)."""
    before, _, name = path.rpartition(".")
    return before, "number" if before.startswith("extensions[") else name


class Unknowns:
    """z <-> numbers of the description; one unknown per group, in the order of the group numbers.

    paths, values: [p] all parameters. group: [p] −1 fixed; equal numbers share one value.
    """

    def __init__(self, paths: Sequence[str], values: Array, group: Sequence[int]) -> None:
        self.paths, self.values, self.group = list(paths), np.array(values, dtype=float), list(group)
        self.index = {path: k for k, path in enumerate(self.paths)}
        self.numbers = [self._number(g) for g in sorted(set(self.group) - {-1})]
        self.start = np.array([number.start for number in self.numbers])

    def in_order_of(self, others: Sequence[Any]) -> Unknowns:
        """The same unknowns in the order of another list of them, told by the parameters they move."""
        found = []
        for other in others:
            same = [number for number in self.numbers if set(number.parameters) & set(other.parameters)]
            if len(same) != 1:
                raise AssertionError(f"{other}: {len(same)} unknowns of the twin move any of its parameters")
            found += same
        if len(found) != len(self.numbers) or len({number.parameters for number in found}) != len(found):
            raise AssertionError(f"{len(found)} unknowns where the twin has {len(self.numbers)}")
        self.numbers = found
        self.start = np.array([number.start for number in found])
        return self

    def _partner(self, k: int, name: str) -> int:
        return self.index[f"{family(self.paths[k])[0]}.{name}"]

    def _static_follows(self, k: int) -> bool:
        """Whether a static friction is its law's Coulomb friction, moving along with it."""
        coulomb = self._partner(k, "coulomb")
        if self.group[k] >= 0:
            return self.group[k] == self.group[coulomb]
        return bool(self.values[k] == self.values[coulomb])

    def _number(self, g: int) -> Number:
        """The unknown of one group; it starts at the mean of what it moves."""
        members = [k for k in range(len(self.paths)) if self.group[k] == g]
        names = {family(self.paths[k])[1] for k in members}
        if "coulomb" in names:
            laws = [k for k in members if family(self.paths[k])[1] == "coulomb"]
            statics = [self._partner(k, "static") for k in laws]
            moved = laws + [k for k in statics if self._static_follows(k)]
            return Number("coulomb", tuple(sorted(moved)), float(np.mean(self.values[laws])))
        if names == {"static"}:
            drops = [self.values[k] - self.values[self._partner(k, "coulomb")] for k in members]
            return Number("drop", tuple(members), float(np.mean(drops)))
        if names == {"stribeck_velocity"}:
            return Number("rate", tuple(members), float(np.mean(1.0 / self.values[members])))
        role = "viscous" if names == {"viscous"} else "value"
        return Number(role, tuple(members), float(np.mean(self.values[members])))

    def parameters(self, z: Array) -> Array:
        """[..., p] numbers of the description at z [..., U]; may be complex."""
        z = np.asarray(z)
        theta = np.array(np.broadcast_to(self.values, (*z.shape[:-1], len(self.paths))), dtype=z.dtype)
        moved = dict(zip(self.numbers_by_role(), z.T, strict=True))
        for role in ("coulomb", "drop", "rate", "viscous", "value"):
            for (at, own), value in moved.items():
                if own != role:
                    continue
                for k in self.numbers[at].parameters:
                    if role == "drop":
                        theta[..., k] = theta[..., self._partner(k, "coulomb")] + value.T
                    else:
                        theta[..., k] = 1.0 / value.T if role == "rate" else value.T
        return theta

    def numbers_by_role(self) -> list[tuple[int, str]]:
        return [(at, number.role) for at, number in enumerate(self.numbers)]

    def z(self, parameters: Array) -> Array:
        """[U] the unknowns of given numbers."""
        return Unknowns(self.paths, parameters, self.group).in_order_of(self.numbers).start

    def theta(self, z: Array) -> dict[str, Any]:
        """path -> number at z [U], or path -> [U', 1] numbers at z [U', U]."""
        columns = self.parameters(z)
        if columns.ndim == 1:
            return dict(zip(self.paths, columns, strict=True))
        return {path: columns[:, k : k + 1] for k, path in enumerate(self.paths)}

    def moved(self, z: Array) -> dict[str, float]:
        """path -> number of all parameters that the unknowns move, at z [U]."""
        numbers = self.parameters(z)
        statics = [k for k in range(len(self.paths)) if family(self.paths[k])[1] == "static"]
        moving = {k for number in self.numbers for k in number.parameters}
        moving |= {k for k in statics if self._partner(k, "coulomb") in moving}
        return {self.paths[k]: float(numbers[k]) for k in sorted(moving)}

    def steps(self, z: Array) -> Array:
        """[U] size of each unknown's complex step."""
        return H * np.where(np.abs(z) > 0.0, np.abs(z), 1.0)


def derivatives(trace: Trace, unknowns: Unknowns, z: Array, samples: slice = slice(None)) -> tuple[Array, Array]:
    """Exact ∂T/∂z and ∂Δb/∂z, [N, n, U]."""
    step = unknowns.steps(z)
    T, db = trace.evaluate(unknowns.theta(z + 1j * np.diag(step)), samples)
    scale = step[:, None, None]
    return tuple(np.moveaxis(np.broadcast_to(each.imag, (len(z), *each.shape[1:])) / scale, 0, -1) for each in (T, db))  # type: ignore[return-value]


class Likelihood:
    """One recording's part of the cost: whitened residual and Jacobian per joint, dense.

    external_torque: [N, n] N·m known load. use: [N] bool, false where a sample is left out. The first used sample
    starts the bias; with bias.initial_torque the recording's first sample does, used or not.
    """

    def __init__(
        self,
        description: Mapping[str, Any],
        unknowns: Unknowns,
        recording: Mapping[str, Array],
        kinematics_source: int = 1,
        external_torque: Array | None = None,
        use: Array | None = None,
        silent: Array | None = None,
    ) -> None:
        self.trace = Trace(description, recording, kinematics_source)
        self.unknowns = unknowns
        self.y = self.trace.tau - (0.0 if external_torque is None else np.asarray(external_torque))
        self.use = np.ones(self.y.shape, dtype=bool) if silent is None else ~np.asarray(silent, dtype=bool)
        self.use &= True if use is None else np.asarray(use, dtype=bool)[:, None]
        bias = given(description, "bias", {})
        self.given_start = given(bias, "initial_torque", None) is not None
        self.first = 0 if self.given_start else int(np.argmax(self.use.all(axis=1)))
        self.drift = float(given(bias, "drift_variance", 1e-6))
        mean_force = np.abs(self.trace.force).mean(axis=1)
        plain = (
            float(given(bias, "noise_std", 0.01)) + float(given(bias, "noise_std_per_force", 0.0)) * mean_force
        ) ** 2
        initial = given(bias, "initial_variance", None)
        self.initial_variance = plain[self.first] if initial is None else float(initial)
        self.noise = plain
        if given(bias, "noise_time", None) is not None:
            self.noise = plain * float(bias["noise_time"]) / np.diff(self.trace.time, prepend=np.nan)

    def rows(self, joint: int = 0) -> Array:
        """Indices of a joint's samples in the likelihood: used, and after the one that starts the bias."""
        return np.flatnonzero(self.use[:, joint] & (np.arange(len(self.use)) > self.first))

    def covariance(self, rows: Array) -> Array:
        """[K, K] of y − T − Σ Δb − b_first at given samples."""
        since = self.trace.time[rows] - self.trace.time[self.first]
        return self.initial_variance + self.drift * np.minimum.outer(since, since) + np.diag(self.noise[rows])

    def residual(self, z: Array) -> tuple[Array, Array]:
        """y − T − Σ Δb − b_first [N, n] and its derivative [N, n, U], all samples."""
        T, db = (each[0].real for each in self.trace.evaluate(self.unknowns.theta(z)))
        dT, d_db = derivatives(self.trace, self.unknowns, z)
        d = T + np.cumsum(db, axis=0)
        slope = dT + np.cumsum(d_db, axis=0)
        if not self.given_start:
            left = self.y - d
            return left - left[self.first], slope[self.first] - slope
        left = self.y - d + db[0]
        slope = d_db[0] - slope
        for j in range(self.trace.n):
            path = f"bias.initial_torque[{j + 1}]"
            left[:, j] -= self.unknowns.theta(z)[path]
            for u, number in enumerate(self.unknowns.numbers):
                slope[:, j, u] -= 1.0 if self.unknowns.index[path] in number.parameters else 0.0
        return left, slope

    def whitened(self, z: Array) -> tuple[Array, Array]:
        """[K] residual and [K, U] Jacobian in units of their standard deviation, over the samples of all joints."""
        left, slope = self.residual(z)
        residual, jacobian = [], []
        for j in range(self.trace.n):
            rows = self.rows(j)
            factor = np.linalg.cholesky(self.covariance(rows))
            residual.append(np.linalg.solve(factor, left[rows, j]))
            jacobian.append(np.linalg.solve(factor, slope[rows, j]))
        return np.concatenate(residual), np.concatenate(jacobian)

    def innovations(self, z: Array) -> tuple[Array, Array]:
        """e [N, n] and S [N, n] by conditioning each sample on the used ones before it; NaN up to the first."""
        left = self.residual(z)[0]
        e, S = np.full_like(left, np.nan), np.full_like(left, np.nan)
        for j in range(self.trace.n):
            rows = self.rows(j)
            for k in range(self.first + 1, len(left)):
                seen = rows[rows < k]
                full = self.covariance(np.append(seen, k))
                weights = np.linalg.solve(full[:-1, :-1], full[:-1, -1]) if len(seen) else np.zeros(0)
                e[k, j] = left[k, j] - weights @ left[seen, j]
                S[k, j] = full[-1, -1] - weights @ full[:-1, -1]
        return e, S


def evaluate(parts: Sequence[Likelihood], z: Array) -> tuple[float, Array, Array]:
    """Cost, gradient [U] and information [U, U] of several recordings, without a prior."""
    pieces = [part.whitened(z) for part in parts]
    residual = np.concatenate([piece[0] for piece in pieces])
    jacobian = np.concatenate([piece[1] for piece in pieces])
    return 0.5 * float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian


def free_groups(paths: Sequence[str], values: Array) -> list[int]:
    """[p] every number that is present is estimated on its own (what is absent stays absent)."""
    number = dict(zip(paths, values, strict=True))
    group, used = [], 0
    for path in paths:
        before, name = family(path)
        drop = number.get(f"{before}.static", 0.0) - number.get(f"{before}.coulomb", 0.0)
        present = {
            "static": drop > 0.0,
            "coulomb": number[path] > 0.0,
            "stribeck_velocity": drop > 0.0,
            "viscous": number[path] > 0.0,
            "stiffness": not before.startswith("tendons") and number[path] != 0.0,
            "number": True,
        }.get(name, path.startswith("bias.initial_torque"))
        group.append(used if present else -1)
        used += present
    return group
