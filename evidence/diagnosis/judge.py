"""What an answer of `diagnose` is worth, by what its case hides.

An answer is a list of causes as in diagnosis.json: `effect`, `joint`, `tendon`, `places`, `confusable_with`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Cause = Mapping[str, Any]

UNKNOWN = "unknown"
CALIBRATED = ("force_gain", "force_offset", "moment_arm", "time_delay")  # what `calibration` is made of
# Names of the same physics: (hidden, named) -> joint of the name less that of what is hidden, and whether the tendon
# has to be the same. Another alternative counts only where the report lists what is hidden in `confusable_with`.
SYNONYMS = {
    ("edge_friction", "pulley_friction"): (-1, True),  # same velocity; the force differs by one friction, 2 %
    ("pulley_friction", "edge_friction"): (1, True),
    ("joint_load_friction", "load_friction"): (0, False),  # of the joint under load, by all tendons or one
    **{(effect, "calibration"): (0, True) for effect in CALIBRATED},
}


@dataclass(frozen=True)
class Truth:
    """What a case hides, and which answers count."""

    effects: tuple[str, ...] = ()  # names that are right; empty: nothing of the list is hidden
    joint: int | None = None  # place, from 1; None: any
    tendon: int | None = None
    allowed: tuple[str, ...] = ()  # names that are not wrong either
    ignored: tuple[str, ...] = (UNKNOWN,)  # names that are no answer
    visible: bool = True  # whether these data can show it, so that it has to be named


def judge(causes: Sequence[Cause], truth: Truth, too_small: Sequence[Cause] = ()) -> dict[str, Any]:
    """Columns of a case's row; None: the question does not arise."""
    every = [*causes, *too_small]
    named = [cause for cause in every if cause["effect"] not in truth.ignored]
    right = [cause for cause in every if holds(cause, truth)]
    is_asked = bool(truth.effects) and truth.visible
    has_place = truth.joint is not None or truth.tendon is not None
    return {
        "right": bool(right) if is_asked else None,
        "is_cause": any(cause in right for cause in causes) if is_asked else None,
        "first": any(is_true(cause, truth) for cause in named[:1]) if is_asked else None,
        "at_place": any(is_at_place(cause, truth) for cause in right) if is_asked and right and has_place else None,
        "wrong": [
            cause["effect"]
            for cause in causes
            if cause in named and cause not in right and cause["effect"] not in truth.allowed
        ],
    }


def holds(cause: Cause, truth: Truth) -> bool:
    """Whether the cause, or an alternative that it lists, is what is hidden."""
    return any(is_true(statement, truth) for statement in statements(cause))


def is_true(statement: Cause, truth: Truth) -> bool:
    return statement["effect"] in truth.effects or any(is_synonym(place, truth) for place in places(statement))


def is_at_place(cause: Cause, truth: Truth) -> bool:
    """A true name at the truth's place; a cause without a place is everywhere, and so is a truth without one."""
    return any(
        is_synonym(place, truth) or (place["effect"] in truth.effects and agrees(place, truth))
        for statement in statements(cause)
        for place in places(statement)
    )


def agrees(place: Cause, truth: Truth) -> bool:
    pairs = ((place["joint"], truth.joint), (place["tendon"], truth.tendon))
    return all(None in pair or pair[0] == pair[1] for pair in pairs)


def is_synonym(place: Cause, truth: Truth) -> bool:
    for effect in truth.effects:
        shift, by_tendon = SYNONYMS.get((effect, place["effect"]), (None, False))
        if shift is None or (truth.joint is None and effect not in CALIBRATED):
            continue
        joint = None if truth.joint is None else truth.joint + shift
        if place["joint"] == joint and (not by_tendon or place["tendon"] == truth.tendon):
            return True
    return False


def statements(cause: Cause) -> Iterator[Cause]:
    """The cause, and those that it may be confused with."""
    yield cause
    yield from cause.get("confusable_with") or ()


def places(cause: Cause) -> list[Cause]:
    """Where a cause is: its `places`, else its own joint and tendon."""
    whole = {"effect": cause["effect"], "joint": cause.get("joint"), "tendon": cause.get("tendon")}
    return [{**whole, **place} for place in cause.get("places") or ()] or [whole]


def in_words(cause: Cause) -> str:
    """An effect and its place in a few signs: gravity j1, edge_friction j2 t3."""
    signs = [f"{sign}{cause[key]}" for key, sign in (("joint", "j"), ("tendon", "t")) if cause.get(key)]
    return " ".join([cause["effect"], *signs])


def leaves_unnamed(report: Mapping[str, Any]) -> bool:
    """Whether the report says that something is there that it cannot name."""
    first = [cause["effect"] for leading in report["causes"][:1] for cause in statements(leading)]
    return report["verdict"] in ("unexplained", "partly explained") or UNKNOWN in first
