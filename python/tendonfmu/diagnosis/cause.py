"""A cause, from the candidate that the search tries to what the page shows: one type, which each step fills further.

1. A candidate has a place, its terms in a description and its direction in the candidate columns (`hypotheses`).
2. Judged, it has magnitudes and its error on unseen stretches (`selection`).
3. Named, it has a p-value, a gain, and the causes that the data cannot distinguish from it (`search`,
   `change_search`).
4. Confirmed, its gain is that on unseen data, and every place has its numbers (`cause_gains`, `change_diagnosis`).
5. Reported, it has its size in words and its pictures (`answer`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.effects import Term
from tendonfmu.diagnosis.effects.words import off_by
from tendonfmu.statistics import Interval

Key = tuple[str, int | None, int | None]  # effect, joint, tendon
Parameters = Mapping[str, tuple[float, str]]  # path of a number in the description -> (value, unit)

EVERYWHERE, SOMEWHERE, HERE = 0, 1, 2  # levels: all places, those of one joint or tendon, a single one
NO_GAIN = Interval(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Where:
    """An effect at a place."""

    effect: str  # name of the effect
    joint: int | None = None  # number from 1; None if the place has none
    tendon: int | None = None


@dataclass(frozen=True)
class Evidence:
    """The residual over a cause's own coordinate, before and after the model is extended by it."""

    joint: int  # joint whose residual it is, from 1
    label: str  # of the coordinate
    unit: str
    coordinate: Numbers  # centres of bins of equal count [K]
    before: Numbers  # mean residual without and with the cause, N·m [K]
    after: Numbers
    before_std: Numbers  # standard error of that mean, N·m [K]
    after_std: Numbers
    reference: Numbers | None = None  # for a change: mean residual in the reference and its standard error, N·m [K]
    reference_std: Numbers | None = None


@dataclass(frozen=True)
class CausePlace:
    """One place of a cause."""

    joint: int | None  # number from 1; None if the place has none
    tendon: int | None
    parameters: Parameters  # numbers of the cause at this place


@dataclass(frozen=True)
class ChangedSize:
    """How large a cause was in the reference, and how large it is now."""

    number: str  # name of the number, such as "coulomb"
    unit: str  # unit of all values
    reference: Interval  # size in the reference, size now, and difference, with 95 % intervals
    now: Interval
    change: Interval
    by: tuple[Interval, ...] = ()  # size in each of the new recordings, in their order, if there are several


@dataclass(frozen=True)
class Sensor:
    """By how much something that is measured or described is off."""

    where: Where  # `force_gain`, `force_offset`, `moment_arm` or `time_delay`; `calibration` for gain and arm together
    correction: Interval  # what the description has to add, with its 95 % interval
    unit: str

    @property
    def is_off(self) -> bool:
        """Whether the interval leaves 0 out."""
        return not self.correction.low <= 0.0 <= self.correction.high

    @property
    def words(self) -> tuple[str, str]:
        """Which sensor it is, and by how much it is off."""
        return off_by(self.where.effect, self.where.joint, self.where.tendon, self.correction, self.unit)


@dataclass(frozen=True)
class Direction:
    """How a cause looks among all columns: what its magnitudes add."""

    mix: Numbers  # map from magnitudes to columns [c, d]
    low: Numbers  # bounds of the magnitudes [d]
    high: Numbers
    level: int = HERE  # EVERYWHERE, SOMEWHERE or HERE
    ordinary: Numbers = field(default_factory=lambda: np.zeros(0))  # magnitudes of an ordinary effect at one place [d]
    step: float = 1.0  # size of its first number at a magnitude of 1, in the unit of the number
    least_gain: float = 0.0  # share of the rms that it must remove to be considered


_NOWHERE = Direction(np.zeros((0, 0)), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, repr=False)
class Cause:
    """An effect that was found, at one place or several.

    Attributes
    ----------
    where
        Effect and place; None everywhere or at several places.
    title, explanation
        The effect in plain words, and what to look at on the hand.
    p_value
        Family-wise, over all effects and places that were tested.
    gain
        Of this cause alone on unseen data: 1 − rms with / rms without, the other causes kept.
    gain_unit
        Of the rms: "N.m" of the torque; "m" of the tendons' positions, of numbers that lead from angles to them.
    confusable_with
        What the data cannot distinguish from it.
    parameters
        Its numbers in the extended description, of all places: path -> (value, unit).
    intervals
        95 % intervals of those that the data determine, by path.
    size
        In plain words with physical units.
    places
        Every place of the cause with its numbers.
    evidence
        Pictures of the residual with and without the cause.
    changed
        For a change: the size in the reference and now.
    experiment
        Of an uncertain cause: the recording that would settle it.
    sensors
        Of `calibration`: by how much each sensor is off.
    """

    where: Where
    title: str = ""
    explanation: str = ""
    p_value: float = 1.0
    gain: Interval = NO_GAIN
    gain_unit: str = "N.m"
    confusable_with: tuple[Where, ...] = ()
    parameters: Parameters = field(default_factory=dict)
    intervals: Mapping[str, Interval] = field(default_factory=dict)
    size: str = ""
    places: tuple[CausePlace, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    changed: ChangedSize | None = None
    experiment: str = ""
    sensors: tuple[Sensor, ...] = ()
    # what it adds to a description, place by place; of a candidate, for magnitudes of 1; none for a number of its own
    terms: tuple[Term, ...] = ()
    direction: Direction = field(default=_NOWHERE, compare=False)
    magnitudes: Numbers = field(default_factory=lambda: np.zeros(0), compare=False)  # [d], and [d, d]
    covariance: Numbers = field(default_factory=lambda: np.zeros((0, 0)), compare=False)
    unseen: Numbers = field(default_factory=lambda: np.zeros(0), compare=False)  # Σ e² by stretch, (N·m)²
    alike: tuple[Cause, ...] = field(default=(), compare=False)  # what the data cannot distinguish from it, best first

    def __repr__(self) -> str:
        place = "".join(
            f" {kind} {number}" for kind, number in (("joint", self.joint), ("tendon", self.tendon)) if number
        )
        return f"<Cause {self.effect}{place}: gain {self.gain.value:.3g}; {self.size}>"

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.where.effect

    @property
    def joint(self) -> int | None:
        """Number of the joint from 1; None everywhere or at several places."""
        return self.where.joint

    @property
    def tendon(self) -> int | None:
        """Number of the tendon from 1; None everywhere or at several places."""
        return self.where.tendon

    @property
    def key(self) -> Key:
        return self.effect, self.joint, self.tendon

    def scaled(self) -> tuple[Term, ...]:
        """Return the terms of a candidate at its magnitudes."""
        return tuple(term.times(self.magnitudes.tolist()) for term in self.terms)


def with_error(value: float, error: float) -> Interval:
    """Return a value with its 95 % interval, from its standard error."""
    return Interval(value, value - 1.96 * error, value + 1.96 * error)
