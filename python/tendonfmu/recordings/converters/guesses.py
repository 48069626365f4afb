"""What names and ranges of a log's fields tell: which signal a field is, in which unit, of which tendon or joint."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.inspection import FieldSummary, Inspection, TopicSummary
from tendonfmu.recordings.converters.log import NUMBER
from tendonfmu.recordings.converters.units import stated

SURE, LIKELY, GUESS, UNDECIDED = "sure", "likely", "guess", "undecided"

T = TypeVar("T")
Member = tuple[TopicSummary, FieldSummary]

# --- which unit -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Guess:
    """A unit."""

    unit: str  # its name, or "?"
    sure: str  # SURE, LIKELY, GUESS or UNDECIDED
    why: str  # in words


# largest magnitude -> unit; what a finger's signals have in each unit. Between the ranges several units fit.
FORCE = [(0.2, 700.0, "N", "lbf and kgf would fit too")]
LENGTH = [
    (0.0005, 0.2, "m", "a finger's tendon moves by centimetres"),
    (0.5, 300.0, "mm", "a finger's tendon moves by centimetres"),
]
ANGLE = [(0.05, 3.3, "rad", "in degrees it would hardly be a motion"), (10.0, 400.0, "deg", "too much for radians")]
TORQUE = [(0.005, 80.0, "N.m", "the usual unit")]
ANGULAR_SPEED = [
    (0.05, 15.0, "rad/s", "in degrees per second it would hardly be a motion"),
    (40.0, 2000.0, "deg/s", "too fast for radians"),
]
RANGES = {"force": FORCE, "length": LENGTH, "angle": ANGLE, "torque": TORQUE, "angular speed": ANGULAR_SPEED}
SI = {"angle": "rad", "angular speed": "rad/s", "torque": "N.m", "force": "N", "length": "m"}

EPOCHS = {"epoch_s": 1.0, "epoch_ms": 1e3, "epoch_us": 1e6, "epoch_ns": 1e9}
FROM_1990, TO_2100 = 631_152_000.0, 4_102_444_800.0  # s
SLOWEST = 120.0  # s; of a date: a timer's µs of more than a quarter of an hour look like s since 1990
# median step -> unit, for clocks that start anywhere; logs have some 10 to 10,000 samples per second
STEPS = [(1e-5, 0.12, "s"), (0.5, 120.0, "ms"), (500.0, 120e3, "us"), (500e3, 120e6, "ns")]


def unit_of(name: str, unit: str, quantity: str, low: float, high: float, ros: bool) -> Guess:
    """Return the unit of a signal of a known quantity."""
    statement = stated(name, unit)
    if statement:
        stated_unit, stated_quantity, where = statement
        if stated_quantity == quantity:
            return Guess(stated_unit, SURE, where)
        return Guess("?", UNDECIDED, f"{where}, which is no {quantity}")
    span, largest = f"{low:.4g} to {high:.4g}", max(abs(low), abs(high))
    fits = {name: why for least, most, name, why in RANGES[quantity] if least <= largest <= most}
    if ros:
        usual = SI[quantity]
        doubt = f", though {span} is unusual for it" if usual not in fits and largest > 0 else ""
        return Guess(usual, GUESS if doubt else LIKELY, f"the unit of ROS messages (REP 103){doubt}")
    if len(fits) == 1:
        ((fitting, why),) = fits.items()
        is_weak = quantity in ("force", "torque")
        return Guess(fitting, GUESS if is_weak else LIKELY, f"{span} fits {fitting}; {why}")
    return Guess("?", UNDECIDED, f"{span} fits none of {', '.join(units.QUANTITIES[quantity])} alone")


def unit_of_time(name: str, unit: str, first: float, step: float) -> Guess:
    """Return the unit of a clock, by its first reading and median step."""
    for stamp, per_second in EPOCHS.items():
        if FROM_1990 <= first / per_second <= TO_2100 and step / per_second < SLOWEST:
            return Guess(
                stamp, SURE if step > 0 else LIKELY, f"{first:.0f} is a date of our time in {stamp[6:]} since 1970"
            )
    statement = stated(name, unit)
    if statement and statement[1] == "time":
        return Guess(statement[0], SURE, statement[2])
    for least, most, fitting in STEPS:
        if least <= step <= most:
            rate = f"{1.0 / (step * units.TIME[fitting]):.4g} samples per second"
            return Guess(fitting, LIKELY, f"a median step of {step:.4g} would be {rate}")
    return Guess("?", UNDECIDED, f"a median step of {step:.4g} fits none of s, ms, us, ns")


# --- which tendon or joint --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Order:
    """How the elements of a finger are numbered."""

    of: str  # "tendons" or "joints"
    sure: str  # LIKELY by numbers in the names, GUESS by the order of the log
    elements: tuple[tuple[str, ...], ...]  # the log's names of each element, from index 1 on

    def line(self) -> str:
        """Return the order in one line, and what to do about it."""
        how = "as in the log" if self.sure == GUESS else "by the numbers in their names"
        listed = ", ".join(f"{k} = {' and '.join(names)}" for k, names in enumerate(self.elements, start=1))
        doubt = "a guess" if self.sure == GUESS else "likely"
        return f"order of {self.of} {how}, {doubt}; check it against the finger: {listed}"


def _numbers_of(name: str) -> tuple[int, ...]:
    """Return the numbers in a name; those of a unit in brackets do not count."""
    return tuple(int(part) for part in re.findall(r"\d+", _without_unit(name)))


def in_order(members: Sequence[T], name_of: Callable[[T], str]) -> tuple[list[T], bool]:
    """Return members by the numbers in their names, and True; or in their own order, and False."""
    numbers = [_numbers_of(name_of(member)) for member in members]
    if all(numbers) and len(set(numbers)) == len(numbers):
        return sorted(members, key=lambda member: _numbers_of(name_of(member))), True
    return list(members), False


def matched(names: Sequence[str], others: Sequence[str]) -> list[int] | None:
    """Return for each of some names the index of the name of the same element: `x_flex` belongs to `F_flex`."""
    for marks in (_parts, _stems):
        wanted = marks(names)
        indices = []
        for parts in marks(others):
            fits = [k for k, mark in enumerate(wanted) if mark and not mark - parts]
            # part 1 of `finger1_F1` is in each name; the element with the most parts in common is meant
            most = max((sum(wanted[k].values()) for k in fits), default=0)
            best = [k for k in fits if sum(wanted[k].values()) == most]
            if len(best) != 1:
                break
            indices += best
        if len(indices) == len(others) and len(set(indices)) == len(indices):
            return indices
    return None


def _parts(names: Sequence[str]) -> list[Counter[str]]:
    """Return the words and numbers of each name that not all names have."""
    parts = [Counter(re.findall(r"\d+|[a-z]+", _without_unit(name).lower())) for name in names]
    common = parts[0] if len(parts) > 1 else Counter()
    for of_name in parts[1:]:
        common = common & of_name
    return [of_name - common for of_name in parts]


def _stems(names: Sequence[str]) -> list[Counter[str]]:
    """Return what is left of each name without the beginning and end that all names have: `Fflex` is `flex`."""
    texts = [_without_unit(name).lower().strip() for name in names]
    if len(texts) < 2:
        return [Counter() for _ in texts]
    first = _length_of_beginning(texts)
    last = _length_of_beginning([text[first:][::-1] for text in texts])
    return [Counter([text[first : len(text) - last]]) for text in texts]


def _length_of_beginning(texts: Sequence[str]) -> int:
    """Return how many letters all texts begin with."""
    least = min(len(text) for text in texts)
    return next((k for k in range(least) if len({text[k] for text in texts}) > 1), least)


def _without_unit(name: str) -> str:
    return re.sub(r"[\[(]([^\])]+)[\])]", lambda match: " " if units.quantity(match[1].strip()) else match[0], name)


def order_of(of: str, by_number: bool, groups: Sequence[Sequence[str]]) -> Order:
    """Return the order of elements."""
    longest = max((len(names) for names in groups), default=0)
    elements = tuple(tuple(names[k] for names in groups if k < len(names) and names[k]) for k in range(longest))
    return Order(of, LIKELY if by_number else GUESS, elements)


# --- which signal -----------------------------------------------------------------------------------------------------

BY_QUANTITY = {"force": "tendon_force", "length": "tendon_position", "angle": "joint_position", "torque": "torque"}
BY_QUANTITY["angular speed"] = "joint_velocity"

TENDON = {"tendon", "tendons", "cable", "spool", "motor", "motors", "actuator", "wire", "winch", "excursion"}
TENDON |= {"flexor", "extensor", "flexors", "extensors"}
MOTION = {"position", "pos", "length", "displacement", "stroke", "excursion", "travel", "spool", "x"}
MOTION |= {"motor", "encoder", "count", "counts", "ticks"}
FORCES = {"tension", "tensions", "force", "forces", "loadcell", "f", "load"}
TORQUES = {"torque", "torques", "tau", "effort", "moment", "trq"}
SPEEDS = {"velocity", "velocities", "vel", "speed", "qd", "dq", "omega", "rate"}
JOINT = {"joint", "joints"}
OF_JOINTS_ONLY = {*JOINT, "angle", "angles", "q", "theta", "phi", "ang"}
ANGLES = {*OF_JOINTS_ONLY, "position", "positions", "pos", "encoder"}
REFERENCE = {"external", "ext", "reference", "ref", "ft", "sensor"}
CONTACT = {"contact", "touch", "label", "touching"}
# words that say that a signal is not measured, or no signal of a finger
OTHERS = {"desired", "des", "target", "command", "cmd", "setpoint", "goal", "temperature", "temp", "current", "voltage"}
OTHERS |= {"cur", "curr", "amp", "amps", "ma", "volt", "volts", "duty"}
OTHERS |= {"action", "pwm", "error", "imu", "acceleration", "acc", "covariance", "seq", "status", "mode"}
# parts of a message that say how it is built
STRUCTURE = {"layout", "header", "seq", "dim", "data_offset", "stride", "size", "frame_index", "episode_index"}
CLOCKS = (["time"], ["timestamp"], ["stamp"], ["date"], ["clock"], ["millis"], ["micros"])  # last word of a name
VALUES = {"value", "values", "data"}  # names of arrays that say nothing
KNOWN = TENDON | FORCES | TORQUES | SPEEDS | ANGLES | REFERENCE

# what an element is by its own name -> what it is in an array of these
OF_SIBLINGS = {"tendon_force": ("torque", "external_torque"), "tendon_position": ("joint_position",)}

_ELEMENT = re.compile(r"(.*)\[([^\[\]]+)\]")


def field_groups(inspection: Inspection) -> tuple[dict[str, list[Member]], set[str]]:
    """Sort the fields of a log into groups of columns."""
    groups: dict[str, list[Member]] = {}
    for topic in inspection.topics:
        clock = None if topic.clock is None else topic.clock.name
        signals = [summary for summary in topic.fields if summary.field.name != clock]
        for signal, group in zip(signals, _of_siblings(signals), strict=True):
            if group:
                groups.setdefault(group, []).append((topic, signal))
    for group, members in list(groups.items()):
        # a constant is no signal; beside moving ones of the same name it may be a sensor that is not connected
        moving = {_family(summary) for _, summary in members if summary.low < summary.high}
        kept = [member for member in members if group == "contact" or _family(member[1]) in moving]
        groups[group] = kept
        if not kept:
            del groups[group]
    return groups, _positions_of_tendons(groups)


def _family(summary: FieldSummary) -> str:
    """Return what the names of the elements of one array have in common."""
    name = summary.field.name
    return _array_of(name) or re.sub(r"\d+", "", _without_unit(name))


def _of_siblings(fields: Sequence[FieldSummary]) -> list[str | None]:
    """Return the groups of a topic's fields. Elements of an array whose others are all of tendons are too."""
    alone = [_group_of(summary) for summary in fields]
    arrays = [_array_of(summary.field.name) for summary in fields]
    groups = list(alone)
    for k, array in enumerate(arrays):
        siblings = {alone[i] for i, other in enumerate(arrays) if array and other == array and i != k}
        for wanted, instead in OF_SIBLINGS.items():
            if alone[k] in instead and siblings == {wanted}:
                groups[k] = wanted
    return groups


