"""What a diagnosis found: everything that its report, page, figures and printed lines show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.effects.words import off_by
from tendonfmu.statistics import Interval

# --- causes -----------------------------------------------------------------------------------------------------------


Parameters = Mapping[str, tuple[float, str]]  # path of a number in the description -> (value, unit)

NO_GAIN = Interval(0.0, 0.0, 0.0)


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
        return off_by(self.where.effect, *self.where.place, self.correction, self.unit)


@dataclass(frozen=True, repr=False)
class Cause:
    """An effect that was found, at one place or several, with its numbers."""

    where: Where  # effect and place; None everywhere or at several places
    title: str = ""  # the effect in plain words, and what to look at on the hand
    explanation: str = ""
    p_value: float = 1.0  # family-wise, over all effects and places that were tested
    gain: Interval = NO_GAIN  # of this cause alone on unseen data: 1 − rms with / rms without, the other causes kept
    gain_unit: str = "N.m"  # of the rms: "N.m" of the torque; "m" of the tendons' positions
    confusable_with: tuple[Where, ...] = ()  # what the data cannot distinguish from it
    intervals: Mapping[str, Interval] = field(default_factory=dict)  # 95 % of what the data determine, by path
    size: str = ""  # in plain words with physical units
    places: tuple[CausePlace, ...] = ()  # every place of the cause with its numbers in the extended description
    evidence: tuple[Evidence, ...] = ()  # pictures of the residual with and without the cause
    changed: ChangedSize | None = None  # for a change: the size in the reference and now
    experiment: str = ""  # of an uncertain cause: the recording that would settle it
    sensors: tuple[Sensor, ...] = ()  # of `calibration`: by how much each sensor is off

    def __repr__(self) -> str:
        place = "".join(f" {kind} {getattr(self, kind)}" for kind in ("joint", "tendon") if getattr(self, kind))
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
    def has_step(self) -> bool:
        """Whether the extended model alone has it; both models are corrected for what is off in the kinematics."""
        return self.gain_unit == "N.m" or self.effect == "time_delay"

    @property
    def parameters(self) -> Parameters:
        """Its numbers in the extended description, of all places: path -> (value, unit)."""
        return {path: number for place in self.places for path, number in place.parameters.items()}


AnyCause = TypeVar("AnyCause", bound=Any)


def by_gain(causes: Iterable[AnyCause]) -> list[AnyCause]:
    """Return causes, or what was judged, the largest gain first."""
    return sorted(causes, key=lambda cause: -cause.gain.value)


def with_error(value: float, error: float) -> Interval:
    """Return a value with its 95 % interval, from its standard error."""
    return Interval(value, value - 1.96 * error, value + 1.96 * error)


ABSORBED = 0.01  # of an effect's variance: if less survives the refit, it is not visible, however large it is


@dataclass(frozen=True)
class Invisible:
    """An effect that these data cannot show: refitting absorbs it, or an ordinary size would not become a cause."""

    where: Where  # effect and place, and the effect in plain words
    title: str
    surviving_share: float  # share of its variance that survives the refit of the nominal model
    experiment: str  # what would show it, in a sentence
    # the same in the form of `Experiment.motion`; empty if no experiment would show it
    motion: Mapping[str, Any] = field(default_factory=dict)
    # 1 − rms ratio that an effect of ordinary size would bring on these data; None for a change
    ordinary_gain: float | None = None
    # 1 − rms ratio that it would need to become a cause beside those that are named; None for a change
    needed_gain: float | None = None

    @property
    def absorbed(self) -> bool:
        """Whether refitting absorbs it, so that no size of it would show."""
        return self.surviving_share < ABSORBED


@dataclass(frozen=True)
class Event:
    """A stretch of the recordings that no friction explains (contact, a stall); it is left out of the fit."""

    recording: str  # name of the file
    start: float  # s
    end: float  # s
    joints: tuple[int, ...]  # joints that feel it, from 1
    peak: float  # N·m
    description: str  # in plain words


@dataclass(frozen=True)
class SteadyLoad:
    """A torque that is present all the time now and was not in the reference."""

    joint: int  # number from 1
    size: ChangedSize  # mean torque that the model leaves, in the reference and now, N·m
    gain: Interval  # of the new recordings: 1 − rms about their own level / rms about the level of the reference
    p_value: float  # of both levels being the same, for all joints


@dataclass(frozen=True)
class RemainderMap:
    """Mean of what is left at a joint over the two signals that it follows best."""

    joint: int  # number from 1
    labels: tuple[str, str]  # of the signals, with their units
    edges: tuple[Numbers, Numbers]  # of the cells [c + 1], [r + 1]
    torque: Numbers  # N·m [r, c]; NaN where there are too few data


@dataclass(frozen=True)
class Unexplained:
    """What no effect explains."""

    share: float  # of the residual variance above the noise floor
    description: str
    by_joint: tuple[float, ...] = ()  # the same for each joint
    p_value: float = 1.0  # of there being nothing to explain, family-wise
    unknown: bool = False  # whether something material and certain is left
    gain: Interval = NO_GAIN  # on unseen stretches: 1 − rms without what can be predicted / rms with it
    map: RemainderMap | None = None  # if something is unknown
    planted: float = math.nan  # share of the variance of planted states that the learner finds


@dataclass(frozen=True)
class ModelErrors:
    """Rms per joint of what a model leaves without a learning bias, N·m, on training and test samples."""

    train_rms: tuple[float, ...]
    test_rms: tuple[float, ...]


@dataclass(frozen=True)
class ResidualView:
    """One picture of the residual of the refitted nominal model at one joint."""

    joint: int  # number from 1
    kind: str  # "time", "angle", "velocity", "tendon_force", "load", "travel", "spectrum" or "autocorrelation"
    label: str  # of `x`
    unit: str
    x: Numbers  # coordinate [K]
    before: Numbers  # nominal and extended model [K]; N²m²/Hz for a spectrum, 1 for an autocorrelation, else N·m
    after: Numbers
    before_std: Numbers | None = None  # scatter within the bin [K]


@dataclass(frozen=True)
class DetectionGain:
    """What the extended model changes for contact detection on labelled recordings, both tuned alike."""

    events: int  # number of labelled contacts
    found_before: int  # how many of them the nominal and the extended model detect
    found_after: int
    false_alarms_before: int  # number of false alarms
    false_alarms_after: int
    median_delay_before: float | None  # s
    median_delay_after: float | None  # s
    smallest_push_before: tuple[float, ...]  # N·m, found within 60 ms nine times of ten, by joint
    smallest_push_after: tuple[float, ...]


@dataclass(frozen=True)
class Experiment:
    """A further experiment, chosen from a menu by computation."""

    sentence: str  # which motion, load or pretension to record, and what it distinguishes
    separates: tuple[tuple[Where, Where], ...] = ()  # pairs of causes that it distinguishes
    makes_visible: tuple[Where, ...] = ()  # effects that it shows
    distance: float = 0.0  # expected distance of the predictions over the noise; 1 is as large as the noise
    motion: Mapping[str, Any] = field(default_factory=dict)  # options of `tendonfmu excite` and the rig that make it


@dataclass(frozen=True)
class Diagnosis:
    """The result of `diagnose`."""

    finger: str
    verdict: str  # "adequate", "explained", "partly explained" or "unexplained"
    recordings: tuple[str, ...]  # names of the files
    tests: tuple[str, ...]
    held_out: bool  # whether the test data are parts of the training recordings
    seconds: float
    seed: int
    least_gain: float  # share of the rms that a cause must remove
    nominal: ModelErrors  # rms of the two models per joint
    extended: ModelErrors
    bias_only_rms: tuple[float, ...]  # test rms per joint without any friction, N·m
    delivered: tuple[ModelErrors, ModelErrors]  # rms of the nominal and the extended model with the bias, as FMUs
    noise_floor: tuple[float, ...]  # part of the extended model's test rms that nothing predicts, per joint, N·m
    floor_source: str  # how the noise floor was determined
    gain: Interval  # over all joints on the test data: 1 − rms of the extended / rms of the nominal model
    # rms over all joints on unseen data of the nominal model and after each cause, in the order of `causes`, N·m
    steps: tuple[float, ...]
    causes: tuple[Cause, ...]  # those whose gain is of positions have no step
    too_small: tuple[Cause, ...]  # causes that are certain, but not material or not confirmed on unseen data
    invisible: tuple[Invisible, ...]
    events: tuple[Event, ...]  # stretches left out of the fit
    unexplained: Unexplained
    experiment: Experiment
    views: tuple[ResidualView, ...]
    whiteness: tuple[tuple[float, float], ...]  # per joint: lag-one autocorrelation before, after
    detection: DetectionGain | None
    nominal_data: Mapping[str, Any]  # the fitted descriptions
    extended_data: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    uncertain: tuple[Cause, ...] = ()  # causes that are significant, but whose gain on unseen data may be 0
    tested: int = 0  # effects at places
    # share of the rms on the training recordings that leaving `events` out removes; None without events
    event_gain: Interval | None = None
    kind: str = "model"  # "model": what the model lacks
    references: tuple[str, ...] = ()  # names of the reference recordings
    repeated: int = 0  # number of motions of the reference that were repeated exactly
    load: SteadyLoad | None = None  # torque that is present now and was not in the reference

    @property
    def undecided(self) -> tuple[Cause, ...]:
        """The uncertain causes that would matter if their gain is what unseen data show; all where none could."""
        return tuple(each for each in self.uncertain if each.gain.value >= self.least_gain or each.gain == NO_GAIN)

    @property
    def torque_causes(self) -> tuple[Cause, ...]:
        """The causes that change the modelled torque, in the order of `steps`."""
        return tuple(cause for cause in self.causes if cause.has_step)
