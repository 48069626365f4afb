"""Which signal a field of a log is, in which unit, of which tendon or joint: by names, stated units and ranges."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.inspection import FieldSummary, Inspection
from tendonfmu.recordings.converters.log import NUMBER
from tendonfmu.recordings.converters.units import stated

SURE, LIKELY, GUESS, NOT_SURE = "sure", "likely", "guess", "undecided"
Groups = dict[str, list[FieldSummary]]  # the fields of each group of columns, and of "torque"
Unit = tuple[str, str, str]  # of a field, or "?"; how sure; why

# --- which unit -------------------------------------------------------------------------------------------------------

# quantity: least and largest magnitude that a finger's signals have in a unit, how sure it is, why
RANGES = {
    "force": [(0.2, 700.0, "N", GUESS, "lbf and kgf would fit too")],
    "length": [
        (0.0005, 0.2, "m", LIKELY, "a finger's tendon moves by centimetres"),
        (0.5, 300.0, "mm", LIKELY, "a finger's tendon moves by centimetres"),
    ],
    "angle": [
        (0.05, 3.3, "rad", LIKELY, "in degrees it would hardly be a motion"),
        (10.0, 400.0, "deg", LIKELY, "too much for radians"),
    ],
    "torque": [(0.005, 80.0, "N.m", GUESS, "the usual unit")],
    "angular speed": [
        (0.05, 15.0, "rad/s", LIKELY, "in degrees per second it would hardly be a motion"),
        (40.0, 2000.0, "deg/s", LIKELY, "too fast for radians"),
    ],
}
EPOCHS = {"epoch_s": 1.0, "epoch_ms": 1e3, "epoch_us": 1e6, "epoch_ns": 1e9}
FROM_1990, TO_2100 = 631_152_000.0, 4_102_444_800.0  # s
SLOWEST = 120.0  # s; of a date: a timer's µs of more than a quarter of an hour look like s since 1990
# median step -> unit, for clocks that start anywhere; logs have some 10 to 10,000 samples per second
STEPS = [(1e-5, 0.12, "s"), (0.5, 120.0, "ms"), (500.0, 120e3, "us"), (500e3, 120e6, "ns")]


def unit_of(signal: FieldSummary, quantity: str, is_ros: bool) -> Unit:
    """Return the unit of a signal of a known quantity."""
    if statement := stated(signal.field.name, signal.field.unit):
        unit, its, where = statement
        return (unit, SURE, where) if its == quantity else ("?", NOT_SURE, f"{where}, which is no {quantity}")
    span, largest = f"{signal.low:.4g} to {signal.high:.4g}", max(abs(signal.low), abs(signal.high))
    fits = [row for row in RANGES[quantity] if row[0] <= largest <= row[1]]
    if is_ros:
        usual = units.si_of(units.QUANTITIES[quantity])
        is_unusual = largest > 0 and usual not in [row[2] for row in fits]
        doubt = f", though {span} is unusual for it" if is_unusual else ""
        return usual, GUESS if doubt else LIKELY, f"the unit of ROS messages (REP 103){doubt}"
    if len(fits) == 1:
        ((_, _, unit, sure, why),) = fits
        return unit, sure, f"{span} fits {unit}; {why}"
    return "?", NOT_SURE, f"{span} fits none of {', '.join(units.QUANTITIES[quantity])} alone"


def unit_of_time(name: str, unit: str, first: float, step: float) -> Unit:
    """Return the unit of a clock, by its first reading and median step."""
    for stamp, per_second in EPOCHS.items():
        if FROM_1990 <= first / per_second <= TO_2100 and step / per_second < SLOWEST:
            why = f"{first:.0f} is a date of our time in {stamp[6:]} since 1970"
            return stamp, SURE if step > 0 else LIKELY, why
    statement = stated(name, unit)
    if statement and statement[1] == "time":
        return statement[0], SURE, statement[2]
    for least, most, fitting in STEPS:
        if least <= step <= most:
            rate = f"{1.0 / (step * units.TIME[fitting]):.4g} samples per second"
            return fitting, LIKELY, f"a median step of {step:.4g} would be {rate}"
    return "?", NOT_SURE, f"a median step of {step:.4g} fits none of s, ms, us, ns"


# --- which tendon or joint --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Order:
    """How the elements of a finger are numbered."""

    of: str  # "tendons" or "joints"
    sure: str  # LIKELY by numbers in the names, GUESS by the order of the log
    elements: tuple[tuple[str, ...], ...]  # the log's names of each element, from index 1 on

    def line(self) -> str:
        """Return the order in one line, and what to do about it."""
        how, doubt = ("as in the log", "a guess") if self.sure == GUESS else ("by the numbers in their names", "likely")
        listed = ", ".join(f"{k} = {' and '.join(names)}" for k, names in enumerate(self.elements, start=1))
        return f"order of {self.of} {how}, {doubt}; check it against the finger: {listed}"


def in_order(signals: Sequence[FieldSummary]) -> tuple[list[FieldSummary], bool]:
    """Return fields by the numbers in their names, and True; or in their own order, and False."""
    numbers = {id(signal): _numbers_of(signal.field.name) for signal in signals}
    if all(numbers.values()) and len(set(numbers.values())) == len(signals):
        return sorted(signals, key=lambda signal: numbers[id(signal)]), True
    return list(signals), False


def _numbers_of(name: str) -> tuple[int, ...]:
    """Return the numbers in a name; those of a unit in brackets do not count."""
    return tuple(int(part) for part in re.findall(r"\d+", _without_unit(name)))


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
    first = _alike(texts)
    last = _alike([text[first:][::-1] for text in texts])
    return [Counter([text[first : len(text) - last]]) for text in texts]


def _alike(texts: Sequence[str]) -> int:
    """Return with how many equal letters all texts begin."""
    return next((k for k, letters in enumerate(zip(*texts, strict=False)) if len({*letters}) > 1), min(map(len, texts)))


def _without_unit(name: str) -> str:
    return re.sub(r"[\[(]([^\])]+)[\])]", lambda match: " " if units.quantity(match[1].strip()) else match[0], name)


# --- which signal -----------------------------------------------------------------------------------------------------

QUANTITY = {
    "tendon_force": "force",
    "tendon_position": "length",
    "joint_position": "angle",
    "joint_velocity": "angular speed",
    "external_torque": "torque",
    "torque": "torque",
}
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

# words of which a name has one of each set, or the quantity of its unit: what it is. The first row that fits counts
RULES: tuple[tuple[tuple[set[str], ...], str], ...] = (
    ((OTHERS,), ""),
    ((CONTACT,), "contact"),
    ((TORQUES, REFERENCE), "external_torque"),
    (({"=angle"}, JOINT), "joint_position"),
    (({"=angle"}, TENDON), "tendon_position"),  # a motor's angle, which needs the radius of its spool
    *(((({f"={quantity}"},), group)) for group, quantity in QUANTITY.items() if group != "external_torque"),
    (({"=time", "=speed"},), ""),
    ((SPEEDS, TENDON), ""),
    ((SPEEDS,), "joint_velocity"),
    ((FORCES,), "tendon_force"),
    ((TENDON, {"effort"}), "tendon_force"),
    ((TORQUES,), "torque"),
    ((TENDON, MOTION), "tendon_position"),
    ((ANGLES,), "joint_position"),
)
# what an element is by its own name -> what it is in an array of these
OF_SIBLINGS = {"tendon_force": ("torque", "external_torque"), "tendon_position": ("joint_position",)}
_ELEMENT = re.compile(r"(.*)\[([^\[\]]+)\]")


def field_groups(inspection: Inspection) -> tuple[Groups, set[str]]:
    """Sort the fields of a log into groups; and names of positions that are known only as many and named as forces."""
    found: Groups = {}
    for topic in inspection.topics:
        clock = None if topic.clock is None else topic.clock.name
        signals = [signal for signal in topic.fields if signal.field.name != clock]
        for signal, group in zip(signals, _of_siblings(signals), strict=True):
            if group:
                found.setdefault(group, []).append(signal)
    groups: Groups = {}
    for group, signals in found.items():
        # a constant is no signal; beside moving ones of the same name it may be a sensor that is not connected
        moving = {_family(signal) for signal in signals if signal.low < signal.high}
        if kept := [signal for signal in signals if group == "contact" or _family(signal) in moving]:
            groups[group] = kept
    return groups, _positions_of_tendons(groups)


def _family(signal: FieldSummary) -> str:
    """Return what the names of the elements of one array have in common."""
    name = signal.field.name
    return _array_of(name) or re.sub(r"\d+", "", _without_unit(name))


def _of_siblings(signals: Sequence[FieldSummary]) -> list[str]:
    """Return the groups of a topic's fields, or "". Elements of an array whose others are all of tendons are too."""
    alone = [_group_of(signal) for signal in signals]
    arrays = [_array_of(signal.field.name) for signal in signals]
    groups = list(alone)
    for k, array in enumerate(arrays):
        siblings = {alone[i] for i, other in enumerate(arrays) if array and other == array and i != k}
        for wanted, instead in OF_SIBLINGS.items():
            if alone[k] in instead and siblings == {wanted}:
                groups[k] = wanted
    return groups


