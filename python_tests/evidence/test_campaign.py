"""The campaign: which cases it has, what a row says, and what the table counts."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

from evidence.diagnosis.campaign import STRENGTHS, judged, markdown, planned, rates
from evidence.diagnosis.case import Case
from evidence.judge import Truth
from tendonfmu.diagnosis.cause import CausePlace, Where


def cause(effect: str, joint: int | None = 1, *others: Where, places: tuple[CausePlace, ...] = ()) -> Any:
    places = places or (CausePlace(joint, None, {}),)
    return SimpleNamespace(effect=effect, joint=joint, tendon=None, places=places, confusable_with=others)


def row(group: str, *truths: Truth, causes: tuple[Any, ...] = (), **more: Any) -> Any:
    """A row of a diagnosis that names these causes."""
    gain = SimpleNamespace(value=0.1, low=0.05, high=0.15)
    given = {"verdict": "explained", "events": (), "invisible": (), "gain": gain, "causes": causes, "too_small": ()}
    diagnosis: Any = SimpleNamespace(**(given | {key: more.pop(key) for key in tuple(more) if key in given}))
    case = Case("matched", {}, [], truths=truths)
    known = {"name": "a", "group": group, "rig": "matched", "joints": 1, "error": ""}
    known["true_effects"] = [effect for truth in truths for effect in truth.effects]
    return known | judged(group, case, diagnosis) | more


GRAVITY, INERTIA, OFFSET = Truth(("gravity",), 1), Truth(("inertia",), 1), Truth(("force_offset",), None, 2)


def counted(rows: list[Any]) -> dict[str, str]:
    return {line[0]: line[3] for line in rates(rows)}


# --- cases ------------------------------------------------------------------------------------------------------------


def test_a_campaign_that_is_cut_has_some_of_everything() -> None:
    plans = planned(7)
    assert len({plan.name for plan in plans}) == len(plans) == 940
    begun = plans[: len(plans) // 10]
    groups = Counter(plan.group for plan in begun)
    assert all(groups[name] >= least for name, least in {"null": 40, "single": 25, "double": 5, "absorbed": 7}.items())
    assert {*STRENGTHS} <= {plan.arguments.get("strength") for plan in begun}


def test_the_seed_gives_the_cases() -> None:
    plans, other = planned(7), planned(8)
    assert plans == planned(7) != other and {plan.name for plan in plans} >= {plan.name for plan in other[:100]}


# --- rows -------------------------------------------------------------------------------------------------------------


def test_one_effect_named_first_in_a_set_or_not_at_all() -> None:
    def answer(*causes: Any, **more: Any) -> tuple[Any, ...]:
        answers = row("single", GRAVITY, causes=causes, **more)
        return tuple(answers[key] for key in ("detected", "in_set", "first", "set_size", "place", "unknown"))

    assert answer(cause("gravity")) == (True, True, True, 1, True, False)
    assert answer(cause("gravity", 2)) == (True, True, True, 1, False, False)
    others = (Where("gravity", 1), Where("cover_stiffness", 1), Where("gravity", 2))
    assert answer(cause("joint_coupling", 1, *others)) == (True, True, False, 3, True, False)
    assert answer(cause("inertia")) == (True, False, False, 1, None, False)
    assert answer(verdict="unexplained") == (True, False, False, None, None, True)
    assert answer(too_small=(cause("gravity"),)) == (True, True, True, 1, True, False)
    assert answer(cause("inertia"), too_small=(cause("gravity"),)) == (True, True, False, 1, True, False)
    places = (CausePlace(2, None, {}), CausePlace(1, None, {}))
    assert answer(cause("gravity", None, places=places)) == (True, True, True, 1, True, False)


def test_two_effects_found_and_nothing_else() -> None:
    both = (cause("inertia"), cause("gravity"))
    assert row("double", GRAVITY, INERTIA, causes=both)["exactly"]
    three = row("double", GRAVITY, INERTIA, causes=(*both, cause("stribeck")))
    assert three["both"] and not three["exactly"]
    assert not row("double", GRAVITY, INERTIA, causes=both[:1])["both"]


def invisible(experiment: str) -> tuple[Any, ...]:
    return (SimpleNamespace(where=Where("force_offset", None, 2), experiment=experiment, motion={}),)


def test_absorbed_is_not_visible_with_an_experiment() -> None:
    listed = row("absorbed", OFFSET, invisible=invisible("change the pretension"))
    assert listed["not_visible"] and listed["experiment"]
    assert not row("absorbed", OFFSET)["not_visible"]
    assert not row("absorbed", OFFSET, invisible=invisible(""))["experiment"]


def test_unknown_is_said_or_a_name_is_wrong() -> None:
    def answer(*causes: Any, **more: Any) -> tuple[bool, bool]:
        answers = row("unknown", causes=causes, **more)
        return answers["wrong_name"], answers["unknown"]

    assert answer(cause("gravity")) == (True, False)
    assert answer(cause("gravity"), verdict="partly explained") == (False, True)
    assert answer(cause("gravity", 1, Where("unknown"))) == (False, True)


# --- the table --------------------------------------------------------------------------------------------------------


def test_the_gain_is_covered_where_the_interval_has_the_true_one() -> None:
    base = row("single", GRAVITY, causes=(cause("gravity"),), strength=0.1)
    known = counted([base | {"true_gain": true} for true in (0.1, 0.149, 0.2)])
    assert known["the gain's interval covers the true gain"] == "2/3"
    assert known["one effect at 0.1: true cause first"] == "3/3"


def test_an_absorbed_effect_that_no_motion_shows_is_not_asked_for() -> None:
    base = row("absorbed", OFFSET, invisible=invisible("change the pretension"), named_after_experiment=False)
    known = counted([base | {"shown_strength": strength} for strength in (1e-6, 0.29, 0.31)])
    assert known["absorbed by refitting: “not visible”, with an experiment"] == "3/3"
    assert known["the same where a motion shows it: named after the experiment"] == "0/1"


def test_a_case_that_failed_is_in_no_rate() -> None:
    text = markdown([row("null"), row("single", GRAVITY, causes=(cause("gravity"),)), {"name": "b", "error": "x"}])
    assert "| nothing hidden: a false cause | ≤ 1.5 % | 0.0 % | 0/1 |" in text
    assert "| gravity | 1 | 1 | 1 | 1 | 1/1 |" in text and "1 of 3 cases" in text
