"""The map of columns as JSON has it, "tendonfmu-map-1". See docs/reference/commands/convert.md."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from tendonfmu.json_types import Schema, Text

if TYPE_CHECKING:
    from typing_extensions import NotRequired

Rate = Annotated[float, Schema(exclusiveMinimum=0, maximum=1e6)]


class HowToRead(TypedDict, total=False):
    """A column of the log, and how its numbers are read."""

    sign: Annotated[int, Schema(enum=[1, -1], default=1)]  # Sign; -1 if the log has the opposite direction.
    # Scale in units per reading, such as rad per count or N per volt.
    scale: Annotated[float, Schema(exclusiveMinimum=0, maximum=1e12, default=1)]
    # Reading that stands for zero, in the unit of the log; "first": the reading of the first row.
    offset: Annotated[Annotated[float, Schema(minimum=-1e21, maximum=1e21)] | Literal["first"], Schema(default=0)]
    # Readings after which a counter starts again, such as 65536; those above half of it are negative.
    wrap: Annotated[float, Schema(minimum=0, maximum=1e12)]
    comment: str  # For readers of the map, such as why `convert inspect` proposes this; ignored.


# "?": left to you by `convert inspect`, and refused by `convert table`.
Source = Text | Annotated[int, Schema(minimum=1)]


class Reading(HowToRead):
    column: Source  # Name of the log's column, or its number from 1.


class Flag(Reading, total=False):
    unit: Literal["1"]  # Unit of the readings after scaling.


class Measured(Reading):
    unit: Text  # Unit of the readings after scaling; any other name that pint knows.


class TimeOrRate(HowToRead, total=False):
    column: Source  # Name of the log's column, or its number from 1.
    # Unit of the readings after scaling, or the kind of stamp: s, ms, us or ns since 1970, or datetime (a text, or a
    # field that the log declares a time). Stamps count from the first row.
    unit: Text
    zone: Annotated[Text, Schema(default="UTC")]  # datetime: time zone of texts that state none, such as Europe/Berlin.
    pattern: Text  # datetime: pattern of the texts, as of Python's strptime. Default: ISO 8601.
    rate: Rate  # In place of a column: rows a second of a log without a time.


def _in(*units: str) -> Schema:
    """Offer units, and take others."""
    return Schema(properties={"unit": {"anyOf": [{"enum": units}, True]}})


_STAMPS = ("epoch_s", "epoch_ms", "epoch_us", "epoch_ns", "datetime")
_COLUMN_OR_RATE = Schema(anyOf=[{"required": ["column", "unit"]}, {"required": ["rate"]}])
Time = Annotated[TimeOrRate, _COLUMN_OR_RATE, _in("s", "ms", "us", "ns", "min", *_STAMPS)]
Force = Annotated[Measured, _in("N", "mN", "kN", "kgf", "gf", "lbf")]
Torque = Annotated[Measured, _in("N.m", "mN.m", "kN.m", "N.mm", "N.cm", "kgf.cm", "lbf.in")]
Length = Annotated[Measured, _in("m", "cm", "mm", "um", "inch")]
Angle = Annotated[Measured, _in("rad", "mrad", "deg", "turn")]
Speed = Annotated[Measured, _in("m/s", "cm/s", "mm/s", "m/min")]
AngularSpeed = Annotated[Measured, _in("rad/s", "mrad/s", "deg/s", "rpm", "turn/s")]


class LogLayout(TypedDict, total=False):
    # Text: separator between fields; a space stands for any number of spaces.
    separator: Annotated[str, Schema(enum=[",", ";", "\t", "|", " "])]
    # Text: decimal mark; that of the separator only where cells are quoted.
    decimal: Annotated[str, Schema(enum=[".", ","])]
    thousands: Annotated[str, Schema(enum=[",", ".", " ", "'"])]  # Text: mark between groups of three digits.
    skip: Annotated[int, Schema(minimum=0, maximum=10000)]  # Text: number of lines before the line of names.
    header: bool  # Text: whether there is a line of names; without it columns are numbered.
    units_row: bool  # Text: whether a row of units follows the line of names.
    encoding: Text  # Text: encoding, such as utf-8, utf-16 or latin-1.
    # What to do with rows in which a number is missing (empty or NaN). ?: not decided yet, refused by `convert table`.
    missing: Annotated[str, Schema(enum=["refuse", "leave out", "?"], default="refuse")]
    # What to do if time stands still or goes back. sort: sort by time, and keep the first of rows with the same time.
    disorder: Annotated[str, Schema(enum=["refuse", "sort"], default="refuse")]
    # Time of each topic beside that of the column time, by topic; by default the field of the same name.
    clocks: dict[str, Time]


class Columns(TypedDict):
    time: Time  # Time of each row, increasing.
    contact: NotRequired[Flag]  # 1 in contact, else 0.


_FINGER = "[A-Za-z][A-Za-z0-9_.-]*[_.-]"
_NUMBERED = {
    "tendon_force": Force,
    "tendon_position": Length,
    "joint_position": Angle,
    "joint_velocity": AngularSpeed,
    "external_torque": Torque,
}
_OTHERS = Schema(
    dependentRequired={"tendon_force[1]": ["tendon_position[1]"], "tendon_position[1]": ["tendon_force[1]"]},
    patternProperties={
        f"^{_FINGER}contact$": Flag,
        **{rf"^({_FINGER})?{name}\[[1-9][0-9]?\]$": of for name, of in _NUMBERED.items()},
    },
)


class Machine(TypedDict):
    # Name of the machine and of its joint in the description.
    name: NotRequired[Annotated[Text, Schema(default="joint")]]
    # Hz; cutoff of the filter without delay on the velocity, of the log or of central differences of the position. 0:
    # no filter. Default without a column of velocity: 20, but at most a fifth of the sample rate, which is also the
    # upper limit.
    velocity_cutoff: NotRequired[Annotated[float, Schema(minimum=0, maximum=1e6)]]
    time: Time  # Time of each row, increasing.
    contact: NotRequired[Flag]  # 1 in contact, else 0.


class Turning(Machine):
    """A machine with one rotary joint."""

    kind: NotRequired[Literal["turning"]]  # Kind of motion; this is the default.
    torque: Torque  # Torque of the drive, positive in the direction of increasing angles.
    angle: Angle  # Angle of the joint, on the same side of the gear as the torque.
    # Measured velocity, used as it is; without it central differences of the position are used.
    velocity: NotRequired[AngularSpeed]
    # Known load of the drive besides friction (weight, a brake, inertia), with the sign of the drive's torque.
    known_load: NotRequired[Torque]


class Sliding(Machine):
    """A machine with one linear joint: a metre stands for a radian, a newton for a newton metre."""

    kind: Literal["sliding"]  # Kind of motion.
    force: Force  # Force of the drive, positive in the direction of increasing positions.
    position: Length  # Position of the axis.
    # Measured velocity, used as it is; without it central differences of the position are used.
    velocity: NotRequired[Speed]
    # Known load of the drive besides friction (weight, a brake, inertia), with the sign of the drive's torque.
    known_load: NotRequired[Force]


class Clock(TypedDict, total=False):
    rate: Rate  # Hz; samples per second of the recording. Default: the times of the column time.
    largest_gap: Rate  # s; longer steps of a topic are gaps. Default: ten times its median step.
    # What to do with samples in gaps.
    gaps: Annotated[str, Schema(enum=["refuse", "leave out"], default="refuse")]


class MapFile(TypedDict):
    """Map for `tendonfmu convert table LOG --map MAP.json`.

    Each column of the recording is sign * scale * unit * (reading - offset). See docs/reference/commands/convert.md.
    """

    format: Literal["tendonfmu-map-1"]
    comment: NotRequired[str]  # For readers of the map; ignored.
    # Format of the log, and what to do about its faults. What is absent is found in the first lines.
    log: NotRequired[LogLayout]
    # Columns of the recording, numbered from 1 without a gap; those of a finger of a hand with its prefix.
    columns: NotRequired[Annotated[Columns, _OTHERS]]
    # Short form for a machine with one joint: its torque becomes the force of one bidirectional tendon with a moment
    # arm of 1 m.
    joint: NotRequired[Turning | Sliding]
    resample: NotRequired[Clock]  # How topics come onto one clock, by linear interpolation.


Map = Annotated[MapFile, Schema(oneOf=[{"required": ["columns"]}, {"required": ["joint"]}])]
