"""The judgement of reports, on reports that are made here."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from foreign_case import Truth
from judgement import ABSORBED, SYNONYMS, judge, visibility
from table_text import markdown, summary

Report = dict[str, Any]


def cause(effect: str, joint: int | None = None, tendon: int | None = None, **more: Any) -> Report:
    gain = {"value": 0.3, "interval": [0.2, 0.4]}
    return {"effect": effect, "joint": joint, "tendon": tendon, "gain": gain, "confusable_with": [], **more}


def report(*causes: Report, gain: float = 0.5) -> Report:
    return {
        "verdict": "explained",
        "nominal": {"test_rms": [0.003, 0.004]},
        "extended": {"test_rms": [0.0015, 0.002]},
        "gain": {"value": gain, "interval": [gain - 0.1, gain + 0.1]},
        "causes": list(causes),
    }


GRAVITY = Truth("gravity", 2, joint=1)


def test_the_truth_first_beside_presliding() -> None:
    judged = judge(report(cause("presliding"), cause("gravity", 1), cause("backlash", 2)), GRAVITY)
    assert judged.visible and judged.in_set and judged.first and judged.at_place
    assert judged.false == ("backlash",)
    assert judged.unnamed is None
    assert judged.error_ratio == pytest.approx(0.5)


def test_an_alternative_is_in_the_set_but_not_first() -> None:
    judged = judge(report(cause("cover_stiffness", 1, confusable_with=[{"effect": "gravity", "joint": 1}])), GRAVITY)
    assert judged.in_set and not judged.first and judged.at_place and judged.false == ()


def test_an_alternative_may_have_no_place() -> None:
    judged = judge(report(cause("cover_stiffness", 1, confusable_with=[{"effect": "gravity"}])), GRAVITY)
    assert judged.in_set and judged.at_place


def test_the_right_name_at_another_place() -> None:
    judged = judge(report(cause("gravity", 2)), GRAVITY)
    assert judged.in_set and judged.first and not judged.at_place and judged.false == ()


def test_one_of_several_places() -> None:
    judged = judge(report(cause("gravity", places=[{"joint": 2}, {"joint": 1}])), GRAVITY)
    assert judged.at_place


def test_a_wrong_name_alone() -> None:
    judged = judge(report(cause("time_delay")), GRAVITY)
    assert (judged.in_set, judged.first, judged.at_place, judged.false) == (False, False, False, ("time_delay",))


@pytest.mark.parametrize("names", [(), ("presliding",), ("presliding", "unknown")])
def test_nothing_hidden_nothing_named(names: tuple[str, ...]) -> None:
    judged = judge(report(*map(cause, names)), Truth("none", 2))
    assert judged.false == () and judged.in_set is None and judged.first is None and judged.visible is None


def test_what_a_simulator_has_anyway_is_not_false() -> None:
    assert judge(report(cause("stribeck")), Truth("none", 2, also=("stribeck",))).false == ()
    assert judge(report(cause("stribeck")), Truth("none", 2)).false == ("stribeck",)


def test_outside_the_list() -> None:
    hum = Truth("unknown_hum", 2, joint=2)
    for names in ((), ("presliding",), ("unknown",), ("contact", "unknown")):
        judged = judge(report(*map(cause, names)), hum)
        assert judged.unnamed and judged.false == () and judged.in_set is None
    judged = judge(report(cause("presliding"), cause("inertia", 1)), hum)
    assert judged.unnamed is False and judged.false == ("inertia",)


def test_contact_is_false_where_nobody_pushed_and_right_where_somebody_did() -> None:
    assert judge(report(cause("contact")), Truth("none", 2)).false == ("contact",)
    judged = judge(report(cause("contact")), Truth("contact", 2))
    assert judged.in_set and judged.first and judged.false == ()


def test_what_survives_refitting_by_less_than_a_tenth_of_the_residual_need_not_be_named() -> None:
    truth = Truth("gravity", joints=2, joint=2)
    assert visibility(truth) is True
    assert visibility(dataclasses.replace(truth, survives=0.2)) is True
    assert visibility(dataclasses.replace(truth, survives=0.05)) is None


@pytest.mark.parametrize("hidden", ABSORBED)
def test_what_refitting_absorbs_need_not_be_named(hidden: str) -> None:
    truth = Truth(hidden, 2, tendon=2)
    for causes in ((), (cause(hidden, tendon=2),)):
        judged = judge(report(*causes), truth)
        assert judged.visible is None and judged.in_set is None and judged.false == ()
    assert judge(report(cause("backlash")), truth).false == ("backlash",)


def test_synonyms_hold_at_the_same_place_only() -> None:
    edge = Truth("edge_friction", 3, joint=2, tendon=5)
    same = judge(report(cause("pulley_friction", 1, 5)), edge)
    assert same.in_set and same.first and same.at_place and same.false == ()
    for joint, tendon in ((2, 5), (1, 6), (None, 5)):
        assert judge(report(cause("pulley_friction", joint, tendon)), edge).false == ("pulley_friction",)
    loaded = Truth("joint_load_friction", 2, joint=1)
    assert judge(report(cause("load_friction", 1, 2)), loaded).first
    assert judge(report(cause("load_friction", 2, 2)), loaded).false == ("load_friction",)
    assert all(synonym.reason for synonym in SYNONYMS)


def test_what_is_alike_counts_only_where_the_report_says_so() -> None:
    rubbing = Truth("joint_friction", 2, joint=2)
    assert judge(report(cause("joint_load_friction", 2)), rubbing).false == ("joint_load_friction",)
    said = cause("joint_load_friction", 2, confusable_with=[{"effect": "joint_friction", "joint": 2}])
    assert judge(report(said), rubbing).false == ()


def test_gains_and_intervals() -> None:
    assert not judge(report(gain=-0.1), GRAVITY).gain_not_negative
    assert judge(report(gain=0.0), GRAVITY).gain_not_negative
    reaching = {"value": 0.1, "interval": [0.0, 0.2]}
    assert not judge(report(cause("gravity", 1, gain=reaching)), GRAVITY).intervals_positive
    assert judge(report(cause("unknown", gain=reaching)), GRAVITY).intervals_positive


def row(truth: Truth, found: Report | None) -> Report:
    return {
        "case": "made_01",
        "family": "made",
        "truth": dataclasses.asdict(truth),
        "visible": visibility(truth),
        "absorbed": truth.hidden in ABSORBED,
        "run": {"exit": 0 if found else 1, "message": "broken", "cpu_seconds": 4.0, "peak_megabytes": 300.0},
        "report": found,
        "judgement": dataclasses.asdict(judge(found, truth)) if found else None,
    }


def test_the_summary_counts_a_run_without_a_report_as_wrong() -> None:
    rows = [row(GRAVITY, report(cause("gravity", 1), cause("backlash", 2))), row(GRAVITY, None)]
    rows.append(row(Truth("none", 2), report(cause("presliding"))))
    found = summary(rows)
    assert found["runs that end with a report"] == "2 of 3"
    assert found["true cause in the set"] == found["true cause first beside presliding"] == "1 of 2"
    assert found["false causes per case"] == "0.50"
    assert found["nothing hidden, no false cause"] == "1 of 1"
    assert found["gain ≥ 0"] == "2 of 3"
    text = markdown(rows, "made")
    widths = {line.count("|") for line in text.split("##")[0].splitlines() if line.startswith("|")}
    assert len(widths) == 1
    assert "broken" in text and "gravity j1" in text
