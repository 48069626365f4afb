"""How places of a finger and effects are named in sentences: joints and tendons as the user gave them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.contact_scan import LEVEL as SCAN_LEVEL
from tendonfmu.diagnosis.effects import BY_NAME, Where, title_of
from tendonfmu.diagnosis.effects.places import thresholds
from tendonfmu.diagnosis.effects.table import CONTACT, UNKNOWN
from tendonfmu.diagnosis.effects.words import quantity
from tendonfmu.diagnosis.result import Cause, CausePlace, Diagnosis, Parameters
from tendonfmu.files import counted
from tendonfmu.model import steps_of


@dataclass(frozen=True)
class Names:
    """Names of joints and tendons."""

    joints: tuple[str, ...]  # as in the description; empty where it has none
    tendons: tuple[str, ...]

    def place(self, where: Where) -> str:
        """Name a place, such as "joint 2 (pip), tendon 1 (fdp)"; empty for the whole finger."""
        parts = (("joint", where.joint, self.joints), ("tendon", where.tendon, self.tendons))
        return ", ".join(numbered(kind, number, names) for kind, number, names in parts if number is not None)

    def joint(self, number: int) -> str:
        """Name a joint by its number (from 1), such as "joint 2 (pip)"."""
        return numbered("joint", number, self.joints)

    def places(self, cause: Cause) -> str:
        """Name the place of a cause, or count its places; "everywhere" for the whole finger."""
        place = self.place(cause.where)
        several = counted(len(cause.places), "place") if len(cause.places) > 1 else ""
        return ", ".join(each for each in (place, several) if each) or "everywhere"


def numbered(kind: str, number: int, names: Sequence[str]) -> str:
    """Name a joint or a tendon by its number (from 1) and its name, if it has one of its own."""
    name = names[number - 1] if 0 < number <= len(names) else ""
    plain = f"{kind} {number}"
    return plain if name.replace("_", " ").lower() in ("", plain, str(number)) else f"{plain} ({name})"


def names_in(data: Data) -> Names:
    """Return the names in a description."""
    kinds = (data["joints"], data["tendons"])
    return Names(*(tuple(str(part.get("name") or "") for part in parts) for parts in kinds))


def at_place(title: str, where: Where, names: Names) -> str:
    """Add the place to a title, such as "friction grows with the force, at joint 1 (mcp)"."""
    place = names.place(where)
    return f"{title}, at {place}" if place else title


# --- sizes ------------------------------------------------------------------------------------------------------------

_SHOWN = 3  # numbers that are listed for an effect without words of its own


def size_of(effect: str, places: Sequence[CausePlace], data: Data) -> str:
    """Return a size such as "a play of 0.32 mm"; for several places the largest one and their number."""
    sized = [place for place in places if place.parameters]
    if not sized:
        return ""
    sizes = list(dict.fromkeys(size_at(effect, place.parameters, data) for place in sized))
    if len(sized) == 1:
        return sizes[0]
    if len(sizes) == 1:
        return f"{sizes[0]}, at each of {len(sized)} places"
    units = {_first(place)[1] for place in sized}
    if len(units) > 1:  # for example everywhere and at a joint
        return f"{sizes[0]}; different at {counted(len(sized) - 1, 'place')}"
    largest = max(sized, key=lambda place: abs(_first(place)[0]))
    return f"{size_at(effect, largest.parameters, data)} at the largest of {len(sized)} places"


def size_at(effect: str, parameters: Parameters, data: Data) -> str:
    """Return the size of an effect at one place of a description in plain words."""
    numbers: dict[str, list[tuple[float, str]]] = {}
    for path, number in parameters.items():
        numbers.setdefault(path.rsplit(".", 1)[-1], []).append(number)
    if effect == "presliding":
        numbers = _of_memory(parameters, data)
    try:
        return BY_NAME[effect].size(numbers)
    except (KeyError, ValueError):  # it is given by other numbers, for example by a law instead of a row
        return _listed(parameters)


def _of_memory(parameters: Parameters, data: Data) -> dict[str, list[tuple[float, str]]]:
    """Return the numbers of a memory by name: those of cords apart, times as travels at the threshold of motion."""
    numbers: dict[str, list[tuple[float, str]]] = {}
    for path, (value, unit) in parameters.items():
        _, row, name = steps_of(path)
        named = numbers.setdefault("cords" if data["extensions"][row]["effect"] == "cord_stretch" else str(name), [])
        if name == "displacement" and unit == "s":
            named += [(value * threshold, at) for threshold, at in zip(thresholds(data), ("m", "rad"), strict=True)]
        else:
            named.append((value, unit))
    return numbers


def _first(place: CausePlace) -> tuple[float, str]:
    return next(iter(place.parameters.values()))


def _listed(parameters: Parameters) -> str:
    """Return names and values of the first few numbers."""
    names = [path.rsplit(".", 1)[-1].replace("_", " ") for path in parameters]
    shown = [f"{name} {quantity(*number)}" for name, number in zip(names, parameters.values(), strict=True)]
    more = len(shown) - _SHOWN
    return ", ".join(shown[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


# --- causes that a report lists ---------------------------------------------------------------------------------------


LOAD = "a new load on the finger, or a sensor's zero that has moved"  # a contact that lasts for the whole recording
_EXPLANATIONS = {
    LOAD: "The mean torque that the model does not explain has moved far beyond its scatter in the reference. Friction "
    "cannot cause that. Check whether something touches or pulls the finger, and what the sensors read without a "
    "tendon. At run time the bias compensates it.",
    CONTACT: "In some stretches a torque appears and disappears that no friction explains. They are left out of the "
    "fit. The gain is the share of the error on the training recordings that leaving them out removes.",
    UNKNOWN: "Part of the remaining error follows the recorded signals, but no known effect has its shape. The "
    "gain is how much smaller the error on test data would be without it.",
}
LEAST_CONTACT = 0.1  # lower end of a contact's gain: contact is judged on the recordings in which it was found
LEAST_PEAK = 6.0  # least peak of a contact, in rms of what the extended model leaves


def reported_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes that a report lists, in order of gain."""
    return [*diagnosis.causes, *_load(diagnosis), *_contact(diagnosis), *_unknown(diagnosis)]


