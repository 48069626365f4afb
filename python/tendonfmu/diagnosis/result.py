"""What a diagnosis found: everything that its report, page, figures and printed lines show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.recordings import Signals
from tendonfmu.statistics import Interval

Numbers = NDArray[np.float64]


NO_GAIN = Interval(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Where:
    """An effect at a place.

    Attributes
    ----------
    effect
        Name of the effect.
    joint, tendon
        Number from 1; None if the place has none.
    """

    effect: str
    joint: int | None = None
    tendon: int | None = None


@dataclass(frozen=True)
class Evidence:
    """The residual over a cause's own coordinate, before and after the model is extended by it.

    Attributes
    ----------
    joint
        Joint whose residual it is, from 1.
    label, unit
        Of the coordinate.
    coordinate
        Centres of bins of equal count [K].
    before, after
        Mean residual without and with the cause, N·m [K].
    before_std, after_std
        Standard error of that mean, N·m [K].
    reference, reference_std
        For a change: mean residual in the reference and its standard error, N·m [K]. NaN where the reference has no
        data.
    """

    joint: int
    label: str
    unit: str
    coordinate: Numbers
    before: Numbers
    after: Numbers
    before_std: Numbers
    after_std: Numbers
    reference: Numbers | None = None
    reference_std: Numbers | None = None


@dataclass(frozen=True)
class FoundPlace:
    """One place of a cause.

    Attributes
    ----------
    joint, tendon
        Number from 1; None if the place has none.
    parameters
        Numbers of the cause at this place: path -> (value, unit).
    """

    joint: int | None
    tendon: int | None
    parameters: Mapping[str, tuple[float, str]]


@dataclass(frozen=True)
class ChangedSize:
    """How large a cause was in the reference, and how large it is now.

    A term that the description lacks is 0 in the reference: what is the same in both recordings is no change.

    Attributes
    ----------
    number
        Name of the number, such as "coulomb".
    unit
        Unit of all values.
    reference, now, change
        Size in the reference, size now, and difference, with 95 % intervals.
    by
        Size in each of the new recordings, in their order, if there are several.
    """

    number: str
    unit: str
    reference: Interval
    now: Interval
    change: Interval
    by: tuple[Interval, ...] = ()


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
    confusable_with
        What the data cannot distinguish from it.
    parameters
        Its numbers in the extended description, of all places: path -> (value, unit).
    size
        In plain words with physical units.
    places
        Every place of the cause with its numbers.
    evidence
        Pictures of the residual with and without the cause.
    changed
        For a change: the size in the reference and now.
    """

    where: Where
    title: str
    explanation: str
    p_value: float
    gain: Interval
    confusable_with: tuple[Where, ...]
    parameters: Mapping[str, tuple[float, str]]
    size: str
    places: tuple[FoundPlace, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    changed: ChangedSize | None = None

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


ABSORBED = 0.01  # of an effect's variance: if less survives the refit, it is not visible, however large it is


@dataclass(frozen=True)
class Invisible:
    """An effect that these data cannot show: refitting absorbs it, or an ordinary size would not become a cause.

    Attributes
    ----------
    where, title
        Effect and place, and the effect in plain words.
    surviving_share
        Share of its variance that survives the refit of the nominal model.
    experiment
        What would show it, in a sentence.
    motion
        The same in the form of `Experiment.motion`; empty if no experiment would show it.
    ordinary_gain
        1 − rms ratio that an effect of ordinary size would bring on these data; None for a change.
    needed_gain
        1 − rms ratio that it would need to become a cause beside those that are named; None for a change.
    """

    where: Where
    title: str
    surviving_share: float
    experiment: str
    motion: Mapping[str, Any] = field(default_factory=dict)
    ordinary_gain: float | None = None
    needed_gain: float | None = None

    @property
    def absorbed(self) -> bool:
        """Whether refitting absorbs it, so that no size of it would show."""
        return self.surviving_share < ABSORBED


@dataclass(frozen=True)
class Event:
    """A stretch of the recordings that no friction explains (contact, a stall); it is left out of the fit.

    Attributes
    ----------
    recording
        Name of the file.
    start, end
        Times in the recording, s.
    joints
        Joints that feel it, from 1.
    peak
        Largest unexplained torque, N·m.
    description
        In plain words.
    """

    recording: str
    start: float  # s
    end: float  # s
    joints: tuple[int, ...]
    peak: float  # N·m
    description: str


@dataclass(frozen=True)
class SteadyLoad:
    """A torque that is present all the time now and was not in the reference.

    Attributes
    ----------
    joint
        Number from 1.
    size
        Mean torque that the model leaves, in the reference and now, N·m.
    gain
        Of the new recordings: 1 − rms about their own level / rms about the level of the reference.
    p_value
        Of both levels being the same, for all joints.
    """

    joint: int
    size: ChangedSize
    gain: Interval
    p_value: float


@dataclass(frozen=True)
class Unexplained:
    """What no effect explains.

    Attributes
    ----------
    share
        Of the residual variance above the noise floor.
    by_joint
        The same for each joint.
    p_value
        Of there being nothing to explain, family-wise.
    unknown
        Whether something material and certain is left.
    gain
        On unseen stretches: 1 − rms without what can be predicted / rms with it.
    """

    share: float
    description: str
    by_joint: tuple[float, ...] = ()
    p_value: float = 1.0
    unknown: bool = False
    gain: Interval = NO_GAIN


@dataclass(frozen=True)
class ModelErrors:
    """Rms per joint of the residual before the bias update, N·m, on training and test samples."""

    train_rms: tuple[float, ...]
    test_rms: tuple[float, ...]


@dataclass(frozen=True)
class ResidualView:
    """One picture of the residual of the refitted nominal model at one joint.

    Attributes
    ----------
    joint
        Number from 1.
    kind
        "time", "angle", "velocity", "tendon_force", "load", "travel", "spectrum" or "autocorrelation".
    label, unit
        Of `x`.
    x
        Coordinate [K].
    before, after
        Nominal and extended model [K]; N²m²/Hz for a spectrum, 1 for an autocorrelation, else N·m.
    before_std
        Scatter within the bin [K].
    """

    joint: int
    kind: str
    label: str
    unit: str
    x: Numbers
    before: Numbers
    after: Numbers
    before_std: Numbers | None = None


@dataclass(frozen=True)
class DetectionGain:
    """What the extended model changes for contact detection on labelled recordings, at thresholds tuned alike.

    Attributes
    ----------
    events
        Number of labelled contacts.
    found_before, found_after
        How many of them the nominal and the extended model detect.
    false_alarms_before, false_alarms_after
        Number of false alarms.
    median_delay_before, median_delay_after
        s; None if no event was found.
    thresholds_before, thresholds_after
        Per joint, N·m.
    """

    events: int
    found_before: int
    found_after: int
    false_alarms_before: int
    false_alarms_after: int
    median_delay_before: float | None  # s
    median_delay_after: float | None  # s
    thresholds_before: tuple[float, ...]  # N·m
    thresholds_after: tuple[float, ...]


@dataclass(frozen=True)
class Experiment:
    """A further experiment, chosen from a menu by computation.

    Attributes
    ----------
    sentence
        Which motion, load or pretension to record, and what it distinguishes.
    separates
        Pairs of causes that it distinguishes.
    makes_visible
        Effects that it shows.
    distance
        Expected distance of the predictions over the noise; 1 is as large as the noise.
    motion
        Options of `tendonfmu excite` and the rig that make it.
    """

    sentence: str
    separates: tuple[tuple[Where, Where], ...] = ()
    makes_visible: tuple[Where, ...] = ()
    distance: float = 0.0
    motion: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """The result of `diagnose`.

    Attributes
    ----------
    verdict
        "adequate", "explained", "partly explained" or "unexplained".
    recordings, tests
        Names of the files.
    held_out
        Whether the test data are parts of the training recordings.
    signals
        What was estimated from, in words.
    smoothing
        The same as numbers.
    fits_sliding
        Whether the numbers of the extended model were fitted only where everything slides.
    least_gain
        Share of the rms that a cause must remove.
    nominal, extended
        Rms of the two models per joint.
    bias_only_rms
        Test rms per joint if only the bias is removed, N·m.
    noise_floor
        Part of the extended model's test rms that nothing predicts, per joint, N·m.
    floor_source
        How the noise floor was determined.
    gain
        Over all joints on the test data: 1 − rms of the extended / rms of the nominal model.
    steps
        Rms over all joints on unseen data of the nominal model and after each cause, in the order of `causes`, N·m.
    too_small
        Causes that are certain, but not material or not confirmed on unseen data.
    events
        Stretches left out of the fit.
    event_gain
        Share of the rms on the training recordings that leaving `events` out removes; None without events.
    nominal_data, extended_data
        The fitted descriptions.
    tested
        Number of candidate causes (effects at places) that were tested.
    kind
        "model": what the model lacks. "change": what differs from the reference recordings; `nominal` is then the model
        of the reference, with one set of numbers for both.
    references
        Names of the reference recordings.
    repeated
        Number of motions of the reference that were repeated exactly.
    load
        Torque that is present now and was not in the reference.
    """

    finger: str
    verdict: str
    recordings: tuple[str, ...]
    tests: tuple[str, ...]
    held_out: bool
    seconds: float
    seed: int
    signals: str
    least_gain: float
    nominal: ModelErrors
    extended: ModelErrors
    bias_only_rms: tuple[float, ...]
    noise_floor: tuple[float, ...]
    floor_source: str
    gain: Interval
    steps: tuple[float, ...]
    causes: tuple[Cause, ...]
    too_small: tuple[Cause, ...]
    invisible: tuple[Invisible, ...]
    events: tuple[Event, ...]
    unexplained: Unexplained
    experiment: Experiment
    views: tuple[ResidualView, ...]
    whiteness: tuple[tuple[float, float], ...]  # per joint: lag-one autocorrelation before, after
    detection: DetectionGain | None
    nominal_data: Mapping[str, Any]
    extended_data: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    tested: int = 0  # effects at places
    event_gain: Interval | None = None
    smoothing: Signals = field(default_factory=Signals)
    fits_sliding: bool = False
    kind: str = "model"
    references: tuple[str, ...] = ()
    repeated: int = 0
    load: SteadyLoad | None = None
