"""The report of a diagnosis as JSON has it, "tendonfmu-diagnosis-1"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from tendonfmu.json_types import Count, Index, Number, Schema, Share, Size, Values

if TYPE_CHECKING:
    from typing_extensions import NotRequired

Sizes = list[Size | None]
Ends = Annotated[list[Number], Schema(minItems=2, maxItems=2)]
Names = Annotated[list[str | None], Schema(minItems=1)]
EFFECTS = (  # those of diagnosis/effects/table.py, of kinematics, and what is no effect
    "viscous_friction", "stribeck", "asymmetric_friction", "edge_friction", "pulley_friction", "joint_friction",
    "joint_load_friction", "preload_friction", "load_friction", "cover_stiffness", "cover_hardening", "gravity",
    "inertia", "inertia_variation", "presliding", "relaxation", "cord_stretch", "friction_drift", "force_gain",
    "force_offset", "time_delay", "moment_arm", "calibration", "moment_arm_variation", "pulley_eccentricity",
    "tendon_nonlinearity", "joint_coupling", "backlash", "encoder_offset", "zero", "contact", "unknown",
)  # fmt: skip
Effect = Annotated[str, Schema(enum=EFFECTS)]


class Gain(TypedDict):
    value: Number
    interval: Ends


class At(TypedDict):
    joint: Index | None
    tendon: Index | None


class WhereEntry(At):
    effect: Effect


class Errors(TypedDict):
    train_rms: Sizes
    test_rms: Sizes


class Nominal(Errors):
    bias_only_rms: Sizes  # The same without any friction.
    finger: Literal["nominal.json"]


class Extended(Errors):
    finger: Literal["extended.json"]
    fmu: Literal["extended.fmu"]


class Delivered(TypedDict):
    """Rms (N·m) of the residual before the bias update, through the FMU with its bias."""

    nominal: Errors
    extended: Errors


class PlaceEntry(At):
    parameters: Mapping[str, Number]
    units: Mapping[str, str]
    intervals: Mapping[str, Ends]


class OffSensor(WhereEntry):
    correction: Gain  # What the description has to add, with its 95 % interval.
    unit: str


class EvidenceEntry(TypedDict):
    joint: Index
    label: str
    unit: str
    coordinate: Values
    before: Values
    after: Values
    before_std: Values  # Standard error of the mean.
    after_std: Values
    reference: NotRequired[Values]  # For a change: mean residual in the references.
    reference_std: NotRequired[Values]


class CauseEntry(WhereEntry):
    p_value: Share | None  # p-value, family-wise over all effects and places.
    gain: Gain  # Gain of this cause on the test data, with the other causes in the model.
    # Unit of the rms that the gain is a share of: of the torque, or of the tendons' positions (moment_arm,
    # tendon_nonlinearity, joint_coupling, zero and encoder_offset, where positions and encoders show them).
    gain_unit: Annotated[str, Schema(enum=["N.m", "m"])]
    confusable_with: list[WhereEntry]  # Effects that the data cannot distinguish from this one.
    # Numbers of the cause in extended.json, by path; of encoder_offset, by column: what the encoder reads too much,
    # which no description holds.
    parameters: Mapping[str, Number]
    units: Mapping[str, str]  # Units of the parameters.
    intervals: Mapping[str, Ends]  # 95 % intervals of the parameters that the data determine.
    places: list[PlaceEntry]  # Places of the effect; one effect at several places is one cause.
    # Of calibration: what each sensor is off by. Effect calibration stands for force gain and moment arm together.
    sensors: NotRequired[list[OffSensor]]
    size: str  # Size of the cause in words.
    number: NotRequired[str]  # For a change: the number that reference and now are values of.
    unit: NotRequired[str]  # Unit of reference and now.
    # For a change: its size in the references; 0 for a term that the description lacks, null for contact and unknown.
    reference: NotRequired[Number]
    now: NotRequired[Number]  # Size of the cause now.
    now_interval: NotRequired[Values]
    change: NotRequired[Gain]  # now - reference.
    by_recording: NotRequired[list[Gain]]  # Size of the cause in each of several new recordings, in their order.
    title: str
    explanation: str
    # Mean residual (N·m) over the coordinate of the effect, without and with the effect in the model.
    evidence: list[EvidenceEntry]


class UncertainCause(CauseEntry):
    experiment: str  # The recording that would settle it.


class UnexplainedEntry(TypedDict):
    """What no effect explains; share is its part of the residual variance above the noise floor."""

    share: Number
    description: str
    by_joint: Values
    gain: Gain  # 1 - rms without the predictable part / rms with it, in unseen stretches.
    planted: Number  # Share of the variance of hidden states, planted for a test, that the learner finds.


class Step(At):
    label: str
    effect: Effect | None
    rms: Number  # N·m


class WhitenessOfJoint(TypedDict):
    nominal: Number
    extended: Number


class InvisibleEffect(WhereEntry):
    title: str
    surviving_share: Number  # Share of the variance of the effect that remains after refitting the nominal model.
    # 1 - rms ratio that correcting an effect of ordinary size would bring on these data; null for a change.
    ordinary_gain: Number
    # The same that it would need to become a cause beside those that are named; null for a change.
    needed_gain: Number
    experiment: str  # Experiment that would reveal the effect.


class LeftOut(TypedDict):
    recording: str
    start_s: float
    end_s: float
    joints: list[Index]
    peak: Number  # N·m
    description: str


class NextExperiment(TypedDict):
    """The next experiment; `tendonfmu excite --discriminate DIR` writes its motion."""

    sentence: str
    separates: list[Annotated[list[WhereEntry], Schema(minItems=2, maxItems=2)]]
    makes_visible: list[WhereEntry]
    distance: Number  # Difference between the predictions, relative to the noise.
    motion: Mapping[str, Any]  # How the motion is made.


class Detected(TypedDict):
    found: Count
    false_alarms: Count
    median_delay_s: Number
    smallest_push: Sizes  # N·m by joint: sudden torque that is found within 60 ms at nine of ten instants.


class Detection(TypedDict):
    events: Count
    nominal: Detected
    extended: Detected


class View(TypedDict):
    joint: Index
    kind: Annotated[
        str, Schema(enum=["time", "angle", "velocity", "tendon_force", "load", "travel", "spectrum", "autocorrelation"])
    ]
    label: str
    unit: str  # Unit of x.
    x: Values
    nominal: Values
    extended: Values
    nominal_std: Values | None  # Standard deviation within a bin.


class DiagnosisReport(TypedDict):
    """File diagnosis.json of `tendonfmu diagnose`. SI units; null stands for an unknown value.

    All lists by joint start at the base. Indices start at 1. Intervals are 95 % intervals.
    """

    format: Literal["tendonfmu-diagnosis-1"]
    # Whether the causes are effects that the model lacks, or changes since the references.
    kind: Annotated[str, Schema(enum=["model", "change"])]
    verdict: Annotated[str, Schema(enum=["adequate", "explained", "partly explained", "unexplained"])]
    # The given structure after refitting its own numbers (change: refitted to the references, one set for both): rms
    # (N·m) of what it leaves of the torque on contact-free data, in means of 10 ms, without a learning bias: one
    # constant a joint and recording, or the slowest drift that rests demand, is left out.
    nominal: Nominal
    extended: Extended  # The same with the causes in the model, refitted.
    delivered: Delivered
    # N·m; part of extended.test_rms that no recorded signal predicts. floor_source says how it was found.
    noise_floor: Sizes
    gain: Gain  # 1 - rms_extended/rms_nominal over all joints on the test data.
    # In order of gain; contact and unknown, which have no term in the model, come last. The interval of each gain is
    # above 0.
    causes: list[CauseEntry]
    # Effects that are visible, but too small to matter. They are not in the extended model.
    too_small: list[CauseEntry]
    # Effects that are significant, but whose gain on the test data may be 0. They are not in the extended model.
    uncertain: list[UncertainCause]
    unexplained: UnexplainedEntry
    next_experiment: str  # The next experiment in a sentence.
    # Error over all joints on the test data: of the nominal model, then after adding each cause that has a term.
    waterfall: Annotated[list[Step], Schema(minItems=1)]
    # Least share of the rms without a cause that the cause has to remove.
    least_gain: Annotated[float, Schema(minimum=0, maximum=0.5)]
    finger: str  # Name of the finger.
    joints: Names
    tendons: Names
    references: list[str]  # Recordings of the healthy finger; empty if the kind is model.
    repeated: Count  # Motions of the references that the recordings repeat exactly.
    recordings: list[str]
    tests: list[str]
    held_out: bool  # Whether the test data are parts of the recordings that were not trained on.
    seed: Count
    tested: Count  # Number of effects at places that were tested: the family of the p-values.
    floor_source: str
    whiteness: list[WhitenessOfJoint]  # By joint: autocorrelation of the residual at lag one.
    invisible: list[InvisibleEffect]  # Effects that these data cannot reveal.
    events: list[LeftOut]  # Stretches that no friction explains, left out of the fit.
    experiment: NextExperiment
    # Contact detection of both models on labelled recordings, both tuned the same way; null without labels.
    detection: Detection | None
    warnings: list[str]
    seconds: Size  # Time of the computation; everything else is the same for the same seed.
    files: list[str]  # Names of all files of this diagnosis.
    views: list[View]  # The residuals of the nominal and of the extended model, as drawn.
