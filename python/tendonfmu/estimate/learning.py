"""What every method of a fit takes and returns: settings, progress, an interruption, and what was learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.files import PreviousFit
from tendonfmu.estimate.memory_fit import MemoryProblem, Minimum
from tendonfmu.model import number_of
from tendonfmu.options import FitOptions, Number, option
from tendonfmu.recordings import FitRecording


@dataclass(frozen=True)
class FrictionFitOptions(FitOptions):
    """Options of `FrictionFit`."""

    threads: int = option(0, Number(0, whole=True), "of a batch; 0: all cores")


@dataclass(frozen=True)
class Settings:
    """How a fit is made."""

    options: FrictionFitOptions
    passes: int  # most passes over the data
    effective: bool = True  # whether samples count for their share of an effective number
    previous: PreviousFit | None = None  # previous fit that the start of the structure comes from, or None
    noise: float = 0.0  # torque noise of the description (N·m)
    torque: float = 0.0  # rms of the torque to explain (N·m)
    near: bool = False  # whether the start is near the minimum: then a memory needs no other starts


@dataclass(frozen=True)
class FitProgress:
    """Progress of a fit."""

    phase: str  # phase in words
    iteration: int  # number of the pass
    done: int  # samples of this phase
    total: int
    cost: float  # cost so far; NaN if unknown


@dataclass(frozen=True)
class MemoryEvidence:
    """The least squares that a fit of friction with a memory ended with."""

    problem: MemoryProblem
    minimum: Minimum


@dataclass(frozen=True)
class Learned:
    """A finished estimation."""

    estimator: Estimator  # unknowns, and their conversion into numbers of the description
    z: Numbers  # [u] estimate
    covariance: Numbers  # [u, u] of z, prior included
    prior: Numbers  # [u, u] covariance of what was known before
    information: Numbers  # [u, u] of the data alone
    cost: float  # negative log likelihood with the prior; NaN for the filter
    iterations: int  # number of steps, and of passes over the data
    passes: int
    converged: bool  # whether the method converged
    weights: list[Numbers]  # by recording, [N, n] the weight of each sample
    innovations: list[Numbers]  # by recording, [N, n] standardised innovations, if the method computes them; else empty
    warnings: list[str]  # sentences
    memory: MemoryEvidence | None = None  # if friction remembers: then the estimator has no derivatives


class Interrupted(Exception):
    """The estimation was stopped."""

    def __init__(self, estimator: Estimator, z: Numbers, cost: float, by_user: bool) -> None:
        super().__init__("stopped")
        self.estimator, self.z, self.cost, self.by_user = estimator, z, cost, by_user


class Watch:
    """Passes progress on, and records a wish to stop, such as a Ctrl-C while the library computes."""

    def __init__(self, progress: Callable[[FitProgress], bool | None] | None) -> None:
        self._progress = progress
        self.stopped, self.by_user = False, False

    def __call__(self, progress: FitProgress) -> bool:
        """Report progress; return whether to continue."""
        try:
            answer = self._progress(progress) if self._progress is not None else None
        except KeyboardInterrupt:
            self.by_user = True
            answer = False
        self.stopped = self.stopped or answer is False
        return not self.stopped


def unknown_names(estimator: Estimator) -> list[str]:
    """Name the unknowns of an estimator."""
    return [unknown.name for unknown in estimator.unknowns]  # [u]


def settings_of(data: Data, recordings: Sequence[FitRecording], threads: int = 0, passes: int = 60) -> Settings:
    """Return the usual settings of a fit to recordings."""
    torque = float(np.sqrt(np.mean(np.concatenate([each.target[each.train].ravel() for each in recordings]) ** 2)))
    noise = number_of(data, "bias.noise_std")
    return Settings(FrictionFitOptions(threads=threads), passes=passes, noise=noise, torque=torque)
