"""The binding of the estimation (runtime/include/tendonfmu_estimation.h), and only it.

Where Eigen was not found when the package was built, there is no estimation: `Estimator` then raises
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

from tendonfmu.errors import InputError

# a module that is there and does not load is a fault to be seen, not a missing one
HAS_ESTIMATION = find_spec("tendonfmu._estimation") is not None
if HAS_ESTIMATION:
    from tendonfmu import _estimation

Numbers = NDArray[np.float64]
Array = NDArray[Any]

ESTIMATION_MISSING = "this installation cannot estimate parameters (Eigen was not found when it was built)"
ROLES = ("coulomb", "drop", "rate", "viscous", "value")

# (samples done, samples) of the recording -> False to stop
LearnerWatch = Callable[[int, int], bool | None]
# (pass, stride, samples done, samples, cost of the best so far, its unknowns) -> False to stop
BatchWatch = Callable[[int, int, int, int, float, Numbers], bool | None]


class EstimationError(ValueError):
    """Refused by the estimation: a structure, a recording, unknowns. Who knows the file makes it an InputError."""


@contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except ValueError as refused:
        raise EstimationError(str(refused)) from None


@dataclass(frozen=True)
class Unknown:
    """What is estimated.

    path: of the first number of the description that it moves; parameters: indices of all of them.
    role: `coulomb` Fc, `drop` Fs - Fc, `rate` 1/vs, `viscous` Fv, or `value`, a number as it is.
    start, lower, upper: value at the start and the box it stays in. scale: expected magnitude.
    """

    path: str
    role: str
    parameters: tuple[int, ...]
    start: float
    lower: float
    upper: float
    scale: float


@dataclass(frozen=True)
class BatchResult:
    """A fit of all recordings at once, of u unknowns.

    z: [u]. cost: ½ Σ e²/S + prior_cost. gradient [u], information [u, u]: of the data's part at z.
    covariance: [u, u] inverse of information and prior; unknowns at a bound count as if they were free.
    steps: of Levenberg and Marquardt; passes: over the data, coarse ones included. stopped: `progress` said so.
    """

    z: Numbers
    cost: float
    prior_cost: float
    gradient: Numbers
    information: Numbers
    covariance: Numbers
    steps: int
    passes: int
    converged: bool
    stopped: bool
    seconds: float


def _matrix(values: Array | None) -> Numbers | None:
    return None if values is None else np.ascontiguousarray(values, dtype=np.float64)


def _samples(arrays: Mapping[str, Array]) -> dict[str, Numbers | None]:
    names = ("time", "tendon_force", "tendon_position", "joint_position", "joint_velocity")
    return {name: _matrix(arrays.get(name)) for name in names}


def _flags(use: Array | None) -> NDArray[np.uint8] | None:
    return None if use is None else np.ascontiguousarray(use, dtype=np.uint8)


def _unknowns(source: Any) -> list[Unknown]:
    found = (source.unknown(k) for k in range(source.unknown_count))
    return [Unknown(path, ROLES[role], tuple(parameters), *numbers) for path, role, parameters, *numbers in found]


class Estimator:
    """A finger, what is unknown of it, and recordings.

    image: of the description (`native.image_from_json`); its numbers are the start and the prior's mean.
    group: [p] by parameter: -1 fixed, others estimated, equal numbers share one value; None: all that is present.
    scale: [p] expected magnitudes in the description's units, NaN or None where the start's is meant.
    """

    def __init__(self, image: bytes, group: Array | None = None, scale: Array | None = None) -> None:
        if not HAS_ESTIMATION:
            raise InputError(ESTIMATION_MISSING)
        groups = None if group is None else np.ascontiguousarray(group, dtype=np.int32)
        with _refusals():
            self._estimator = _estimation.Estimator(image, groups, _matrix(scale))
        self.unknowns = _unknowns(self._estimator)

    @property
    def joints(self) -> int:
        return int(self._estimator.joints)

    @property
    def tendons(self) -> int:
        return int(self._estimator.tendons)

    @property
    def start(self) -> Numbers:
        """[u] unknowns of the description."""
        return np.array([unknown.start for unknown in self.unknowns])

    @property
    def scale(self) -> Numbers:
        """[u] expected magnitudes."""
        return np.array([unknown.scale for unknown in self.unknowns])

    def values(self, z: Array) -> Numbers:
        """[p] numbers of the description for unknowns z within their boxes."""
        with _refusals():
            return np.asarray(self._estimator.values(_matrix(z)))

    def unknown_values(self, parameters: Array) -> Numbers:
        """[u] unknowns of numbers of the description [p]."""
        with _refusals():
            return np.asarray(self._estimator.unknown_values(_matrix(parameters)))

    def add_recording(
        self,
        arrays: Mapping[str, Array],
        kinematics_source: int = 1,
        external_torque: Array | None = None,
        use: Array | None = None,
    ) -> int:
        """Takes over a recording and returns its number, from 0.

        arrays: `time` [N] (s), `tendon_force`, `tendon_position` [N, m], `joint_position`, `joint_velocity` [N, n],
            those that the kinematics source needs.
        external_torque: [N, n] known load, N.m. use: [N] bool, where to learn.
        """
        with _refusals():
            return int(
                self._estimator.add_recording(
                    **_samples(arrays),
                    kinematics_source=kinematics_source,
                    external_torque=_matrix(external_torque),
                    use=_flags(use),
                )
            )

    def set_weights(self, recording: int, weight: Array) -> None:
        """Lets each sample of a recording count as a part of one in `evaluate` and `fit`.

        weight: [n] by joint, above 0 and at most 1; 1 until set.
        """
        with _refusals():
            self._estimator.set_weights(recording, np.ascontiguousarray(weight, dtype=np.float64))

    def set_known(self, information: Array) -> None:
        """What an earlier fit knows, which `fit` adds to its prior.

        information: [u, u] of the unknowns about the description's numbers, symmetric, positive semidefinite.
        """
        with _refusals():
            self._estimator.set_known(np.ascontiguousarray(information, dtype=np.float64))

    def evaluate(self, z: Array, stride: int = 1, threads: int = 0) -> tuple[float, Numbers, Numbers]:
        """Cost ½ Σ w e²/S of the data at z, gradient [u], information [u, u]; without prior.

        stride: only every stride-th sample is looked at, each for `stride`.
        threads: 0 for all cores; any number gives the same result.
        """
        with _refusals():
            cost, gradient, information = self._estimator.evaluate(_matrix(z), stride, threads)
        return float(cost), np.asarray(gradient), np.asarray(information)

    def jacobian(self, recording: int, z: Array, start: int, stop: int) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """T of eq. (10) and the jumps Δb of fig. 5 [N, n] at samples start..stop-1, and their derivatives [N, n, u]."""
        with _refusals():
            found = self._estimator.jacobian(recording, _matrix(z), start, max(stop - start, 0))
        torque, jump, by_torque, by_jump = (np.asarray(array) for array in found)
        return torque, jump, by_torque, by_jump

    def innovations(self, recording: int, z: Array) -> tuple[Numbers, Numbers, Numbers]:
        """Residuals before the bias update [N, n] (N.m), their variance [N], and the bias after it [N, n].

        NaN where the bias has not started; the variance is NaN, too, at samples that are not used.
        """
        with _refusals():
            found = self._estimator.innovations(recording, _matrix(z))
        innovation, variance, bias = (np.asarray(array) for array in found)
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
        """Maximum likelihood under a Gaussian prior of prior_std · scale about the description's numbers.

        start: [u], None: the description's.
        tolerance: it ends with a step this long in standard errors, all unknowns together.
        stride: of the first, coarse passes; 0: by the number of samples.
        progress: called now and then, returns False to stop.
        """
        begun = perf_counter()
        first = self.start if start is None else start
        with _refusals():
            found = self._estimator.fit(_matrix(first), prior_std, tolerance, max_passes, stride, threads, progress)
        return BatchResult(**found, seconds=perf_counter() - begun)


class Learner:
    """The paper's extended Kalman filter over recordings, one after another.

    image, group, scale: as for `Estimator`. prior_std: standard deviation of an unknown about its start, in scales.
    block: samples that are taken in at once, 1..64 (tendonfmu_learner.h says what it costs).
    parameter_drift: variance that an unknown gains per second, in scales²; 0 for constants.
    """

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
        groups = None if group is None else np.ascontiguousarray(group, dtype=np.int32)
        with _refusals():
            self._learner = _estimation.Learner(image, groups, _matrix(scale), prior_std, block, parameter_drift)
        self.unknowns = _unknowns(self._learner)

    @property
    def z(self) -> Numbers:
        """[u] the unknowns as they are known now."""
        return np.asarray(self._learner.z())

    @property
    def covariance(self) -> Numbers:
        """[u, u] of z."""
        return np.asarray(self._learner.covariance())

    @property
    def bias(self) -> Numbers:
        """[n] at the last sample, N.m."""
        with _refusals():
            return np.asarray(self._learner.bias()[0])

    @property
    def slack_samples(self) -> int:
        """Samples left out because the model found a tendon slack; since the pass began."""
        return int(self._learner.slack_samples)

    def values(self) -> Numbers:
        """[p] numbers of the description."""
        return np.asarray(self._learner.values()[0])

    def standard_errors(self) -> Numbers:
        """[p] of `values`; 0 where fixed."""
        return np.asarray(self._learner.values()[1])

    def begin_pass(self) -> None:
        """Back to the start and the prior; the recordings that follow are linearised at what has been found so far."""
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
        """Learns from a recording; arguments as for `Estimator.add_recording`. The bias begins anew.

        progress: called now and then, returns False to stop.
        Returns `innovation` [N, n] (N.m), the residuals before each sample itself is taken in, and their
        `innovation_variance` [N, n]: NaN where the bias has not started, and after a stop.
        """
        with _refusals():
            innovation, variance, _ = self._learner.run(
                **_samples(arrays),
                kinematics_source=kinematics_source,
                external_torque=_matrix(external_torque),
                use=_flags(use),
                watch=progress,
            )
        return {"innovation": np.asarray(innovation), "innovation_variance": np.asarray(variance)}
