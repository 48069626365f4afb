"""What every method of a fit takes and returns: settings, progress, an interruption, and what was learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.files import PreviousFit
from tendonfmu.estimate.memory_fit import MemoryProblem, Minimum
from tendonfmu.estimate.structure import Structure, with_values
from tendonfmu.model import Finger, number_of
from tendonfmu.options import FitOptions, option
from tendonfmu.recordings import FitRecording


@dataclass(frozen=True)
class FrictionFitOptions(FitOptions):
    """Options of `FrictionFit`."""

    threads: int = option(0, "of a batch; 0: all cores", None, 0)


@dataclass(frozen=True)
class Settings:
    """How a fit is made."""

    options: FrictionFitOptions
    passes: int  # most passes over the data
    previous: PreviousFit | None = None  # previous fit that the start of the structure comes from, or None
    noise: float = 0.0  # torque noise of the description (N·m)
    torque: float = 0.0  # rms of the torque to explain (N·m)
    begin: Finger | None = None  # where to begin, if not at the start of the structure, which is the prior's mean
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
    # by recording, [N, n] standardised innovations, if the method computes them; else empty
    innovations: list[Numbers] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)  # sentences
    memory: MemoryEvidence | None = None  # if friction remembers: then the estimator has no derivatives

    def fitted(self, structure: Structure) -> Finger:
        """Return the finger with the estimate."""
        return with_values(structure, self.estimator.values(self.z))


class Interrupted(Exception):
    """The estimation was stopped."""

    def __init__(self, estimator: Estimator, z: Numbers, by_user: bool) -> None:
        super().__init__("stopped")
        self.estimator, self.z, self.by_user = estimator, z, by_user


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


# --- what is known before the data ------------------------------------------------------------------------------------
# The prior is a Gaussian about the given numbers with covariance C + (s · size)²: C is that of an earlier fit, if any,
# and s, by how much the numbers are off, is the one under which the data are most likely (`most_likely`). So numbers
# that the data do not contradict stay. What is reported as known does not rest on s: it counts numbers as known to
# within C and CHANGE if they were estimated before, else to within their size.


_LEAST = 1e-3  # of an unknown's expected magnitude: lets an unknown that ended at 0 in a previous fit leave it
CHANGE = 0.02  # of a number that was estimated before: what wear, temperature and another instrument may have changed
GUESS = 1.0  # of a number that nobody has estimated
_SPREADS = np.geomspace(1e-3, GUESS, 31)
CLEARLY = 2.0  # by which the log likelihood must rise before numbers leave where they were (Edwards 1972: support)


@dataclass(frozen=True)
class Prior:
    """What is known of the unknowns before the data: a Gaussian about the estimator's start."""

    covariance: Numbers  # [u, u] C of an earlier fit; 0 where nothing is known
    size: Numbers  # [u] expected magnitude
    estimated: Flags  # [u] whether an earlier fit has estimated it

    @classmethod
    def of(cls, estimator: Estimator, settings: Settings) -> Prior:
        start, scale, names = estimator.start, estimator.scale, unknown_names(estimator)
        covariance, estimated = np.zeros((len(names),) * 2), np.zeros(len(names), dtype=bool)
        is_bias = np.array([name.startswith("bias.") for name in names], dtype=bool)
        previous = settings.previous
        if previous is None:
            # a bias of 0 at the start is no guess of its size: any torque that was measured may be its part
            size = np.where(is_bias, np.maximum(scale, settings.torque), scale)
            return cls(covariance, size, estimated)
        known = [unknown.path in previous.values for unknown in estimator.unknowns]
        estimated = np.array([name in previous.names for name in names] if len(previous.names) else known, dtype=bool)
        size = np.where(estimated, np.maximum(np.abs(start), _LEAST * scale), scale)
        size[is_bias] = np.maximum(size[is_bias], settings.noise)
        place = {name: k for k, name in enumerate(previous.names)}
        both = [k for k, name in enumerate(names) if name in place and estimated[k]]
        before = [place[names[k]] for k in both]
        covariance[np.ix_(both, both)] = previous.covariance[np.ix_(before, before)]
        return cls(covariance, size, estimated)

    def of_spread(self, spread: float | Numbers, share: float = 1.0) -> Numbers:
        """Return the covariance [u, u] if numbers are off by `spread` of their size, beside a share of C."""
        return share * self.covariance + np.diag((spread * self.size) ** 2)

    def reported(self, given: float | None) -> Numbers:
        """Return the covariance [u, u] that standard errors rest on."""
        return self.of_spread(np.where(self.estimated, CHANGE, GUESS) if given is None else given)

    def posterior(self, information: Numbers) -> Numbers:
        """Return the covariance [u, u] of the estimate by the information [u, u] of the data and what was known."""
        factor, _ = posterior_factor(information, self.reported(None))
        return np.asarray(factor @ factor.T)


def inverse(covariance: Numbers) -> Numbers:
    """Invert a covariance whose correlations are rounded: no direction counts as better known than by 1e-6."""
    root, value, turn = _parts(covariance)
    turned = turn / root[:, None]
    return np.asarray((turned / value) @ turned.T)


def posterior_factor(information: Numbers, covariance: Numbers) -> tuple[Numbers, Numbers]:
    """Return F and [u] the shares s: F Fᵀ = (I + C⁻¹)⁻¹ and Fᵀ I F = diag(s), by the data's I and what was known, C.

    F is made of I in units of C, free of a negative eigenvalue that rounding leaves where the data know nothing.
    """
    root, value, turn = _parts(covariance)
    half = root[:, None] * turn * np.sqrt(value)
    known, turn = np.linalg.eigh(half.T @ information @ half)
    known = np.maximum(known, 0.0)
    return half @ turn / np.sqrt(1.0 + known), known / (1.0 + known)


def _parts(covariance: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return standard deviations [u], and eigenvalues [u] and eigenvectors [u, u] of the correlations."""
    root = np.sqrt(np.diag(covariance))
    value, turn = np.linalg.eigh(covariance / np.outer(root, root))
    return root, np.maximum(value, 1e-6), turn


def most_likely(information: Numbers, pull: Numbers, prior: Prior) -> Numbers:
    """Return the prior's covariance [u, u] under which the data are most likely (empirical Bayes).

    information [u, u] and pull [u] = information · (estimate by the data alone − start).
    """
    scale = prior.size
    information, pull = information * np.outer(scale, scale), pull * scale

    def log_likelihood(covariance: Numbers) -> float:
        scaled = covariance / np.outer(scale, scale)
        both = np.eye(len(scale)) + information @ scaled
        return 0.5 * float(pull @ scaled @ np.linalg.solve(both, pull) - np.linalg.slogdet(both)[1])

    shares = (0.0, 1.0) if prior.covariance.any() else (0.0,)
    least, *others = (prior.of_spread(spread, share) for share in shares for spread in _SPREADS)
    best = max(others, key=log_likelihood)
    return best if log_likelihood(best) > log_likelihood(least) + CLEARLY else least
