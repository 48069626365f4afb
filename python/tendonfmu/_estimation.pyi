"""The compiled module (python/binding/estimation.cpp)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

class EstimationError(ValueError):
    """The estimation refuses a structure, a recording or unknowns."""

class Unknown:
    """One unknown of the estimation."""

    path: str  # first number of the description that it moves
    role: str  # "coulomb" (Fc), "drop" (Fs − Fc), "rate" (1/vs), "viscous" (Fv), or "value", a number as it is
    parameters: tuple[int, ...]  # indices of all numbers that it moves
    start: float  # value at the start, and the bounds that it stays within
    lower: float
    upper: float
    scale: float  # expected magnitude
    name: str  # its path in the fit's own form: the last part says its role

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

class Estimator:
    """A finger, its unknown numbers, and recordings."""

    def __init__(self, image: bytes, group: NDArray[Any] | None = None, scale: Numbers | None = None) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def unknowns(self) -> list[Unknown]: ...
    @property
    def start(self) -> Numbers:
        """[u] unknowns of the description."""

    @property
    def scale(self) -> Numbers:
        """[u] expected magnitudes."""

    def values(self, z: Numbers) -> Numbers:
        """Convert unknowns [u] within their bounds into the numbers of the description [p]."""

    def unknown_values(self, values: Numbers) -> Numbers:
        """Convert numbers of the description [p] into unknowns [u]."""

    def add_recording(
        self,
        arrays: Mapping[str, NDArray[Any]],
        kinematics_source: int = 1,
        external_torque: Numbers | None = None,
        use: NDArray[Any] | None = None,
        silent: NDArray[Any] | None = None,
    ) -> int:
        """Copy a recording into the estimator and return its number.

        arrays: [N] (s); external_torque: [N, n] (N·m); use: [N]; silent: [N, n] joints that say nothing.
        """

    def set_weights(self, recording: int, weight: Numbers) -> None:
        """Let each sample of a recording count as a part of a sample, by joint [n], in `evaluate` and `fit`."""

    def set_known(self, information: Numbers) -> None:
        """Set the information [u, u] of an earlier fit, which `fit` adds to its prior."""

    def evaluate(self, z: Numbers, stride: int = 1, threads: int = 0) -> tuple[float, Numbers, Numbers]:
        """Compute cost, gradient [u] and Fisher information [u, u] of the data at z [u], without the prior."""

    def jacobian(
        self, recording: int, z: Numbers, start: int, stop: int, length: int = 1
    ) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """Compute T of eq. (10) and the jumps Δb of fig. 5 [K, n] (N·m), and their derivatives by z [K, n, u].

        All are means over `length` samples. Friction with a memory is taken to hold a constant share of its limit;
        numbers of extensions have derivatives 0.
        """

    def innovations(self, recording: int, z: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Compute the residuals of a recording before each bias update (N·m), their variance, and the bias after it.

        All [N, n]; the variance is NaN also where nothing is learned.
        """

    def fit(
        self,
        start: Numbers | None = None,
        *,
        prior_std: float = 1.0,
        max_passes: int = 60,
        tolerance: float = 0.3,
        threads: int = 0,
        stride: int = 0,
        progress: Callable[..., bool | None] | None = None,
    ) -> BatchResult:
        """Maximise the likelihood under a Gaussian prior about the numbers of the description, from a start [u].

        progress(pass, stride, samples done, samples, cost of the best so far, its unknowns) -> False to stop.
        """

class Learner:
    """The extended Kalman filter of the paper over recordings, one after another."""

    def __init__(
        self,
        image: bytes,
        group: NDArray[Any] | None = None,
        scale: Numbers | None = None,
        prior_std: float = 1.0,
        block: int = 8,
        parameter_drift: float = 0.0,
    ) -> None: ...
    @property
    def unknowns(self) -> list[Unknown]: ...
    @property
    def z(self) -> Numbers:
        """[u] present estimate of the unknowns."""

    @property
    def covariance(self) -> Numbers:
        """[u, u] covariance of z."""

    @property
    def bias(self) -> Numbers:
        """[n] bias at the last sample (N·m)."""

    @property
    def slack_samples(self) -> int:
        """Number of samples skipped in this pass because the model found a tendon slack."""

    def values(self) -> Numbers:
        """Return [p] the numbers of the description."""

    def standard_errors(self) -> Numbers:
        """Return [p] the standard errors of `values`; 0 where fixed."""

    def begin_pass(self) -> None:
        """Return to the start and the prior, but linearise the next recordings at the present estimate."""

    def run(
        self,
        arrays: Mapping[str, NDArray[Any]],
        kinematics_source: int = 1,
        external_torque: Numbers | None = None,
        use: NDArray[Any] | None = None,
        progress: Callable[[int, int], bool | None] | None = None,
    ) -> dict[str, Numbers]:
        """Learn from a recording; the bias starts anew. progress(samples done, samples) -> False to stop."""
