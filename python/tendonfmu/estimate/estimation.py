"""The Python binding of the estimation (runtime/include/tendonfmu_estimation.hpp).

If Eigen was not found when the package was built, there is no estimation: `Estimator` and `Learner` then raise
`InputError(ESTIMATION_MISSING)`, and everything else works.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array, Numbers
from tendonfmu.errors import InputError

# find_spec, not try/except: a module that exists but does not load must raise its error
HAS_ESTIMATION = find_spec("tendonfmu._estimation") is not None
if HAS_ESTIMATION:
    from tendonfmu import _estimation


ESTIMATION_MISSING = "this installation cannot estimate parameters (Eigen was not found when it was built)"
ROLES = ("coulomb", "drop", "rate", "viscous", "value")

# (samples done, samples in the recording) -> False to stop
LearnerWatch = Callable[[int, int], bool | None]
# (pass, stride, samples done, samples, cost of the best so far, its unknowns) -> False to stop
BatchWatch = Callable[[int, int, int, int, float, Numbers], bool | None]


class EstimationError(ValueError):
    """The estimation refuses a structure, a recording or unknowns."""


@contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except ValueError as refused:
        raise EstimationError(str(refused)) from None


@dataclass(frozen=True)
class Unknown:
    """One unknown of the estimation."""

    path: str  # first number of the description that it moves
    role: str  # "coulomb" (Fc), "drop" (Fs − Fc), "rate" (1/vs), "viscous" (Fv), or "value", a number as it is
    parameters: tuple[int, ...]  # indices of all numbers that it moves
    start: float  # value at the start, and the bounds that it stays within
    lower: float
    upper: float
    scale: float  # expected magnitude

    @property
    def name(self) -> str:
        """Its path in the fit's own form: the last part says its role."""
        return self.path if self.role == "value" else f"{self.path.rsplit('.', 1)[0]}.{self.role}"


@dataclass(frozen=True)
class BatchResult:
    """A fit of all recordings at once, with u unknowns."""

    z: Numbers  # [u] estimate
    cost: float  # ½ Σ e²/S + prior_cost
    prior_cost: float  # part of the cost that is due to the prior
    gradient: Numbers  # [u], [u, u] of the data's part of the cost at z
    information: Numbers
    # [u, u] inverse of the sum of information and prior; unknowns at a bound count as if they were free
    covariance: Numbers
    steps: int  # steps of Levenberg and Marquardt
    passes: int  # passes over the data, coarse ones included
    converged: bool  # whether the last step was short enough
    stopped: bool  # whether `progress` stopped the fit
    seconds: float  # time of the computation (s)


def _whole(values: Array | None, kind: Any) -> NDArray[Any] | None:
    return None if values is None else np.ascontiguousarray(values, dtype=kind)


def _matrix(values: Array | None) -> Numbers | None:
    return _whole(values, np.float64)


def _samples(arrays: Mapping[str, Array]) -> dict[str, Numbers | None]:
    names = ("time", "tendon_force", "tendon_position", "joint_position", "joint_velocity")
    return {name: _matrix(arrays.get(name)) for name in names}


def _unknowns(source: Any) -> list[Unknown]:
    rows = (source.unknown(k) for k in range(source.unknown_count))
    return [Unknown(path, ROLES[role], tuple(parameters), *numbers) for path, role, parameters, *numbers in rows]


