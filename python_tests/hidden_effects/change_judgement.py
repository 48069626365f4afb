"""What a report of `diagnose` (its diagnosis.json) is worth, by the truth of a case of a change. Pure functions.

`unknown` names nothing, so it is neither right nor false; how often it stands in a report is counted apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from change_case import NOTHING, Truth

Report = Mapping[str, Any]
Cause = Mapping[str, Any]

UNKNOWN = "unknown"
# A change of load that no sensor shows is a constant torque: these answers say so. Names of friction are wrong there.
LOAD = ("contact", "force_offset", "gravity")
RUBBING = (
    "viscous_friction",
    "stribeck",
    "asymmetric_friction",
    "edge_friction",
    "pulley_friction",
    "joint_friction",
    "joint_load_friction",
    "preload_friction",
    "load_friction",
    "presliding",
    "friction_drift",
)


@dataclass(frozen=True)
class Judgement:
    """None: the question does not arise.

    named: causes beside unknown. false: of these the names that are neither the truth nor allowed, nor list the truth
    among what they may be confused with. friction: false ones that are names of friction. unknown: it is in the report.
    in_set: the truth is a cause or may be confused with one. first: the first cause's own name is the truth. at_place:
    the truth is named, or is an alternative, at its joint and tendon. sign: now less reference of the first cause that
    is the truth by its own name goes the right way; None where there is none, or it says no sizes. set_size: number of
    names in the set that holds the truth.
    """

    named: tuple[str, ...]
    false: tuple[str, ...]
    friction: tuple[str, ...]
    unknown: bool
    in_set: bool | None
    first: bool | None
    at_place: bool | None
    sign: bool | None
    set_size: int | None


def judge(report: Report, truth: Truth) -> Judgement:
    causes = [cause for cause in report["causes"] if cause["effect"] != UNKNOWN]
    holding = [cause for cause in causes if holds(cause, truth)]
    false = tuple(cause["effect"] for cause in causes if cause not in holding and cause["effect"] not in truth.also)
    asked = bool(truth.effects) and truth.visible
    return Judgement(
        named=tuple(cause["effect"] for cause in causes),
        false=false,
        friction=tuple(effect for effect in false if effect in RUBBING),
        unknown=len(causes) < len(report["causes"]),
        in_set=bool(holding) if asked else None,
        first=any(cause["effect"] in truth.effects for cause in causes[:1]) if asked else None,
        at_place=any(is_there(cause, truth) for cause in causes) if asked and has_place(truth) else None,
        sign=sign_is_right(holding, truth),
        set_size=len(names(holding[0])) if holding else None,
    )


def alternatives(cause: Cause) -> Iterable[Cause]:
    return cause.get("confusable_with") or ()


def names(cause: Cause) -> set[str]:
    return {cause["effect"], *(each["effect"] for each in alternatives(cause))}


def holds(cause: Cause, truth: Truth) -> bool:
    return bool(names(cause) & set(truth.effects))


def has_place(truth: Truth) -> bool:
    return truth.hidden != NOTHING and (truth.joint is not None or truth.tendon is not None)


def is_there(cause: Cause, truth: Truth) -> bool:
    """A true name at the truth's place; a cause without a place is everywhere, and so is a truth without one."""
    return any(
        place["effect"] in truth.effects
        and (None in (place.get("joint"), truth.joint) or place["joint"] == truth.joint)
        and (None in (place.get("tendon"), truth.tendon) or place["tendon"] == truth.tendon)
        for each in (cause, *alternatives(cause))
        for place in places(each)
    )


def places(cause: Cause) -> list[Cause]:
    own = {"effect": cause["effect"], "joint": cause.get("joint"), "tendon": cause.get("tendon")}
    return [{**own, **place} for place in cause.get("places") or ()] or [own]


def sign_is_right(holding: Iterable[Cause], truth: Truth) -> bool | None:
    for cause in holding:
        wanted = truth.signs.get(cause["effect"])
        changed = change_of(cause)
        if wanted is not None and cause["effect"] in truth.effects and changed is not None:
            return changed * wanted > 0.0
    return None


def change_of(cause: Cause) -> float | None:
    """Size now less size then; None where the report has not both as numbers."""
    before, after = (number(cause.get(key)) for key in ("reference", "now"))
    return None if before is None or after is None else after - before


def number(size: Any) -> float | None:
    """A size as a number, or as an object with its `value`."""
    value = size.get("value") if isinstance(size, Mapping) else size
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