def _positions_of_tendons(groups: Groups) -> set[str]:
    """Take positions for those of tendons if they are as many as the forces and numbered or named like them."""
    forces, angles = groups.get("tendon_force", []), groups.get("joint_position", [])
    if "tendon_position" in groups or len(forces) < 2 or len(angles) != len(forces):
        return set()
    names, of_forces = [signal.field.name for signal in angles], [signal.field.name for signal in forces]
    are_alike = len(set(names)) == len(set(of_forces)) == 1
    are_joints = any(stated(each.field.name, each.field.unit) for each in angles)
    are_joints = are_joints or any(set(words_of(name)) & OF_JOINTS_ONLY for name in names)
    if are_joints or not (are_alike or matched(of_forces, names)):
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


def _group_of(signal: FieldSummary) -> str:
    """Return what a field likely is: a group of columns, "torque", or ""."""
    name, words = signal.field.name, words_of(signal.field.name)
    is_structure = set(re.split(r"[./]", name.lower())) & STRUCTURE
    if words[-1:] in CLOCKS or is_structure or signal.field.kind != NUMBER or signal.count == signal.missing:
        return ""
    array = _array_of(name)
    context = set(words_of(array))
    if array and not context & (OTHERS | CONTACT):
        if context & TORQUES and not context & REFERENCE:
            return "tendon_force" if set(words) & TENDON else "torque"
        says_little = array.rpartition(".")[2].lower() in VALUES
        if context & (TENDON | FORCES | REFERENCE) and not says_little and (group := _by_rules(context, signal)):
            return group
    return _by_rules(set(words), signal)


def _by_rules(words: set[str], signal: FieldSummary) -> str:
    statement = stated(signal.field.name, signal.field.unit)
    known = words | ({f"={statement[1]}"} if statement else set())
    group = next((group for sets, group in RULES if all(known & wanted for wanted in sets)), "")
    return "" if group == "contact" and not signal.only_flags else group
