"""How large a cause is, in plain words with physical units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from tendonfmu.diagnosis.result import FoundPlace
from tendonfmu.files import counted
from tendonfmu.model import LEFT_OUT

Thresholds = tuple[float, float]
Parameters = Mapping[str, tuple[float, str]]  # path -> (value, unit)
Numbers = dict[str, list[tuple[float, str]]]  # last part of the path -> (value, unit) of each number

NBSP = "\u00a0"
_SHOWN = 3  # numbers that are listed for an effect without words of its own
_PREFIXED = ("m", "N.m", "N", "s", "rad", "m/s", "rad/s", "m/rad", "N.m/rad", "N.m.s/rad")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_STEPS = ((0.1, 1.0, ""), (1e-4, 1e3, "m"), (0.0, 1e6, "µ"))  # least magnitude, factor, prefix


def size_of(effect: str, places: Sequence[FoundPlace], thresholds: Thresholds) -> str:
    """Return a size such as "a play of 0.32 mm"; for several places the largest one and their number."""
    sized = [place for place in places if place.parameters]
    if not sized:
        return ""
    sizes = list(dict.fromkeys(size_at(effect, place.parameters, thresholds) for place in sized))
    if len(sized) == 1:
        return sizes[0]
    if len(sizes) == 1:
        return f"{sizes[0]}, at each of {len(sized)} places"
    units = {_first(place)[1] for place in sized}
    if len(units) > 1:  # for example everywhere and at a joint
        return f"{sizes[0]}; other at {counted(len(sized) - 1, 'place')}"
    largest = max(sized, key=lambda place: abs(_first(place)[0]))
    return f"{size_at(effect, largest.parameters, thresholds)} at the largest of {len(sized)} places"


def size_at(effect: str, parameters: Parameters, thresholds: Thresholds) -> str:
    """Return the size of an effect at one place in plain words."""
    if effect == "presliding" and (sized := _travel(parameters, thresholds)):
        return sized
    numbers: Numbers = {}
    for path, number in parameters.items():
        numbers.setdefault(path.rsplit(".", 1)[-1], []).append(number)
    words = _WORDS.get(effect)
    try:
        return words(numbers) if words is not None else _listed(parameters)
    except (KeyError, ValueError):  # the effect is given by other numbers, for example by a law instead of a row
        return _listed(parameters)


def _travel(parameters: Parameters, thresholds: Thresholds) -> str:
    """Return the travel of presliding at all places, whose number is a time: time × threshold of motion."""
    if [unit for _, unit in parameters.values()] != ["s"]:
        return ""
    ((time, _),) = parameters.values()
    tendon, joint = (quantity(time * threshold, unit) for threshold, unit in zip(thresholds, ("m", "rad"), strict=True))
    return f"over {tendon} at tendons, {joint} at joints"


def _first(place: FoundPlace) -> tuple[float, str]:
    return next(iter(place.parameters.values()))


def quantity(value: float, unit: str, *, sign: bool = False) -> str:
    """Format a value with three digits and a suitable unit prefix."""
    if unit in ("", "1"):
        text, sized = f"{100 * value:.3g}", "%"
    else:
        least = next(step for step in _STEPS if abs(value) >= step[0])
        _, factor, prefix = least if unit in _PREFIXED and value != 0 else _STEPS[0]
        text, sized = f"{factor * value:.3g}", prefix + unit.replace(".", "·").replace("2", "²").replace("3", "³")
    mantissa, _, exponent = text.partition("e")
    if exponent:
        text = f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}"
    plus = "+" if sign and value > 0 else ""
    return f"{plus}{text.replace('-', '−')}{NBSP}{sized}"


def _listed(parameters: Parameters) -> str:
    """Return names and values of the first few numbers."""
    names = [path.rsplit(".", 1)[-1].replace("_", " ") for path in parameters]
    shown = [f"{name} {quantity(*number)}" for name, number in zip(names, parameters.values(), strict=True)]
    more = len(shown) - _SHOWN
    return ", ".join(shown[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


# --- words of an effect -----------------------------------------------------------------------------------------------


def _one(numbers: Numbers, name: str) -> tuple[float, str]:
    return numbers[name][0]


def _of(text: str, name: str) -> Callable[[Numbers], str]:
    """Return a function that fills the largest number of that name into the text."""
    return lambda numbers: text.format(quantity(*max(numbers[name], key=lambda number: abs(number[0]))))


def _wave(text: str) -> Callable[[Numbers], str]:
    """Return a function that fills the amplitude of a sine and a cosine into the text."""

    def words(numbers: Numbers) -> str:
        (sine, unit), (cosine, _) = (numbers.get(name, [(0.0, "1")])[0] for name in ("sine", "cosine"))
        unit = unit if "sine" in numbers else _one(numbers, "cosine")[1]
        return text.format(quantity(math.hypot(sine, cosine), unit))

    return words


def _with(words: Callable[[Numbers], str], name: str, more: str) -> Callable[[Numbers], str]:
    """Return a function that adds `more` to the words if the mechanism's number is given and not the default."""

    def with_more(numbers: Numbers) -> str:
        value = numbers.get(name, [(LEFT_OUT[name], "1")])[0][0]
        return words(numbers) + ("" if value == LEFT_OUT[name] else more.format(f"{value:.3g}".replace("-", "−")))

    return with_more


