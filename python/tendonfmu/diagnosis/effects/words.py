"""How large an effect is, in plain words with physical units."""

from __future__ import annotations

import math
from collections.abc import Callable

from tendonfmu.diagnosis.effects.mechanism import Sizes
from tendonfmu.model import LEFT_OUT
from tendonfmu.statistics import Interval

Words = Callable[[Sizes], str]

NBSP = "\u00a0"
_PREFIXED = ("m", "N.m", "N", "s", "rad", "m/s", "rad/s", "m/rad", "N.m/rad", "N.m.s/rad")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# travels that a hand's sensors show, and stiffnesses that hold its friction over such a travel
_SHOWN = {"m": (1e-6, math.inf), "rad": (1e-4, math.inf), "N/m": (0.0, 1e6), "N.m/rad": (0.0, 50.0)}
_STEPS = ((0.1, 1.0, ""), (1e-4, 1e3, "m"), (0.0, 1e6, "µ"))  # least magnitude, factor, prefix


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


def presliding(numbers: Sizes) -> str:
    """Return over what friction builds up, or how stiff it is before it slips, and what else it does."""
    name, text = ("displacement", "over {}") if "displacement" in numbers else ("stiffness", "a stiffness of {}")
    of_unit: dict[str, list[float]] = {}
    for value, unit in numbers[name]:
        of_unit.setdefault(unit, []).append(value)
    ranges = {unit: dict.fromkeys(_shown(end, unit) for end in (min(own), max(own))) for unit, own in of_unit.items()}
    sized = (f"{' to '.join(ends)} at {'joint' if 'rad' in unit else 'tendon'}s" for unit, ends in ranges.items())
    more = (("relaxation_time", ", fading within {} at rest"), ("cords", ", along cords of {}"))
    parts = (words.format(quantity(*numbers[part][0])) for part, words in more if part in numbers)
    follows = max((value for value, _ in numbers.get("follows_limit", ())), default=0.0)
    with_load = ", growing with the load at rest, too" if follows > 0.0 else ""
    return text.format(", ".join(sized)) + with_load + "".join(parts)


def _shown(value: float, unit: str) -> str:
    least, most = _SHOWN[unit]
    below = f"less than {quantity(least, unit)}" if value < least else quantity(value, unit)
    return f"more than {quantity(most, unit)}" if value > most else below


def _one(numbers: Sizes, name: str) -> tuple[float, str]:
    return numbers[name][0]


def of(text: str, name: str) -> Words:
    """Return a function that fills the largest number of that name into the text."""
    return lambda numbers: text.format(quantity(*max(numbers[name], key=lambda number: abs(number[0]))))


def wave(text: str) -> Words:
    """Return a function that fills the amplitude of a sine and a cosine into the text."""

    def words(numbers: Sizes) -> str:
        (sine, unit), (cosine, _) = (numbers.get(name, [(0.0, "1")])[0] for name in ("sine", "cosine"))
        unit = unit if "sine" in numbers else _one(numbers, "cosine")[1]
        return text.format(quantity(math.hypot(sine, cosine), unit))

    return words


def with_number(words: Words, name: str, more: str) -> Words:
    """Return a function that adds `more` to the words if the mechanism's number is given and not the default."""

    def with_more(numbers: Sizes) -> str:
        value = round(numbers.get(name, [(LEFT_OUT[name], "1")])[0][0], 6) + 0.0  # a fit leaves 1e-18 of 0
        return words(numbers) + ("" if value == LEFT_OUT[name] else more.format(f"{value:.3g}".replace("-", "−")))

    return with_more


def correction(what: str) -> Words:
    """Return a function that says whether a value is larger or smaller than described."""

    def words(numbers: Sizes) -> str:
        value, unit = _one(numbers, "correction")
        return f"{what} {quantity(abs(value), unit)} {'larger' if value > 0 else 'smaller'} than measured"

    return words


def per_force(whose: str) -> Words:
    """Return words for a friction torque that grows with a force; its number is a length, N·m per N."""

    def words(numbers: Sizes) -> str:
        value = max(number for number, _ in numbers["coulomb"])
        return f"{quantity(value, 'N.m')} of friction for each newton of {whose}"

    return words


def hardening(numbers: Sizes) -> str:
    """Return the cubic spring, and how far from the described rest angle it hardens alike to both sides."""
    (stiffness, unit), (quadratic, _) = _one(numbers, "stiffness"), numbers.get("quadratic", [(0.0, "")])[0]
    centre = round(-quadratic / (3.0 * stiffness), 6) if stiffness else 0.0  # a fit leaves 1e-18 of 0
    about = f" about {quantity(centre, 'rad', sign=True)} from its rest angle" if centre else ""
    return f"a cubic spring of {quantity(stiffness, unit)}{about}"


def drift(numbers: Sizes) -> str:
    (amplitude, _), constant = _one(numbers, "amplitude"), _one(numbers, "time_constant")
    change = "more" if amplitude > 0 else "less"
    return (
        f"{quantity(abs(amplitude), '1')} {change} friction in the end, with a time constant of {quantity(*constant)}"
    )


def standstill(numbers: Sizes) -> str:
    velocity = quantity(*_one(numbers, "stribeck_velocity"))
    if "amplitude" not in numbers:
        (static, unit), (coulomb, _) = _one(numbers, "static"), _one(numbers, "coulomb")
        return f"{quantity(static, unit)} near standstill, {quantity(coulomb, unit)} beyond about {velocity}"
    amplitude, unit = _one(numbers, "amplitude")
    change = "more" if amplitude > 0 else "less"
    return f"{quantity(abs(amplitude), unit)} {change} friction near standstill, up to about {velocity}"


def delay(numbers: Sizes) -> str:
    value, unit = _one(numbers, "delay")
    return f"the forces come {quantity(abs(value), unit)} {'later' if value > 0 else 'earlier'} than the positions"


def sides(numbers: Sizes) -> str:
    """Return the two sides, positive before negative as in a description."""
    coulomb = numbers["coulomb"]
    pairs = list(zip(coulomb[::2], coulomb[1::2], strict=True))
    (one, unit), (other, _) = max(pairs, key=lambda pair: abs(pair[0][0] - pair[1][0]))
    return f"{quantity(one, unit)} in the positive direction, {quantity(other, unit)} in the negative one"


_OFF = {  # what is off; what a correction above 0 says, and one below 0
    "force_gain": ("force of tendon {tendon}", "reads {} too little", "reads {} too much"),
    "force_offset": ("zero of the force of tendon {tendon}", "{} too low", "{} too high"),
    "moment_arm": ("moment arm of tendon {tendon} at joint {joint}", "{} longer than described", "{} shorter"),
    "time_delay": ("forces", "{} later than positions", "{} earlier than positions"),
    "calibration": ("torque of tendon {tendon} at joint {joint}, force and arm together", "{} more", "{} less"),
}


def off_by(effect: str, joint: int | None, tendon: int | None, correction: Interval, unit: str) -> tuple[str, str]:
    """Return which sensor is off, and by how much, with the 95 % interval where it is known."""
    what, more, less = _OFF[effect]
    sign = 1.0 if correction.value >= 0.0 else -1.0
    ends = sorted((sign * correction.low, sign * correction.high))
    known = f" ({' to '.join(quantity(end, unit) for end in ends)})" if all(map(math.isfinite, ends)) else ""
    size = quantity(abs(correction.value), unit)
    return what.format(tendon=tendon, joint=joint), (more if sign > 0.0 else less).format(size) + known


def arm(numbers: Sizes) -> str:
    return f"{quantity(*_one(numbers, 'correction'), sign=True)} on the described arm"