class Estimator:
    """A finger, its unknown numbers, and recordings."""

    def __init__(self, image: bytes, group: Array | None = None, scale: Array | None = None) -> None:
        if not HAS_ESTIMATION:
            raise InputError(ESTIMATION_MISSING)
        with _refusals():
            self._estimator = _estimation.Estimator(image, _whole(group, np.int32), _matrix(scale))
        self.unknowns = _unknowns(self._estimator)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self._estimator.joints)

    @property
    def start(self) -> Numbers:
        """[u] unknowns of the description."""
        return np.array([unknown.start for unknown in self.unknowns])

    @property
    def scale(self) -> Numbers:
        """[u] expected magnitudes."""
        return np.array([unknown.scale for unknown in self.unknowns])

    def values(self, z: Array) -> Numbers:
        """Convert unknowns [u] within their bounds into the numbers of the description [p]."""
        with _refusals():
            return np.asarray(self._estimator.values(_matrix(z)))

    def unknown_values(self, parameters: Array) -> Numbers:
        """Convert numbers of the description [p] into unknowns [u]."""
        with _refusals():
            return np.asarray(self._estimator.unknown_values(_matrix(parameters)))

    def add_recording(
        self,
        arrays: Mapping[str, Array],
        kinematics_source: int = 1,
        external_torque: Array | None = None,
        use: Array | None = None,
        silent: Array | None = None,
    ) -> int:
        """Copy a recording into the estimator and return its number."""
        # arrays: [N] (s); external_torque: [N, n] (N·m); use: [N]; silent: [N, n] joints that say nothing
        with _refusals():
            return int(
                self._estimator.add_recording(
                    **_samples(arrays),
                    kinematics_source=kinematics_source,
                    external_torque=_matrix(external_torque),
                    use=_whole(use, np.uint8),
                    silent=_whole(silent, np.uint8),
                )
            )

    def set_weights(self, recording: int, weight: Array) -> None:
        """Let each sample of a recording count as a part of a sample, by joint [n], in `evaluate` and `fit`."""
        with _refusals():
            self._estimator.set_weights(recording, np.ascontiguousarray(weight, dtype=np.float64))

    def set_known(self, information: Array) -> None:
        """Set the information [u, u] of an earlier fit, which `fit` adds to its prior."""
        with _refusals():
            self._estimator.set_known(np.ascontiguousarray(information, dtype=np.float64))

    def evaluate(self, z: Array, stride: int = 1, threads: int = 0) -> tuple[float, Numbers, Numbers]:
        """Compute cost, gradient [u] and Fisher information [u, u] of the data at z [u], without the prior."""
        with _refusals():
            cost, gradient, information = self._estimator.evaluate(_matrix(z), stride, threads)
        return float(cost), np.asarray(gradient), np.asarray(information)

    def jacobian(
        self, recording: int, z: Array, start: int, stop: int, length: int = 1
    ) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """Compute the friction torque, the bias jumps and their derivatives, as means over `length` samples.

        Friction with a memory is taken to hold a constant share of its limit; numbers of extensions have derivatives 0.
        """
        # z: [u]; returns [K, n] T of eq. (10) and the jumps Δb of fig. 5 (N·m), [K, n, u] their derivatives by the
        # unknowns
        with _refusals():
            arrays = self._estimator.jacobian(recording, _matrix(z), start, max(stop - start, 0) // length, length)
        torque, jump, by_torque, by_jump = (np.asarray(array) for array in arrays)
        return torque, jump, by_torque, by_jump

    def innovations(self, recording: int, z: Array) -> tuple[Numbers, Numbers, Numbers]:
        """Compute the residuals of a recording before each bias update."""
        # z: [u]; returns, all [N, n], residuals (N·m), their variance ((N·m)²), NaN also where nothing is learned, and
        # the bias after the update (N·m)
        with _refusals():
            arrays = self._estimator.innovations(recording, _matrix(z))
        innovation, variance, bias = (np.asarray(array) for array in arrays)
        return innovation, variance, bias

    def fit(
        self,
        start: Array | None = None,
        *,
        prior_std: float = 1.0,
        max_passes: int = 60,
        tolerance: float = 0.3,
        threads: int = 0,
        stride: int = 0,
        progress: BatchWatch | None = None,
    ) -> BatchResult:
        """Maximise the likelihood under a Gaussian prior about the numbers of the description, from a start [u]."""
        begun = perf_counter()
        first = self.start if start is None else start
        with _refusals():
            result = self._estimator.fit(_matrix(first), prior_std, tolerance, max_passes, stride, threads, progress)
        return BatchResult(**result, seconds=perf_counter() - begun)


class Learner:
    """The extended Kalman filter of the paper over recordings, one after another."""

    def __init__(
        self,
        image: bytes,
        group: Array | None = None,
        scale: Array | None = None,
        *,
        prior_std: float = 1.0,
        block: int = 8,
        parameter_drift: float = 0.0,
    ) -> None:
        if not HAS_ESTIMATION:
            raise InputError(ESTIMATION_MISSING)
        with _refusals():
            self._learner = _estimation.Learner(
                image, _whole(group, np.int32), _matrix(scale), prior_std, block, parameter_drift
            )
        self.unknowns = _unknowns(self._learner)

    @property
    def z(self) -> Numbers:
        """[u] present estimate of the unknowns."""
        return np.asarray(self._learner.unknown_values()[0])

    @property
    def covariance(self) -> Numbers:
        """[u, u] covariance of z."""
        return np.asarray(self._learner.unknown_values()[1])

    @property
    def bias(self) -> Numbers:
        """[n] bias at the last sample (N·m)."""
        with _refusals():
            return np.asarray(self._learner.bias()[0])

    @property
    def slack_samples(self) -> int:
        """Number of samples skipped in this pass because the model found a tendon slack."""
        return int(self._learner.slack_samples)

    def values(self) -> Numbers:
        """Return [p] the numbers of the description."""
        return np.asarray(self._learner.values()[0])

    def standard_errors(self) -> Numbers:
        """Return [p] the standard errors of `values`; 0 where fixed."""
        return np.asarray(self._learner.values()[1])

    def begin_pass(self) -> None:
        """Return to the start and the prior, but linearise the next recordings at the present estimate."""
        with _refusals():
            self._learner.begin_pass()

    def run(
        self,
        arrays: Mapping[str, Array],
        kinematics_source: int = 1,
        external_torque: Array | None = None,
        use: Array | None = None,
        progress: LearnerWatch | None = None,
    ) -> dict[str, Numbers]:
        """Learn from a recording; the bias starts anew."""
        with _refusals():
            innovation, variance, _ = self._learner.run(
                **_samples(arrays),
                kinematics_source=kinematics_source,
                external_torque=_matrix(external_torque),
                use=_whole(use, np.uint8),
                watch=progress,
            )
        return {"innovation": np.asarray(innovation), "innovation_variance": np.asarray(variance)}