def _positions_of_tendons(groups: dict[str, list[Member]]) -> set[str]:
    """Take positions for those of tendons if they are as many as the forces and numbered or named like them."""
    forces, angles = groups.get("tendon_force", []), groups.get("joint_position", [])
    if "tendon_position" in groups or len(forces) < 2 or len(angles) != len(forces):
        return set()
    fields = [summary.field for _, summary in angles]
    names = [field.name for field in fields]
    are_alike = len(set(names)) == len({summary.field.name for _, summary in forces}) == 1
    are_joints = any(stated(field.name, field.unit) or set(words_of(field.name)) & OF_JOINTS_ONLY for field in fields)
    if are_joints or not (are_alike or matched([summary.field.name for _, summary in forces], names)):
        return set()
    groups["tendon_position"] = groups.pop("joint_position")
    return set(names)


def _array_of(name: str) -> str:
    """Return the array of which a field is an element: `/hand.effort` of `/hand.effort[flexor]`; "" if of none."""
    match = _ELEMENT.fullmatch(name)
    return match[1] if match and units.quantity(match[2].strip()) is None else ""


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `TendonForce_2` is tendon, force."""
    plain = name if _array_of(name) else re.sub(r"[\[(].*?[\])]", " ", name)
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    apart = re.sub(r"(?<![A-Za-z])([Mm]|[Mm]ot)(?=_?\d)", "motor", apart)  # m1_pos
    return [word.lower() for word in re.findall(r"[A-Za-z]+", apart)]


def _group_of(summary: FieldSummary) -> str | None:
    """Return what a field likely is: a group of columns, "torque", or None."""
    if words_of(summary.field.name)[-1:] in CLOCKS:
        return None
    parts = set(re.split(r"[./]", summary.field.name.lower()))
    if summary.field.kind != NUMBER or summary.count == summary.missing or parts & STRUCTURE:
        return None
    array = _array_of(summary.field.name)
    context = set(words_of(array))
    if array and not context & (OTHERS | CONTACT):
        if context & TORQUES and not context & REFERENCE:
            return "tendon_force" if set(words_of(summary.field.name)) & TENDON else "torque"
        says_little = array.rpartition(".")[2].lower() in VALUES
        group = _by_words(context, summary) if context & (TENDON | FORCES | REFERENCE) and not says_little else None
        if group is not None:
            return group
    return _by_words(set(words_of(summary.field.name)), summary)


def _by_words(words: set[str], summary: FieldSummary) -> str | None:
    if words & OTHERS:
        return None
    if words & CONTACT:
        return "contact" if summary.only_flags else None
    if words & TORQUES and words & REFERENCE:
        return "external_torque"
    statement = stated(summary.field.name, summary.field.unit)
    if statement is not None:
        quantity = statement[1]
        if quantity == "angle" and words & TENDON and not words & JOINT:
            return "tendon_position"  # a motor's angle, which needs the radius of its spool
        return BY_QUANTITY.get(quantity)
    if words & SPEEDS:
        return None if words & TENDON else "joint_velocity"
    if words & FORCES or (words & TENDON and words & {"effort"}):
        return "tendon_force"
    if words & TORQUES:
        return "torque"
    if words & TENDON and words & MOTION:
        return "tendon_position"
    return "joint_position" if words & ANGLES else None
