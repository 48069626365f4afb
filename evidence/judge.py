"""What an answer of `diagnose` is worth, by what its case hides.

An answer is a list of causes as in diagnosis.json: `effect`, `joint`, `tendon`, `places`, `confusable_with`, and for a
change `reference` and `now`. A cause that is `unknown` names nothing, so it is neither right nor false.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Cause = Mapping[str, Any]

UNKNOWN = "unknown"
FRICTION = (
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
class Synonym:
    """A name that stands for the same physics at the same place, so that it counts as the hidden effect itself."""

    hidden: str
    named: str
    joint_shift: int  # joint of the named effect less that of the hidden one
    by_tendon: bool  # whether the tendon has to be the same


CALIBRATED = ("force_gain", "force_offset", "moment_arm", "time_delay")  # what `calibration` is made of
# Every other alternative counts only where the report itself lists the hidden effect in `confusable_with`.
SYNONYMS = (
    Synonym("edge_friction", "pulley_friction", -1, True),  # same velocity; the force differs by one friction, 2 %
    Synonym("pulley_friction", "edge_friction", 1, True),
    Synonym("joint_load_friction", "load_friction", 0, False),  # of the joint under load, by all tendons or one
    *(Synonym(effect, "calibration", 0, True) for effect in CALIBRATED),
)


@dataclass(frozen=True)
class Truth:
    """What a case hides, and which answers count."""

    effects: tuple[str, ...] = ()  # names that are the truth; empty: nothing is hidden, or nothing that the list has
    joint: int | None = None  # place, from 1; None: any
    tendon: int | None = None
    allowed: tuple[str, ...] = ()  # names that are not false either
    neutral: tuple[str, ...] = (UNKNOWN,)  # names that do not count as an answer
    synonyms: tuple[Synonym, ...] = ()
    signs: Mapping[str, int] = field(default_factory=dict)  # of now less reference, by effect
    visible: bool = True  # whether these data can show it, so that it has to be named

    @property
    def has_place(self) -> bool:
        return self.joint is not None or self.tendon is not None


@dataclass(frozen=True)
class Judgement:
    """None: the question does not arise."""

    named: tuple[str, ...]  # names that count as an answer, in order
    false: tuple[str, ...]  # of these, the ones that neither are the truth, nor list it, nor are allowed
    friction: tuple[str, ...]  # of the false ones
    unknown: bool  # something is reported without a name
    in_set: bool | None  # the truth is named, or may be confused with something that is
    first: bool | None  # the first name is the truth
    at_place: bool | None  # the truth is named, or is an alternative, at its joint and tendon
    sign: bool | None  # the first cause that is the truth by its own name changes the right way
    set_size: int | None  # effects in the set that has the truth, or else in the first one


def judge(causes: Sequence[Cause], truth: Truth) -> Judgement:
    holding = [cause for cause in causes if holds(cause, truth)]
    counted = [cause for cause in causes if cause["effect"] not in truth.neutral]
    asked = bool(truth.effects) and truth.visible
    shown = [*holding, *counted][:1]
    false = [cause["effect"] for cause in counted if cause not in holding and cause["effect"] not in truth.allowed]
    return Judgement(
        named=tuple(cause["effect"] for cause in counted),
        false=tuple(false),
        friction=tuple(effect for effect in false if effect in FRICTION),
        unknown=any(cause["effect"] == UNKNOWN for cause in causes),
        in_set=bool(holding) if asked else None,
        first=any(is_truth(cause, truth) for cause in counted[:1]) if asked else None,
        at_place=any(is_at_place(cause, truth) for cause in causes) if asked else None,
        sign=_sign_is_right(holding, truth),
        set_size=len(effects_of(shown[0])) if shown else None,
    )


def holds(cause: Cause, truth: Truth) -> bool:
    """Whether the cause, or an alternative that it lists, is the hidden effect."""
    return any(is_truth(statement, truth) for statement in (cause, *alternatives(cause)))


def is_truth(statement: Cause, truth: Truth) -> bool:
    names = (*truth.effects, *CALIBRATED) if "calibration" in truth.effects else truth.effects
    return statement["effect"] in names or any(_is_synonym(place, truth) for place in places(statement))


def is_at_place(cause: Cause, truth: Truth) -> bool:
    """A true name at the truth's place; a cause without a place is everywhere, and so is a truth without one."""
    return any(
        _is_synonym(place, truth) or (place["effect"] in truth.effects and _agrees(place, truth))
        for statement in (cause, *alternatives(cause))
        for place in places(statement)
    )


def _agrees(place: Cause, truth: Truth) -> bool:
    pairs = ((place.get("joint"), truth.joint), (place.get("tendon"), truth.tendon))
    return all(None in pair or pair[0] == pair[1] for pair in pairs)


def _is_synonym(place: Cause, truth: Truth) -> bool:
    return any(
        synonym.hidden in truth.effects
        and synonym.named == place["effect"]
        and (truth.joint is not None or synonym.hidden in CALIBRATED)
        and place.get("joint") == (None if truth.joint is None else truth.joint + synonym.joint_shift)
        and (not synonym.by_tendon or place.get("tendon") == truth.tendon)
        for synonym in truth.synonyms
    )


def alternatives(cause: Cause) -> Sequence[Cause]:
    return cause.get("confusable_with") or ()


def effects_of(cause: Cause) -> set[str]:
    return {cause["effect"], *(other["effect"] for other in alternatives(cause))}


def places(cause: Cause) -> list[Cause]:
    """Where a cause is: its `places`, else its own joint and tendon."""
    whole = {"effect": cause["effect"], "joint": cause.get("joint"), "tendon": cause.get("tendon")}
    return [{**whole, **place} for place in cause.get("places") or ()] or [whole]


def _sign_is_right(holding: Iterable[Cause], truth: Truth) -> bool | None:
    for cause in holding:
        before, after = (_number(cause.get(key)) for key in ("reference", "now"))
        expected = truth.signs.get(cause["effect"]) if cause["effect"] in truth.effects else None
        if expected is not None and before is not None and after is not None:
            return (after - before) * expected > 0.0
    return None


def _number(size: Any) -> float | None:
    """A size as a number, or as an object with its `value`."""
    value = size.get("value") if isinstance(size, Mapping) else size
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
