"""A diagnosis held against what was hidden: the answers of one case as columns of a campaign's table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from tendonfmu.campaign_cases import NOT_IN_MODEL, Case, Truth
from tendonfmu.diagnosis_result import Cause, Diagnosis, Where

ALARMS = ("unexplained", "partly explained")


def judge(case: Case, found: Diagnosis) -> dict[str, Any]:
    """One row: what was reported, and how it stands to the truth. None where a question does not arise.

    detected: something is reported to be missing. in_set: the true effect is a reported cause or in the confusion set
    of one. first: it is the first cause. set_size: effects of the set that has it, or of the first cause. place: of
    the named effect, joint and tendon are the true ones. both, exactly: all that is hidden, and nothing else.
    not_visible: the effect is listed as such, and not as a cause; experiment: with one. unknown: the verdict leaves
    something unexplained, or the first cause's own set says unknown. wrong_name: an effect is named that is not
    there, and the verdict calls everything explained.
    """
    causes = [cause for cause in found.causes if cause.where.effect not in NOT_IN_MODEL]
    row: dict[str, Any] = {
        "verdict": found.verdict,
        "causes": json.dumps([_listed(cause) for cause in found.causes]),
        "cause_count": len(causes),
        "p_value": causes[0].p_value if causes else None,
        "detected": bool(causes) or found.verdict in ALARMS,
        "unexplained_share": found.unexplained.share,
        "gain": found.gain.value,
        "gain_low": found.gain.low,
        "gain_high": found.gain.high,
        "tested": found.tested,
        "events": len(found.events),
        "diagnosis_seconds": found.seconds,
    }
    row |= dict.fromkeys(("in_set", "first", "set_size", "place", "both", "exactly", "not_visible", "experiment"))
    row |= {"unknown": _says_unknown(found), "wrong_name": bool(causes) and not _says_unknown(found)}
    truths = [truth for truth in case.truth if truth.effect not in NOT_IN_MODEL]
    if case.group == "single":
        row |= _single(truths[0], causes)
    if case.group == "double":
        hits = [any(_names(cause, truth.effect) for cause in causes) for truth in truths]
        row |= {"both": all(hits), "exactly": all(hits) and len(causes) == len(truths)}
    if case.group in ("single", "absorbed"):
        row |= _invisible(truths[0], found, causes)
    return row


def judge_names(case: Case, names: Sequence[Where]) -> dict[str, Any]:
    """The same questions for a rival that only names causes, the first one first."""
    row: dict[str, Any] = {"cause_count": len(names), "detected": bool(names), "wrong_name": bool(names)}
    row |= dict.fromkeys(("in_set", "first", "place", "both", "exactly"))
    truths = [truth for truth in case.truth if truth.effect not in NOT_IN_MODEL]
    effects = [where.effect for where in names]
    if case.group == "single":
        truth = truths[0]
        row |= {"in_set": truth.effect in effects, "first": effects[:1] == [truth.effect]}
        named = [where for where in names if where.effect == truth.effect][:1]
        row |= {"place": (named[0].joint, named[0].tendon) == (truth.joint, truth.tendon)} if named else {}
    if case.group == "double":
        both = all(truth.effect in effects for truth in truths)
        row |= {"both": both, "exactly": both and len(names) == len(truths)}
    return row


def _listed(cause: Cause) -> dict[str, Any]:
    return {
        **_place(cause.where),
        "p": cause.p_value,
        "gain": cause.gain.value,
        "set": [_place(each) for each in cause.confusable_with],
    }


def _place(where: Where) -> dict[str, Any]:
    return {"effect": where.effect, "joint": where.joint, "tendon": where.tendon}


def _names(cause: Cause, effect: str) -> bool:
    return effect == cause.where.effect or any(each.effect == effect for each in cause.confusable_with)


def _set_size(cause: Cause) -> int:
    return len({cause.where.effect, *(each.effect for each in cause.confusable_with)})


def _single(truth: Truth, causes: Sequence[Cause]) -> dict[str, Any]:
    if not causes:
        return {"in_set": False, "first": False}
    holder = next((cause for cause in causes if _names(cause, truth.effect)), None)
    first = causes[0].where.effect == truth.effect
    found = {"in_set": holder is not None, "first": first, "set_size": _set_size(holder or causes[0])}
    if holder is not None:
        named = [w for w in (holder.where, *holder.confusable_with) if w.effect == truth.effect]
        if holder.where.effect == truth.effect:
            named = named[:1]  # what it says first is what counts
        found["place"] = any((w.joint, w.tendon) == (truth.joint, truth.tendon) for w in named)
    return found


def _invisible(truth: Truth, found: Diagnosis, causes: Sequence[Cause]) -> dict[str, Any]:
    listed = [each for each in found.invisible if each.where.effect == truth.effect]
    here = [each for each in listed if (each.where.joint, each.where.tendon) == (truth.joint, truth.tendon)]
    named = any(cause.where.effect == truth.effect for cause in causes)
    return {
        "not_visible": bool(here or listed) and not named,
        "experiment": any(bool(each.experiment) for each in here or listed),
    }


def _says_unknown(found: Diagnosis) -> bool:
    named_unknown = any(_names(cause, "unknown") for cause in found.causes[:1])
    return found.verdict in ALARMS or named_unknown
