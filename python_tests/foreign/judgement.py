"""Judges a report of `diagnose` (its diagnosis.json) by what the case hides. Pure functions of both.

Naming `presliding` is right in every case: no simulator's friction jumps at a reversal as the paper's laws do.
`unknown` names nothing, so it is never false either.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from foreign_case import Truth

Report = Mapping[str, Any]
Cause = Mapping[str, Any]

NEUTRAL = {"presliding", "unknown"}
TERMLESS = {"unknown", "contact"}  # findings without a term in the extended model have no gain of their own

VISIBLE = 0.1  # of the residual's variance: README of the recorded cases

# Effects that refitting the description's own numbers takes up, so that less than 0.1 of the residual's variance is
# left to see. Not naming them is right, naming them is right too; a wrong name counts as false as anywhere.
ABSORBED = {
    "inertia": "slow motion: a share of a mN·m, within the friction's own misfit (README of the recorded cases)",
    "force_gain": "a gain scales the friction of its tendon, and so do the laws (README of the recorded cases)",
    "asymmetric_friction": "the slow bias takes the mean of both directions (README of the recorded cases)",
    "moment_arm": "co-contraction makes it a nearly constant torque (README of the recorded cases)",
    "force_offset": "a constant torque and a constant angle: the bias and the covers' rest angles take them",
}


@dataclasses.dataclass(frozen=True)
class Synonym:
    """A name that stands for the same physics at the same place, so that it counts as the hidden effect itself.

    joint_shift: joint of the named effect less that of the hidden one. by_tendon: the tendon must be the same too.
    """

    hidden: str
    named: str
    joint_shift: int
    by_tendon: bool
    reason: str


# Every other alternative counts only where the report itself lists the hidden effect in `confusable_with`: for example
# joint_friction named as joint_load_friction, edge_friction or preload_friction (these grow with the tendon force or
# follow another velocity: a breathing pretension tells them apart), pulley_eccentricity named as moment_arm_variation
# (sine against line), cover_stiffness named as gravity, contact named as anything.
SYNONYMS = (
    Synonym("edge_friction", "pulley_friction", -1, True, "same velocity; the force differs by one friction, 2 %"),
    Synonym("pulley_friction", "edge_friction", 1, True, "same velocity; the force differs by one friction, 2 %"),
    Synonym(
        "joint_load_friction", "load_friction", 0, False, "friction of the joint under load, by all tendons or one"
    ),
)


@dataclasses.dataclass(frozen=True)
class Judgement:
    """What a report is worth. None: the question does not arise in this case.

    in_set: the hidden effect is a cause, or among the alternatives of one. first: it is the first cause beside the
    neutral ones. at_place: it is named where it is. false: names of causes that are neither. unnamed: an effect outside
    the list got no name beside neutral ones and `contact`. visible: the hidden effect survives refitting; None where it
    does not (ABSORBED) or nothing on the list is hidden.
    """

    visible: bool | None
    in_set: bool | None
    first: bool | None
    at_place: bool | None
    false: tuple[str, ...]
    unnamed: bool | None
    gain_not_negative: bool
    intervals_positive: bool
    error_ratio: float


def judge(report: Report, truth: Truth) -> Judgement:
    causes = report["causes"]
    outside = truth.hidden.startswith("unknown")
    visible = visibility(truth)
    named = [cause for cause in causes if cause["effect"] not in NEUTRAL]
    return Judgement(
        visible=visible,
        in_set=any(is_true(cause, truth) for cause in causes) if visible else None,
        first=bool(named) and is_named(named[0], truth) if visible else None,
        at_place=any(is_at_place(cause, truth) for cause in causes) if visible else None,
        false=tuple(cause["effect"] for cause in named if is_false(cause, truth)),
        unnamed=all(cause["effect"] == "contact" for cause in named) if outside else None,
        gain_not_negative=report["gain"]["value"] >= 0.0,
        intervals_positive=all(is_certain(cause) for cause in causes),
        error_ratio=error_ratio(report),
    )


def visibility(truth: Truth) -> bool | None:
    """True where an effect of the list is hidden and survives refitting, else None. The name of the effect decides, or
    where it was measured how much survives, that."""
    outside = truth.hidden.startswith("unknown")
    return None if truth.hidden == "none" or outside or is_absorbed(truth) else True


def is_absorbed(truth: Truth) -> bool:
    return truth.hidden in ABSORBED or (truth.survives is not None and truth.survives < VISIBLE)


def is_certain(cause: Cause) -> bool:
    return cause["effect"] in TERMLESS or cause["gain"]["interval"][0] > 0.0


def error_ratio(report: Report) -> float:
    """Error of the extended model over that of the nominal one, on the test recording, over all joints."""
    extended, nominal = (sum(r * r for r in report[model]["test_rms"]) for model in ("extended", "nominal"))
    return float((extended / nominal) ** 0.5) if nominal > 0.0 else 1.0


def is_named(cause: Cause, truth: Truth) -> bool:
    """The cause is the hidden effect, or a synonym of it at the same place."""
    return cause["effect"] == truth.hidden or any(is_synonym(place, truth) for place in places(cause))


def is_true(cause: Cause, truth: Truth) -> bool:
    """The cause, or an alternative that it lists, is the hidden effect."""
    return is_named(cause, truth) or any(is_named(each, truth) for each in alternatives(cause))


def is_false(cause: Cause, truth: Truth) -> bool:
    """A name that is neither hidden nor there anyway; what is on no list may look like a contact."""
    if cause["effect"] in NEUTRAL or cause["effect"] in truth.also or is_true(cause, truth):
        return False
    return not (truth.hidden.startswith("unknown") and cause["effect"] == "contact")


def is_at_place(cause: Cause, truth: Truth) -> bool:
    """The hidden effect is named, or is an alternative, where it is; a cause without a place is everywhere."""
    for each in (cause, *alternatives(cause)):
        for place in places(each):
            if is_synonym(place, truth) or (
                place["effect"] == truth.hidden
                and place.get("joint") in (None, truth.joint if truth.joint else place.get("joint"))
                and place.get("tendon") in (None, truth.tendon if truth.tendon else place.get("tendon"))
            ):
                return True
    return False


def is_synonym(place: Cause, truth: Truth) -> bool:
    return any(
        (synonym.hidden, synonym.named) == (truth.hidden, place["effect"])
        and truth.joint is not None
        and place.get("joint") == truth.joint + synonym.joint_shift
        and (not synonym.by_tendon or place.get("tendon") == truth.tendon)
        for synonym in SYNONYMS
    )


def alternatives(cause: Cause) -> Iterable[Cause]:
    return cause.get("confusable_with") or ()


def places(cause: Cause) -> list[Cause]:
    """Where a cause sits: its `places`, else its own joint and tendon."""
    own = {"effect": cause["effect"], "joint": cause.get("joint"), "tendon": cause.get("tendon")}
    return [{**own, **place} for place in cause.get("places") or ()] or [own]
