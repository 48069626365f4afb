"""Which numbers a finger description has, what is taken where it leaves them out, and their paths.

A path, such as `tendons[1].edge_friction[2].coulomb`, is that of the parsed JSON and of the FMU's parameters. Indices
count from 1.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import count, takewhile
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.model.native import Parameter

# Generated from the tables in runtime/description by `python tools/tables/generate.py`; SI units.
_TABLE = json.loads((files("tendonfmu") / "schema" / "description_numbers.json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class EffectNumber:
    """A number of an extension, in SI units."""

    least: float  # its range
    most: float
    missing: float | None  # its value where it is left out; None if it is required
    scale: float  # magnitude that matters on a hand of human size; 0: it is chosen, not estimated


Law = Mapping[str, Any]
LAW_NUMBERS = ("static", "coulomb", "stribeck_velocity", "viscous")  # of a law, or of each of its sides


DEFAULTS: Mapping[str, float] = _TABLE["defaults"]  # by path
RANGES: Mapping[str, tuple[float, float]] = {path: (least, most) for path, (least, most) in _TABLE["ranges"].items()}
LIMITS: Mapping[str, int] = _TABLE["limits"]  # largest number of each in one description
NEVER = 1e9  # N·m; no contact threshold is ever passed
DETECTING = ("contact", "sensor_fault", "estimated")  # what is no part of the friction model
# By effect, in the order of the FMU's parameters.
EFFECT_NUMBERS: Mapping[str, Mapping[str, EffectNumber]] = {
    effect: {key: EffectNumber(**number) for key, number in numbers.items()}
    for effect, numbers in _TABLE["effects"].items()
}

# What is taken where the description leaves a number out, if not 0. As long as it is that, a fit leaves it alone.
LEFT_OUT: Mapping[str, float] = {
    name: number.missing for numbers in EFFECT_NUMBERS.values() for name, number in numbers.items() if number.missing
}


def extension_rows(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the extensions of a description."""
    return list(data.get("extensions") or [])


def place_of(row: Mapping[str, Any]) -> str:
    """Describe an extension as an appendix to a text."""
    where = ", ".join(f"{key} {row[key]}" for key in ("joint", "tendon", "level") if row.get(key) is not None)
    return f", of {row['effect']}" + (f" at {where}" if where else "")


def extended_row(data: Mapping[str, Any], effect: str, place: Any) -> Mapping[str, Any] | None:
    """Return the last extension of an effect at a place."""
    rows = [row for row in extension_rows(data) if row["effect"] == effect]
    at = [row for row in rows if (row.get("joint"), row.get("tendon")) == (place.joint, place.tendon)]
    return at[-1] if at else None


def number_of(data: Mapping[str, Any], path: str) -> float:
    """Return a number of a finger description, or its default where it is left out."""
    node: Any = data
    for key in path.split("."):
        node = (node or {}).get(key)
    return DEFAULTS[path] if node is None else float(node)


def bias_is_constant(data: Mapping[str, Any]) -> bool:
    """Return whether the bias learns nothing."""
    return number_of(data, "bias.drift_variance") == 0.0 and (data.get("bias") or {}).get("initial_variance") == 0.0


def own_copy(data: Mapping[str, Any]) -> dict[str, Any]:
    """Copy a description so that no two laws are the same object, as in JSON data built by a program."""
    copied: dict[str, Any] = json.loads(json.dumps(data))
    return copied


def get_number(data: Any, path: str) -> Any:
    """Return a number, or another part, of a parsed description."""
    for step in steps_of(path):
        data = data[step]
    return data


def set_number(data: Any, path: str, value: Any) -> None:
    """Set a number, or another part, of a parsed description in place."""
    *way, last = steps_of(path)
    for step in way:
        data = data[step]
    data[last] = value


