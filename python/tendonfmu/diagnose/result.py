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
    """An effect at a place. joint, tendon: from 1, None where it has none."""

    effect: str
    joint: int | None = None
    tendon: int | None = None


@dataclass(frozen=True)
class Evidence:
    """The residual over a cause's own coordinate, before and after the model is extended by it.

    joint: from 1, whose residual it is. label, unit: of the coordinate. coordinate: [K] centres of bins of equal
    count. before, after: [K] mean residual, N·m; before_std, after_std: [K] standard error of that mean, N·m.
    reference, reference_std: [K] of the reference, where it is a change that is shown; NaN where it has not been.
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
    """One place of a cause. joint, tendon: from 1, None where it has none. parameters: path -> (value, unit)."""

    joint: int | None
    tendon: int | None
    parameters: Mapping[str, tuple[float, str]]


@dataclass(frozen=True)
class ChangedSize:
    """How large a cause was in the reference, and is now. number: its name, such as "coulomb"; unit: of both.

    A term that the description lacks is 0 in the reference: what is the same in both recordings is no change. by: its
    size in each of the new recordings, in their order, where there are several.
    """

    number: str
    unit: str
    reference: Interval
    now: Interval
    change: Interval
    by: tuple[Interval, ...] = ()


@dataclass(frozen=True)
class Cause:
    """An effect that was found, at one place or several.

    p_value: family-wise, over all effects and places that were tested. gain: of this cause alone on unseen data,
    1 − rms with / rms without, the other causes kept. confusable_with: what the data cannot tell from it.
    parameters: its numbers in the extended description by path, with units as (value, unit); of all places.
    size: in plain words with physical units. changed: then and now, of a change.
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


@dataclass(frozen=True)
class Invisible:
    """An effect that these data cannot show: share of its variance that survives the refit of the nominal model.

    experiment: what would show it, in a sentence; motion: the same as `Experiment.motion` has it, empty if none would.
    """

    where: Where
    title: str
    surviving_share: float
    experiment: str
    motion: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """A stretch of the recordings that no friction explains (contact, a stall): left out of the fit."""

    recording: str
    start: float  # s
    end: float  # s
    joints: tuple[int, ...]
    peak: float  # N·m
    description: str


@dataclass(frozen=True)
class SteadyLoad:
    """A torque that is there all the time now and was not in the reference.

    joint: from 1. size: N·m, of the mean torque that the model leaves, then and now. gain: 1 − rms about its own level
    / rms about that of the reference, of the new recordings. p_value: of both levels being the same, for all joints.
    """

    joint: int
    size: ChangedSize
    gain: Interval
    p_value: float


@dataclass(frozen=True)
class Unexplained:
    """What no effect explains.

    share: of the residual variance above the noise floor; by_joint: of each. p_value: of there being nothing,
    family-wise. unknown: whether there is something material and certain. gain: 1 − rms without what can be predicted
    / rms with it, on unseen stretches.
    """

    share: float
    description: str
    by_joint: tuple[float, ...] = ()
    p_value: float = 1.0
    unknown: bool = False
    gain: Interval = NO_GAIN


@dataclass(frozen=True)
class ModelErrors:
    """rms per joint, N·m, of the residual before the bias has seen the sample."""

    train_rms: tuple[float, ...]
    test_rms: tuple[float, ...]


@dataclass(frozen=True)
class ResidualView:
    """One picture of the residual of the refitted nominal model at one joint.

    kind: "time", "angle", "velocity", "tendon_force", "load", "travel", "spectrum", "autocorrelation".
    x: [K]; before, after: [K] (spectrum: N²m²/Hz; else N·m or 1). unit: of x. before_std [K]: scatter within the bin.
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
    """What the extended model means for contact detection on labelled recordings, at thresholds tuned alike."""

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
    """A further experiment, from a menu, chosen by computation.

    sentence: which motion, load or pretension would tell. separates: what from what; makes_visible: what it shows.
    distance: expected distance of the predictions over the noise (1: as large as the noise). motion: options of
    `tendonfmu excite` and the rig that make it.
    """

    sentence: str
    separates: tuple[tuple[Where, Where], ...] = ()
    makes_visible: tuple[Where, ...] = ()
    distance: float = 0.0
    motion: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """The result of `diagnosis.diagnose`.

    verdict: "adequate", "explained", "partly explained" or "unexplained". recordings, tests: names of the files.
    signals: what was estimated from, in words. least_gain: of a cause. nominal_data, extended_data: the fitted
    descriptions. noise_floor: N·m per joint, what of the extended model's test_rms nothing predicts; floor_source: how
    that is known. steps: rms over all joints on unseen data, N·m, of the nominal model and after each cause, in the
    order of `causes`. gain: over all joints on the test data; held_out: whether those are parts of the training
    recordings. too_small: seen for certain, but not material, or not on unseen data. event_gain: what leaving `events`
    out takes away from the rms on the training recordings; None without events. smoothing: what `signals` says.
    kind: "model", what the model lacks, or "change", what is different from the reference recordings
    `references`; nominal is then the model of the reference, one set of numbers for both. repeated: motions of the
    reference that were made again exactly. load: that is there now and was not.
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
    kind: str = "model"
    references: tuple[str, ...] = ()
    repeated: int = 0
    load: SteadyLoad | None = None