def _correction(what: str) -> Callable[[Numbers], str]:
    """Return a function that says whether a value is larger or smaller than described."""

    def words(numbers: Numbers) -> str:
        value, unit = _one(numbers, "correction")
        return f"{what} {quantity(abs(value), unit)} {'larger' if value > 0 else 'smaller'} than measured"

    return words


def _per_force(whose: str) -> Callable[[Numbers], str]:
    """Return words for a friction torque that grows with a force; its number is a length, N·m per N."""

    def words(numbers: Numbers) -> str:
        value = max(number for number, _ in numbers["coulomb"])
        return f"{quantity(value, 'N.m')} of friction for each newton of {whose}"

    return words


def _drift(numbers: Numbers) -> str:
    (amplitude, _), constant = _one(numbers, "amplitude"), _one(numbers, "time_constant")
    change = "more" if amplitude > 0 else "less"
    return (
        f"{quantity(abs(amplitude), '1')} {change} friction in the end, with a time constant of {quantity(*constant)}"
    )


def _standstill(numbers: Numbers) -> str:
    velocity = quantity(*_one(numbers, "stribeck_velocity"))
    if "amplitude" not in numbers:
        (static, unit), (coulomb, _) = _one(numbers, "static"), _one(numbers, "coulomb")
        return f"{quantity(static, unit)} near standstill, {quantity(coulomb, unit)} beyond about {velocity}"
    amplitude, unit = _one(numbers, "amplitude")
    change = "more" if amplitude > 0 else "less"
    return f"{quantity(abs(amplitude), unit)} {change} friction near standstill, up to about {velocity}"


def _delay(numbers: Numbers) -> str:
    value, unit = _one(numbers, "delay")
    return f"the forces come {quantity(abs(value), unit)} {'later' if value > 0 else 'earlier'} than the positions"


def _sides(numbers: Numbers) -> str:
    """Return the two sides, positive before negative as in a description."""
    coulomb = numbers["coulomb"]
    pairs = list(zip(coulomb[::2], coulomb[1::2], strict=True))
    (one, unit), (other, _) = max(pairs, key=lambda pair: abs(pair[0][0] - pair[1][0]))
    return f"{quantity(one, unit)} in the positive direction, {quantity(other, unit)} in the negative one"


def _arm(numbers: Numbers) -> str:
    return f"{quantity(*_one(numbers, 'correction'), sign=True)} on the described arm"


_WORDS: Mapping[str, Callable[[Numbers], str]] = {
    "viscous_friction": _of("viscous {}", "viscous"),
    "stribeck": _standstill,
    "edge_friction": _of("up to {} of the tendon force", "coulomb"),
    "pulley_friction": _of("up to {} of the tendon force", "coulomb"),
    "joint_friction": _of("{} of friction", "coulomb"),
    "joint_load_friction": _per_force("all tendon forces"),
    "preload_friction": _with(_of("{} of friction", "coulomb"), "beyond", ", {} times as much at the joints beyond"),
    "load_friction": _per_force("tendon force"),
    "cover_stiffness": _of("a spring of {}", "stiffness"),
    "cover_hardening": _of("a cubic spring of {}", "stiffness"),
    "gravity": _wave("{} at most"),
    "inertia": _of("{}", "inertia"),
    "presliding": _of("over {}", "displacement"),
    "friction_drift": _drift,
    "force_gain": _correction("the true force is"),
    "force_offset": _correction("the true force is"),
    "time_delay": _delay,
    "moment_arm": _arm,
    "moment_arm_variation": _of("the arm changes by {}", "slope"),
    "pulley_eccentricity": _with(
        _wave("the arm goes up and down by {}"), "turns", ", {} times while the joint would turn once"
    ),
    "tendon_nonlinearity": _of("the spring stiffens by {}", "hardening"),
    "joint_coupling": _with(
        _of("a spring of {} between the joints", "stiffness"),
        "reaction",
        ", of which the next joint feels {} times as much",
    ),
    "backlash": _of("a play of {}", "width"),
    "asymmetric_friction": _sides,
}