def without_detection(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description of the friction model alone: nothing is detected, and nothing says what was estimated."""
    nothing = {"threshold": [NEVER] * len(data["joints"])}  # in the place of what is given: keys keep their order
    kept = {key: value for key, value in data.items() if key == "contact" or key not in DETECTING}
    return {**kept, "contact": nothing}


# --- paths ------------------------------------------------------------------------------------------------------------


Step = str | int  # a key, or an index from 0

_PATH = re.compile(r"[a-z_]+(\[[1-9][0-9]*\])*(\.[a-z_]+(\[[1-9][0-9]*\])*)*")
_LAW = re.compile(
    r"(?P<effect>joints\[(?P<joint>\d+)\]\.(?P<own>friction|load_friction)"
    r"|tendons\[(?P<tendon>\d+)\]\.(?P<along>edge_friction|pulley_friction)\[(?P<at>\d+)\])"
    r"(?:\.laws\[(?P<point>\d+)\])?(?:\.(?P<side>positive|negative))?(?:\.(?P<number>[a-z_]+))?"
)
_PADDED = ("pulley_friction", "edge_friction")  # short lists stand for lists with null at the end


@dataclass(frozen=True)
class LawPath:
    """The parts of the path of a friction law, or of a number in one; indices count from 1."""

    effect: str  # path of the effect, such as `tendons[1].edge_friction[2]`
    kind: str  # friction, load_friction, edge_friction or pulley_friction
    joint: int
    tendon: int | None
    point: int | None  # which of its `laws`, by the angle
    side: str | None  # positive or negative
    number: str | None


def steps_of(path: str) -> list[Step]:
    """Split a path into keys and indices."""
    return [int(index) - 1 if index else name for name, index in re.findall(r"([a-z_]+)|\[(\d+)\]", path)]


def part_of(path: str) -> tuple[str, int, str] | None:
    """Split the path of a number of a joint or tendon: `joints` or `tendons`, its number, and the rest of the path."""
    found = re.match(r"(joints|tendons)\[(\d+)\]\.?", path)
    return None if found is None else (found[1], int(found[2]), path[found.end() :])


def law_path(path: str) -> LawPath | None:
    """Split the path of a law or of a number in one; None if it is another path."""
    found = _LAW.fullmatch(path)
    if found is None:
        return None
    tendon, point = (None if found[name] is None else int(found[name]) for name in ("tendon", "point"))
    joint = int(found["joint"] or found["at"])
    return LawPath(
        found["effect"], found["own"] or found["along"], joint, tendon, point, found["side"], found["number"]
    )


def with_values_at(data: dict[str, Any], values: Mapping[str, Any], numbers: Mapping[str, Parameter]) -> dict[str, Any]:
    """Write values into a description, in place, and return it. numbers: those of the finger that it describes."""
    joints = len(data["joints"])
    for path, value in values.items():
        if not isinstance(path, str) or not _PATH.fullmatch(path):
            raise InputError(f"{path!r}: expected a path such as tendons[1].stiffness or contact.threshold[1]")
        steps = steps_of(path)
        place: Any = data
        for k in range(len(steps) - 1):
            place = _entered(place, steps, k, numbers, joints)
        _check_step(place, steps, len(steps) - 1, joints)
        place[steps[-1]] = value
    return data


def _entered(place: Any, steps: Sequence[Step], k: int, numbers: Mapping[str, Parameter], joints: int) -> Any:
    """Return what is at a step. It is made if it is absent: a list is that which the model assumes."""
    _check_step(place, steps, k, joints)
    step = steps[k]
    found = place.get(step) if isinstance(step, str) else place[step]
    if found is None:
        found = {}
        if isinstance(steps[k + 1], int):
            listed = takewhile(numbers.__contains__, (f"{_text(steps[: k + 1])}[{j}]" for j in count(1)))
            found = [None] * joints if step in _PADDED else [numbers[each].start for each in listed]
        place[step] = found
    return found


def _check_step(place: Any, steps: Sequence[Step], k: int, joints: int) -> None:
    """Raise InputError if a step does not lead from a place to another one."""
    step, path = steps[k], _text(steps[: k + 1])
    if isinstance(step, str):
        if not isinstance(place, dict):
            raise InputError(f"{path}: no such path; {_text(steps[:k])} has no keys")
        return
    if not isinstance(place, list):
        raise InputError(f"{path}: no such path; {_text(steps[:k])} is no list")
    if k and steps[k - 1] in _PADDED:
        place += [None] * (joints - len(place))
    if step >= len(place):
        expected = f"1 to {len(place)}" if place else "no index, since the list is empty"
        raise InputError(f"{path}: no such path; expected {expected}")


def _text(steps: Sequence[Step]) -> str:
    return "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in steps).lstrip(".")