def _load(diagnosis: Diagnosis) -> Iterator[Cause]:
    load = diagnosis.load
    if load is None:
        return
    change = load.size.change
    yield Cause(
        Where(CONTACT, load.joint),
        LOAD,
        _EXPLANATIONS[LOAD],
        load.p_value,
        load.gain,
        confusable_with=(Where("force_offset"), Where("gravity", load.joint)),
        size=f"{quantity(change.value, load.size.unit, sign=True)} all the time",
        changed=load.size,
    )


def _contact(diagnosis: Diagnosis) -> Iterator[Cause]:
    events = [event for event in diagnosis.events if event.peak >= LEAST_PEAK * max(diagnosis.extended.train_rms)]
    gain = diagnosis.event_gain
    if not events or gain is None or not gain.low >= LEAST_CONTACT:
        return
    joints = {joint for event in events for joint in event.joints}
    where = Where(CONTACT, joints.pop() if len(joints) == 1 else None)
    count = "one event" if len(events) == 1 else f"{len(events)} events"
    size = f"{count}, {sum(event.end - event.start for event in events):.1f} s in all"
    # p-value: the probability of any event in recordings without one
    yield Cause(where, title_of(CONTACT), _EXPLANATIONS[CONTACT], SCAN_LEVEL, gain, size=size)


def _unknown(diagnosis: Diagnosis) -> Iterator[Cause]:
    rest = diagnosis.unexplained
    if rest.unknown and rest.gain.low > 0.0:
        where = Where(UNKNOWN, int(np.argmax(rest.by_joint)) + 1 if any(rest.by_joint) else None)
        size, words = rest.description.rstrip("."), _EXPLANATIONS[UNKNOWN]
        yield Cause(where, title_of(UNKNOWN), words, rest.p_value, rest.gain, size=size)
