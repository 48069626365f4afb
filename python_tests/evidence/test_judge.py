"""The judge of a diagnosis, on answers that are made here."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from evidence.diagnosis.foreign_cases import ABSORBED, truth_of
from evidence.fingers import foreign
from evidence.judge import SYNONYMS, Truth, judge

GRAVITY = Truth(("gravity",), joint=1)
MORE_FRICTION = Truth(("joint_friction", "preload_friction"), joint=1, tendon=1, signs={"joint_friction": 1})


def cause(effect: str, joint: int | None = None, tendon: int | None = None, **more: Any) -> dict[str, Any]:
    return {"effect": effect, "joint": joint, "tendon": tendon, "confusable_with": [], **more}


def alternative(*effects: str, joint: int | None = None) -> list[dict[str, Any]]:
    return [{"effect": effect, "joint": joint, "tendon": None} for effect in effects]


# causes, and what they are worth where gravity is hidden at joint 1: in the set, first, at its place, set, false names
ANSWERS: dict[str, tuple[list[dict[str, Any]], tuple[Any, ...]]] = {
    "the truth first": ([cause("gravity", 1), cause("backlash", 2)], (True, True, True, 1, ("backlash",))),
    "an alternative": (
        [cause("cover_stiffness", 1, confusable_with=alternative("gravity", joint=1))],
        (True, False, True, 2, ()),
    ),
    "an alternative without a place": (
        [cause("cover_stiffness", 1, confusable_with=alternative("gravity"))],
        (True, False, True, 2, ()),
    ),
    "the truth second": ([cause("inertia", 1), cause("gravity", 1)], (True, False, True, 1, ("inertia",))),
    "another place": ([cause("gravity", 2)], (True, True, False, 1, ())),
    "one of several places": ([cause("gravity", places=[{"joint": 2}, {"joint": 1}])], (True, True, True, 1, ())),
    "a wrong name": ([cause("time_delay")], (False, False, False, 1, ("time_delay",))),
    "unknown names nothing": ([cause("unknown")], (False, False, False, None, ())),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_one_hidden_effect(name: str) -> None:
    causes, expected = ANSWERS[name]
    judgement = judge(causes, GRAVITY)
    assert (
        judgement.in_set,
        judgement.first,
        judgement.at_place,
        judgement.set_size,
        judgement.false,
    ) == expected
    assert judgement.unknown == (name == "unknown names nothing")


def test_several_sensors_stand_for_one_at_its_place_and_one_for_several() -> None:
    several = cause("calibration", places=[{"joint": None, "tendon": 2}, {"joint": 1, "tendon": 2}])
    one = Truth(("force_gain",), tendon=2, synonyms=SYNONYMS)
    assert judge([several], one).at_place and not judge([several], one).false
    assert not judge([several], replace(one, tendon=3)).in_set
    assert judge([cause("moment_arm", 1, 2)], Truth(("calibration",))).first


def test_nothing_hidden() -> None:
    judgement = judge([cause("gravity", 1)], Truth())
    assert (judgement.in_set, judgement.first, judgement.at_place) == (None, None, None)
    assert judgement.named == judgement.false == ("gravity",)


def test_what_cannot_be_seen_is_not_asked_for() -> None:
    judgement = judge([cause("inertia")], replace(GRAVITY, visible=False))
    assert judgement.in_set is None and judgement.first is None and judgement.false == ("inertia",)


def test_what_is_allowed_is_neither_right_nor_false() -> None:
    judgement = judge([cause("stribeck"), cause("load_friction")], Truth(allowed=("stribeck",)))
    assert judgement.named == ("stribeck", "load_friction")
    assert judgement.false == judgement.friction == ("load_friction",)


@pytest.mark.parametrize(
    ("sizes", "right"),
    [
        ({"reference": 1.0, "now": 1.3}, True),
        ({"reference": 1.3, "now": 1.0}, False),
        ({"reference": {"value": 2.0, "interval": [1, 3]}, "now": {"value": 2.5, "interval": [1, 4]}}, True),
        ({"reference": None, "now": 2.0}, None),
        ({}, None),
    ],
)
def test_the_sign_of_a_change(sizes: dict[str, Any], right: bool | None) -> None:
    assert judge([cause("joint_friction", 1, **sizes)], MORE_FRICTION).sign is right
    other = cause("edge_friction", 1, confusable_with=alternative("joint_friction"), **sizes)
    assert judge([other], MORE_FRICTION).sign is None  # only a name of its own has a size


def test_synonyms_hold_at_the_same_place_only() -> None:
    edge = Truth(("edge_friction",), joint=2, tendon=5, synonyms=SYNONYMS)
    same = judge([cause("pulley_friction", 1, 5)], edge)
    assert same.in_set and same.first and same.at_place and same.false == ()
    for joint, tendon in ((2, 5), (1, 6), (None, 5)):
        assert judge([cause("pulley_friction", joint, tendon)], edge).false == ("pulley_friction",)
    loaded = Truth(("joint_load_friction",), joint=1, synonyms=SYNONYMS)
    assert judge([cause("load_friction", 1, 2)], loaded).first
    assert judge([cause("load_friction", 2, 2)], loaded).false == ("load_friction",)


# --- foreign fingers --------------------------------------------------------------------------------------------------


def test_presliding_of_a_foreign_finger_is_neither_right_nor_false() -> None:
    causes = [cause("presliding"), cause("gravity", 1)]
    assert judge(causes, truth_of(foreign.Truth("gravity", 2, joint=1))).first
    assert judge(causes[:1], truth_of(foreign.Truth("none", 2))).false == ()


def test_what_is_on_no_list_may_look_like_a_contact() -> None:
    hum = truth_of(foreign.Truth("unknown_hum", 2, joint=2))
    judgement = judge([cause("contact"), cause("unknown"), cause("inertia", 1)], hum)
    assert judgement.in_set is None and judgement.false == ("inertia",)
    assert judge([cause("contact")], truth_of(foreign.Truth("none", 2))).false == ("contact",)
    assert judge([cause("contact")], truth_of(foreign.Truth("contact", 2))).first


@pytest.mark.parametrize("hidden", ABSORBED)
def test_what_refitting_absorbs_need_not_be_named(hidden: str) -> None:
    truth = truth_of(foreign.Truth(hidden, 2, tendon=2))
    for causes in ([], [cause(hidden, tendon=2)]):
        assert judge(causes, truth).in_set is None and judge(causes, truth).false == ()
