"""What reports say of recordings: the recording itself, its innovations, and the routing that it shows."""

from __future__ import annotations

from typing import Annotated, TypedDict

from tendonfmu.json_types import Count, Index, Kinematics, Number, Schema, Size, Values


class RecordingEntry(TypedDict):
    path: str
    samples: Count
    used: Count
    held_out: Count
    contact_left_out: Count
    # Samples left out because a sensor is stuck, or because the part between two gaps is too short.
    faulty_left_out: Count
    # Samples left out because no friction slides: a motor holds there with any torque up to friction. Only where the
    # bias is constant.
    at_rest: Count
    parts: Index  # Parts between gaps, each with its own bias path.
    duration: Size  # s, without gaps.
    mean_force: Size  # N, mean magnitude of all tendon forces.
    kinematics: Kinematics
    external_torque: bool  # Whether the known load was subtracted (eq. 9).


class Nis(TypedDict):
    mean: Size | None
    interval: Annotated[Values, Schema(minItems=2, maxItems=2)]
    consistent: bool


class Whiteness(TypedDict):
    lag_one: Values
    ljung_box_p: Values


class LearnedNumber(TypedDict):
    path: str
    described: float
    value: Number
    half_width: Size | None  # Half of the 95 % interval.
    known: bool  # Whether the recordings determine it.
    changed: bool  # Whether the value replaces the described one.


class RoutingEntry(TypedDict):
    """Moment arms, stiffness and zeros that --routing learned before anything else."""

    numbers: list[LearnedNumber]
    sentences: list[str]
