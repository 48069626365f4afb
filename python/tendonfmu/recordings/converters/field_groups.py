"""What each field of a log likely is, by the words of its name: a tendon's force or position, a joint's angle, ..."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.element_order import matched
from tendonfmu.recordings.converters.inspection import FieldSummary, Inspection, TopicSummary, is_numeric
from tendonfmu.recordings.converters.unit_guess import stated

Member = tuple[TopicSummary, FieldSummary]

BY_QUANTITY = {"force": "tendon_force", "length": "tendon_position", "angle": "joint_position", "torque": "torque"}
BY_QUANTITY["angular speed"] = "joint_velocity"

TENDON = {"tendon", "tendons", "cable", "spool", "motor", "motors", "actuator", "wire", "winch", "excursion", "x0"}
MOTION = {
    "position",
    "pos",
    "length",
    "displacement",
    "stroke",
    "excursion",
    "travel",
    "spool",
    "x0",
    "x",
    "motor",
    "encoder",
}
FORCES = {"tension", "tensions", "force", "forces", "loadcell", "f", "f0", "load"}
TORQUES = {"torque", "torques", "tau", "effort", "moment", "trq"}
SPEEDS = {"velocity", "velocities", "vel", "speed", "qd", "dq", "omega", "rate"}
JOINT = {"joint", "joints"}
OF_JOINTS_ONLY = {*JOINT, "angle", "angles", "q", "theta", "phi", "ang"}
ANGLES = {*OF_JOINTS_ONLY, "position", "pos", "encoder"}
REFERENCE = {"external", "ext", "reference", "ref", "ft", "sensor"}
CONTACT = {"contact", "touch", "label", "touching"}
# words that say that a signal is not measured, or no signal of a finger
OTHERS = {"desired", "des", "target", "command", "cmd", "setpoint", "goal", "temperature", "temp", "current", "voltage"}
OTHERS |= {"pwm", "error", "imu", "acceleration", "acc", "covariance", "seq", "status", "mode"}
KNOWN = TENDON | FORCES | TORQUES | SPEEDS | ANGLES | REFERENCE

# what an element is by its own name -> what it is in an array of these
OF_SIBLINGS = {"tendon_force": ("torque", "external_torque"), "tendon_position": ("joint_position",)}

_ELEMENT = re.compile(r"(.*)\[([^\[\]]+)\]")


def field_groups(found: Inspection) -> tuple[dict[str, list[Member]], set[str]]:
    """Sort the fields of a log into groups of columns."""
    groups: dict[str, list[Member]] = {}
    for topic in found.topics:
        of_topic = [each for each in topic.fields if topic.clock is None or each.field.name != topic.clock.name]
        for each, group in zip(of_topic, _of_siblings(of_topic), strict=True):
            if group:
                groups.setdefault(group, []).append((topic, each))
    return groups, _positions_of_tendons(groups)


def _of_siblings(fields: Sequence[FieldSummary]) -> list[str | None]:
    """Return the groups of a topic's fields. Elements of an array whose others are all of tendons are too."""
    own = [group_of(each) for each in fields]
    arrays = [array_of(each.field.name) for each in fields]
    groups = list(own)
    for k, array in enumerate(arrays):
        siblings = {own[i] for i, other in enumerate(arrays) if array and other == array and i != k}
        for wanted, instead in OF_SIBLINGS.items():
            if own[k] in instead and siblings == {wanted}:
                groups[k] = wanted
    return groups


def _positions_of_tendons(groups: dict[str, list[Member]]) -> set[str]:
    """Take positions for those of tendons if they are as many as the forces and numbered or named like them."""
    forces, angles = groups.get("tendon_force", []), groups.get("joint_position", [])
    if "tendon_position" in groups or len(forces) < 2 or len(angles) != len(forces):
        return set()
    names = [each.field.name for _, each in angles]
    may_be_either = not any(
        stated(each.field.name, each.field.unit) or set(words_of(each.field.name)) & OF_JOINTS_ONLY
        for _, each in angles
    )
    if not may_be_either or matched([each.field.name for _, each in forces], names) is None:
        return set()
    groups["tendon_position"] = groups.pop("joint_position")
    return set(names)


def array_of(name: str) -> str:
    """Return the array of which a field is an element: `/hand.effort` of `/hand.effort[flexor]`; "" if of none."""
    match = _ELEMENT.fullmatch(name)
    return match[1] if match and units.quantity(match[2].strip()) is None else ""


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `TendonForce_2` is tendon, force."""
    plain = name if array_of(name) else re.sub(r"[\[(].*?[\])]", " ", name)
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    return [word.lower() for word in re.findall(r"[A-Za-z]+0?(?![A-Za-z])|[A-Za-z]+", apart)]


def group_of(summary: FieldSummary) -> str | None:
    """Return what a field likely is: a group of columns, "torque", or None."""
    if not is_numeric(summary):
        return None
    array = array_of(summary.field.name)
    context = set(words_of(array))
    if array and not context & (OTHERS | CONTACT):
        if context & TORQUES and not context & REFERENCE:
            return "tendon_force" if set(words_of(summary.field.name)) & TENDON else "torque"
        found = _by_words(context, summary) if context & TENDON or context & (FORCES | REFERENCE) else None
        if found is not None:
            return found
    return _by_words(set(words_of(summary.field.name)), summary)


def _by_words(words: set[str], summary: FieldSummary) -> str | None:
    if words & OTHERS:
        return None
    if words & CONTACT:
        return "contact" if summary.only_flags else None
    if words & TORQUES and words & REFERENCE:
        return "external_torque"
    said = stated(summary.field.name, summary.field.unit)
    if said is not None:
        quantity = said[1]
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
