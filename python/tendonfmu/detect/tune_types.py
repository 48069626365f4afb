"""The report of a tuning as JSON has it, "tendonfmu-tune-2"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypedDict

from tendonfmu.json_types import Count, Kinematics, Schema, Share, Size, Sizes


class Rates(TypedDict):
    alarms: Count
    minutes: Size
    per_hour: Size
    interval: Annotated[list[Size], Schema(minItems=2, maxItems=2)]


class TunedRecording(TypedDict):
    path: str
    alarms: Count
    minutes: Size


class KeptOut(Rates):
    longest_s: Size  # Longest alarm.
    share_in_alarm: Share  # Share of the time.
    at_start: Count  # Alarms before 2 s of motion, which do not count.
    recordings: Annotated[list[TunedRecording], Schema(minItems=1)]


class FoundPushes(TypedDict):
    within_s: Size
    share: Share
    torque: Sizes


class HoldsFor(TypedDict):
    lowest_force: Size
    highest_force: Size


class TunedBias(TypedDict):
    drift_variance: Size
    noise_std: Size
    noise_std_per_force: Size
    time_constant: Size
    mean_force: Size


class AtFactor(Rates):
    factor: Size


class AtPretension(TypedDict):
    mean_force: Size
    minutes: Size
    free_rms: list[Size]  # N·m by joint, rms of the residual in free motion.


class TunedSensors(TypedDict):
    keys: Mapping[str, Any] | None
    largest_difference: Size | None
    left_out: str


class TuneReport(TypedDict):
    """Report of `tendonfmu tune --report`. SI units; null stands for an unknown value.

    `interval` is a two-sided 95 % interval of a Poisson rate.
    """

    format: Literal["tendonfmu-tune-2"]
    finger: str  # Name of the finger.
    # Names of the joints, base first; all lists by joint have this order.
    joints: Annotated[list[str], Schema(minItems=1)]
    kinematics: Kinematics
    method: Annotated[str, Schema(enum=["bands", "paper"])]
    false_alarms_per_hour: Annotated[float, Schema(exclusiveMinimum=0)]  # The rate asked for.
    minutes: Size  # Counted minutes of free motion.
    more_minutes: Size  # Minutes of free motion missing for 3 expected alarms at that rate; 0 if none.
    # The finger as it runs over each recording (of one or two recordings: each quarter of their time) with numbers that
    # were learned from the others.
    kept_out: KeptOut
    # By joint, the sudden torque (N·m) of which a `share` is found within `within_s`: pushes of random sizes are added
    # to the recordings. null: none of up to 40 times the rms of the residual.
    pushes: FoundPushes
    # Mean tendon forces (N) of the recordings. Outside this range the bounds are extrapolated.
    holds_for: HoldsFor
    warnings: list[str]
    # Keys as written into the description, and the time constant (s) at the recordings' mean force (N).
    bias: TunedBias
    contact: Mapping[str, Any]  # Keys as written into the description.
    factor: Size  # Factor on all bounds at which the runs of the finger show the rate.
    tail: list[AtFactor]  # Alarms in the motion that was kept out, with all bounds times a factor.
    pretensions: Annotated[list[AtPretension], Schema(minItems=1)]
    # Keys as written into the description (null: none, with the reason in left_out), and the largest difference between
    # a tendon force and its spring in free motion (N).
    sensor_fault: TunedSensors
    seconds: Size  # Time of the computation.
    sentence: str  # What was asked for and found, in words.
