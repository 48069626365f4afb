"""Whether a diagnosis names what was hidden: the answers of one case as columns of a campaign's table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tendonfmu.diagnosis.campaign.cases import NOT_IN_MODEL, Case, Truth
from tendonfmu.diagnosis.result import Cause, Diagnosis, FoundPlace, Where

ALARMS = ("unexplained", "partly explained")
QUESTIONS = ("in_set", "first", "set_size", "place", "both", "exactly", "not_visible", "experiment")


@dataclass(frozen=True)
class Answer:
    """What a rival says of a case."""

    names: Sequence[Where] = ()  # causes, the first one first
    one_of: bool = False  # whether it says only that one of them is present; none of several is then first
    alarm: bool | None = None  # whether something is missing, with or without a name; None if it does not say
    gain: float | None = None  # 1 − rms ratio of its model and the nominal one on the tests; None if it has no model


def judge(case: Case, found: Diagnosis) -> dict[str, Any]:
    """Return a row with what was reported and how it compares with the truth; None for questions that do not apply."""
    row = judge_causes(case, found.causes)
    unknown = found.verdict in ALARMS or any(_names(cause, "unknown") for cause in found.causes[:1])
    row |= {
        "verdict": found.verdict,
        "detected": row["detected"] or found.verdict in ALARMS,
        "unknown": unknown,
        "wrong_name": row["cause_count"] > 0 and not unknown,
        "unexplained_share": found.unexplained.share,
        "gain": found.gain.value,
        "gain_low": found.gain.low,
        "gain_high": found.gain.high,
        "tested": found.tested,
        "events": len(found.events),
        "diagnosis_seconds": found.seconds,
    }
    if case.group in ("single", "absorbed"):
        row |= _invisible(_hidden(case)[0], found)
    return row


def judge_causes(case: Case, causes: Sequence[Cause]) -> dict[str, Any]:
    """Return the answers that follow from the names alone."""
    # - detected: a cause is reported; - in_set: the true effect is a cause or in the confusion set of one; - first: it
    # is the first cause; - set_size: number of effects in the set that contains it, or in that of the first cause; -
    # place: the true joint and tendon are among the places of the named effect; None for the whole finger; - both:
    # everything hidden is named; exactly: nothing else is named, either.
    own = [cause for cause in causes if cause.where.effect not in NOT_IN_MODEL and not _is_there_anyway(cause, case)]
    row: dict[str, Any] = {
        "causes": json.dumps([_listed(cause) for cause in causes]),
        "cause_count": len(own),
        "named_count": len(causes),
        "p_value": own[0].p_value if own else None,
        "detected": bool(own),
    }
    row |= dict.fromkeys((*QUESTIONS, "unknown", "wrong_name"))
    if case.group == "single":
        row |= _single(_hidden(case)[0], own)
    if case.group == "double":
        hits = [any(_names(cause, truth.effect) for cause in own) for truth in _hidden(case)]
        row |= {"both": all(hits), "exactly": all(hits) and len(own) == len(hits)}
    return row


def judge_names(case: Case, said: Sequence[Where] | Answer) -> dict[str, Any]:
    """Return the same answers for a rival; `said` is its answer, or only the causes that it names."""
    answer = said if isinstance(said, Answer) else Answer(said)
    names, effects = answer.names, list(dict.fromkeys(where.effect for where in answer.names))
    row: dict[str, Any] = {
        "causes": json.dumps([_place(where) for where in names]),
        "cause_count": 1 if answer.one_of and names else len(names),
        "detected": bool(names) or bool(answer.alarm),
        "wrong_name": bool(names),
        "unknown": None if answer.alarm is None else answer.alarm and not names,
        "gain": answer.gain,
    }
    row |= dict.fromkeys(("in_set", "first", "place", "set_size", "both", "exactly"))
    if case.group == "single":
        truth = _hidden(case)[0]
        row |= {"in_set": truth.effect in effects, "first": effects[:1] == [truth.effect]}
        if answer.one_of:
            row |= {"first": effects == [truth.effect], "set_size": len(effects) if effects else None}
        own = _of(names, truth.effect)[: None if answer.one_of else 1]
        row |= {"place": any(_is_at(each, truth) for each in own)} if own else {}
    if case.group == "double":
        both = all(truth.effect in effects for truth in _hidden(case))
        row |= {"both": both, "exactly": both and len(names) == len(case.truth)}
    return row


def _is_there_anyway(cause: Cause, case: Case) -> bool:
    """Return whether the rig has the effect in addition to what is hidden."""
    effect = cause.where.effect
    return effect in case.also and effect not in (truth.effect for truth in case.truth)


def _hidden(case: Case) -> list[Truth]:
    return [truth for truth in case.truth if truth.effect not in NOT_IN_MODEL]


def _listed(cause: Cause) -> dict[str, Any]:
    places = [{"joint": each.joint, "tendon": each.tendon} for each in cause.places]
    return {
        **_place(cause.where),
        "p": cause.p_value,
        "gain": cause.gain.value,
        "places": places,
        "set": [_place(each) for each in cause.confusable_with],
    }


def _place(where: Where) -> dict[str, Any]:
    return {"effect": where.effect, "joint": where.joint, "tendon": where.tendon}


def _is_at(where: Where | FoundPlace, truth: Truth) -> bool:
    return (where.joint, where.tendon) == (truth.joint, truth.tendon)


def _names(cause: Cause, effect: str) -> bool:
    return effect == cause.where.effect or any(each.effect == effect for each in cause.confusable_with)


def _of(wheres: Sequence[Where], effect: str) -> list[Where]:
    return [each for each in wheres if each.effect == effect]


def _single(truth: Truth, causes: Sequence[Cause]) -> dict[str, Any]:
    if not causes:
        return {"in_set": False, "first": False}
    holder = next((cause for cause in causes if _names(cause, truth.effect)), None)
    shown = holder or causes[0]
    size = len({shown.where.effect, *(each.effect for each in shown.confusable_with)})
    row = {"in_set": holder is not None, "first": causes[0].where.effect == truth.effect, "set_size": size}
    if holder is not None and (truth.joint, truth.tendon) != (None, None):
        # only the first statement of a cause counts
        own = holder.places if holder.where.effect == truth.effect else _of(holder.confusable_with, truth.effect)
        row["place"] = any(_is_at(each, truth) for each in own)
    return row


def _invisible(truth: Truth, found: Diagnosis) -> dict[str, Any]:
    listed = [each for each in found.invisible if each.where.effect == truth.effect]
    named = any(cause.where.effect == truth.effect for cause in found.causes)
    return {
        "not_visible": bool(listed) and not named,
        "experiment": any(bool(each.experiment) for each in listed),
    }
