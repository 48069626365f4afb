"""Campaigns: cases read and refused, run once and resumed, judged, and counted."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from command import Call
from dask_on_loopback import dask_processes
from repository_paths import TESTS
from tendonfmu.diagnosis.campaign import campaign as campaigns
from tendonfmu.diagnosis.campaign.campaign import collect, run_campaign, still_to_do
from tendonfmu.diagnosis.campaign.cases import Case, Truth, made, read_cases
from tendonfmu.diagnosis.campaign.judging import judge, judge_names
from tendonfmu.diagnosis.campaign.rates import markdown, mean, rate, rates, rates_by_part, rivals_of, seen_by
from tendonfmu.diagnosis.result import (
    Cause,
    Diagnosis,
    Experiment,
    FoundPlace,
    Invisible,
    ModelErrors,
    Unexplained,
    Where,
)
from tendonfmu.errors import InputError
from tendonfmu.statistics.intervals import Interval
from tendonfmu.tasks.jobs import workers_of

ERRORS = ModelErrors((0.002,), (0.002,))
GAIN = Interval(0.1, 0.05, 0.15)


def cause(
    effect: str, joint: int | None = 1, others: tuple[Where, ...] = (), places: tuple[FoundPlace, ...] = ()
) -> Cause:
    return Cause(
        where=Where(effect, joint, None),
        title="",
        explanation="",
        p_value=1e-4,
        gain=GAIN,
        confusable_with=others,
        parameters={},
        size="",
        places=places or (FoundPlace(joint, None, {}),),
    )


def diagnosis(*causes: Cause, verdict: str = "explained", invisible: tuple[Invisible, ...] = ()) -> Diagnosis:
    return Diagnosis(
        finger="finger",
        verdict=verdict,
        recordings=("r",),
        tests=(),
        held_out=True,
        seconds=1.0,
        seed=0,
        signals="raw signals",
        least_gain=0.03,
        nominal=ERRORS,
        extended=ERRORS,
        bias_only_rms=(0.1,),
        noise_floor=(0.002,),
        floor_source="",
        gain=GAIN,
        steps=(),
        causes=causes,
        too_small=(),
        invisible=invisible,
        events=(),
        unexplained=Unexplained(0.0, ""),
        experiment=Experiment(""),
        views=(),
        whiteness=(),
        detection=None,
        nominal_data={},
        extended_data={},
    )


def case(group: str, *truth: Truth) -> Case:
    return Case("a", group, Path(), truth=truth)


def written(folder: Path, *cases: dict[str, Any]) -> Path:
    file = folder / "cases.json"
    file.write_text(json.dumps({"format": "tendonfmu-campaign-1", "cases": list(cases)}), encoding="utf-8")
    return file


GOOD = {"name": "a", "group": "null", "finger": "f.json", "recordings": ["r.csv"]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "../a"}, "cases[1].name"),
        ({"group": "some"}, "cases[1].group"),
        ({"recordings": []}, "cases[1].recordings"),
        ({"recordings": "r.csv"}, "cases[1].recordings"),
        ({"kinematics": 4}, "cases[1].kinematics"),
        ({"truth": [{"effect": "gravity"}]}, "expected 0 effects for the group null"),
        ({"group": "double", "truth": [{"effect": "gravity"}]}, "expected 2 effects"),
        ({"group": "single", "truth": [{"effect": "gravity", "joint": 0}]}, "cases[1].truth[1].joint = 0"),
        ({"facts": {"strength": [1]}}, "cases[1].facts.strength"),
        ({"also": "inertia"}, "cases[1].also"),
        ({"reference": ["r.csv"]}, "cases[1].reference"),
        ({"wrong": 1}, "cases[1].wrong"),
        ({"maker": "cases:make"}, "cases[1].maker"),
        ({"arguments": {"seed": 1}}, "cases[1].arguments"),
    ],
)
def test_bad_cases_are_refused_by_path(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refused:
        read_cases(written(tmp_path, GOOD | change))
    assert message in str(refused.value) and "expected" in str(refused.value) and "\n" not in str(refused.value)


def test_names_are_unique(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cases\[2\].name"):
        read_cases(written(tmp_path, GOOD, GOOD))


def test_a_maker_writes_the_files_of_its_case(tmp_path: Path) -> None:
    (tmp_path / "maker.py").write_text(
        "def make(folder, size):\n"
        "    (folder / 'f.json').write_text('{}')\n"
        "    return {'finger': 'f.json', 'recordings': ['r.csv'], 'facts': {'size': size},\n"
        "            'truth': [{'effect': 'gravity', 'joint': 2}]}\n",
        encoding="utf-8",
    )
    listed = read_cases(
        written(tmp_path, {"name": "a", "group": "single", "maker": "maker.py:make", "arguments": {"size": 3}})
    )
    folder = tmp_path / "here"
    folder.mkdir()
    found = made(listed[0], folder)
    assert found.finger == folder / "f.json" and (folder / "f.json").is_file()
    assert found.truth == (Truth("gravity", 2),) and found.facts == {"size": 3.0}
    with pytest.raises(InputError, match="no function"):
        made(Case("a", "null", tmp_path, maker="maker.py:other"), folder)


def test_a_campaign_is_resumed_and_survives_a_case_that_fails(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []

    def run(case: Case, how: campaigns.How) -> dict[str, Any]:
        ran.append(case.name)
        if case.name == "b":
            raise ValueError("bad")
        return campaigns.known_of(case) | judge(case, diagnosis()) | {"gain": math.nan}

    monkeypatch.setattr(campaigns, "run_case", run)
    cases = read_cases(written(tmp_path, *({**GOOD, "name": name} for name in "abc")))
    output = tmp_path / "out"
    assert run_campaign(cases[:2], output, None) == 2
    assert [each.name for each in still_to_do(cases, output)] == ["c"]
    assert run_campaign(cases, output, None) == 1
    assert [each.name for each in still_to_do(cases, output, failed_again=True)] == ["b"]
    assert run_campaign(cases, output, None, failed_again=True, stop_after=0.0) == 0
    assert ran == ["a", "b", "c"]
    rows = collect(cases, output)
    assert [row["name"] for row in rows] == ["a", "b", "c"] and rows[0]["gain"] is None
    assert (output / "campaign.parquet").is_file()
    assert [(each.hits, each.cases) for each in rates(rows)[:1]] == [(0, 2)]
    assert "1 of 3 cases ended in an error" in markdown(rows)
    answer = call("campaign", "cases.json", "-o", "out", "--stop-after", "0", "--json")
    report = json.loads(answer.out)
    assert answer.status == 1 and answer.err.splitlines()[0].startswith("tendonfmu: warning: b: ")
    assert (report["format"], report["cases"], report["rows"]) == ("tendonfmu-campaign-rates-1", 3, 3)
    assert list(report["errors"]) == ["b"] and "bad" in report["errors"]["b"]
    assert (report["rates"][0]["hits"], report["rates"][0]["cases"]) == (0, 2)


@pytest.mark.long
def test_workers_of_dask_write_the_rows(tmp_path: Path) -> None:
    """Real worker processes; their case fails at once, for its recording is not there, and says so."""
    pytest.importorskip("distributed", reason="SKIPPED: dask and distributed are not installed")
    cases = read_cases(written(tmp_path, {**GOOD, "name": "a"}, {**GOOD, "name": "b"}))
    with workers_of(count=1) as client:
        assert run_campaign(cases, tmp_path / "out", client) == 2
    rows = collect(cases, tmp_path / "out")
    assert [row["name"] for row in rows] == ["a", "b"]
    assert all("f.json" in row["error"] and row["run_seconds"] >= 0 for row in rows)


@pytest.mark.long
def test_a_worker_of_a_cluster_dies_and_every_case_is_counted_once(tmp_path: Path) -> None:
    """Diagnoses on two workers that are processes of their own on the loopback; one is killed after the first row."""
    pytest.importorskip("distributed", reason="SKIPPED: dask and distributed are not installed")
    maker = TESTS / "hidden_effects" / "cases.py"
    options = {"joints": 1, "seconds": 12.0, "rate": 250.0}
    cases = read_cases(
        written(
            tmp_path,
            *(
                {"name": f"null_{k}", "group": "null", "maker": f"{maker}:null", "arguments": {"seed": k, **options}}
                for k in range(6)
            ),
        )
    )
    with dask_processes(2) as processes, workers_of(processes.address) as client:
        client.wait_for_workers(2, timeout=30)

        def kill_after_one(done: int, total: int) -> None:
            if done == 1:
                processes.workers[0].kill()

        assert run_campaign(cases, tmp_path / "out", client, progress=kill_after_one) == 6
        assert processes.workers[0].poll() is not None
    rows = collect(cases, tmp_path / "out")
    assert [row["name"] for row in rows] == [each.name for each in cases]
    assert not any(row["error"] for row in rows) and rates(rows)[0].cases == 6


# --- judging ----------------------------------------------------------------------------------------------------------


def test_a_cause_where_nothing_is_hidden_is_false() -> None:
    assert judge(case("null"), diagnosis(verdict="adequate"))["cause_count"] == 0
    row = judge(case("null"), diagnosis(cause("gravity")))
    assert row["cause_count"] == 1 and row["detected"]


def test_one_effect_named_first_in_a_set_or_not_at_all() -> None:
    truth = Truth("gravity", 1)
    row = judge(case("single", truth), diagnosis(cause("gravity")))
    assert (row["in_set"], row["first"], row["set_size"], row["place"]) == (True, True, 1, True)
    row = judge(case("single", truth), diagnosis(cause("gravity", joint=2)))
    assert (row["in_set"], row["place"]) == (True, False)
    others = (Where("gravity", 1), Where("cover_stiffness", 1), Where("gravity", 2))
    row = judge(case("single", truth), diagnosis(cause("joint_coupling", others=others)))
    assert (row["in_set"], row["first"], row["set_size"], row["place"]) == (True, False, 3, True)
    row = judge(case("single", truth), diagnosis(cause("inertia")))
    assert (row["detected"], row["in_set"], row["first"], row["place"]) == (True, False, False, None)
    row = judge(case("single", truth), diagnosis(verdict="unexplained"))
    assert (row["detected"], row["in_set"], row["unknown"]) == (True, False, True)


def test_one_effect_at_many_places_is_right_where_the_true_one_is_among_them() -> None:
    truth = Truth("load_friction", 1, 2)
    places = (FoundPlace(1, 1, {}), FoundPlace(1, 2, {}))
    row = judge(case("single", truth), diagnosis(cause("load_friction", joint=1, places=places)))
    assert row["place"]
    assert json.loads(row["causes"])[0]["places"] == [{"joint": 1, "tendon": 1}, {"joint": 1, "tendon": 2}]
    row = judge(case("single", truth), diagnosis(cause("load_friction", joint=1, places=places[:1])))
    assert row["in_set"] and not row["place"]


def test_what_the_rig_has_anyway_is_neither_right_nor_false() -> None:
    anyway = ("presliding", "inertia")
    null = Case("a", "null", Path(), also=anyway)
    row = judge(null, diagnosis(cause("presliding"), cause("inertia")))
    assert (row["cause_count"], row["named_count"]) == (0, 2)
    assert judge(null, diagnosis(cause("presliding"), cause("gravity")))["cause_count"] == 1
    single = Case("a", "single", Path(), truth=(Truth("gravity", 1),), also=anyway)
    row = judge(single, diagnosis(cause("presliding"), cause("gravity")))
    assert (row["in_set"], row["first"], row["cause_count"]) == (True, True, 1)
    hidden = Case("a", "single", Path(), truth=(Truth("inertia", 1),), also=anyway)
    assert judge(hidden, diagnosis(cause("inertia")))["in_set"]


def test_an_effect_of_the_whole_finger_has_no_place_to_be_right_about() -> None:
    row = judge(case("single", Truth("time_delay")), diagnosis(cause("time_delay", joint=None)))
    assert row["in_set"] and row["place"] is None


def test_rivals_are_asked_the_same(tmp_path: Path) -> None:
    names = [Where("gravity", 2), Where("inertia", 1)]
    row = judge_names(case("single", Truth("inertia", 1)), names)
    assert (row["in_set"], row["first"], row["place"], row["cause_count"]) == (True, False, True, 2)
    assert judge_names(case("double", Truth("gravity", 1), Truth("inertia", 1)), names)["exactly"]
    rows = [
        judge(case("null"), diagnosis(verdict="adequate"))
        | {"group": "null", "error": ""}
        | {f"bic.{key}": value for key, value in judge_names(case("null"), names[:k]).items()}
        for k in (0, 1)
    ]
    assert rivals_of(rows) == ["bic"]
    assert [(rates(each)[0].hits, rates(each)[0].cases) for each in (rows, seen_by(rows, "bic"))] == [(0, 2), (1, 2)]
    assert "The same by bic" in markdown(rows)


def test_two_effects_found_and_nothing_else() -> None:
    truth = (Truth("gravity", 1), Truth("inertia", 1))
    assert judge(case("double", *truth), diagnosis(cause("inertia"), cause("gravity")))["exactly"]
    row = judge(case("double", *truth), diagnosis(cause("inertia"), cause("gravity"), cause("stribeck")))
    assert row["both"] and not row["exactly"]
    assert not judge(case("double", *truth), diagnosis(cause("inertia")))["both"]


def test_absorbed_is_not_visible_with_an_experiment() -> None:
    truth = Truth("force_offset", None, 2)
    listed = (Invisible(Where("force_offset", None, 2), "", 0.001, "change the pretension"),)
    row = judge(case("absorbed", truth), diagnosis(verdict="adequate", invisible=listed))
    assert row["not_visible"] and row["experiment"]
    assert not judge(case("absorbed", truth), diagnosis(verdict="adequate"))["not_visible"]
    silent = (Invisible(Where("force_offset", None, 2), "", 0.001, ""),)
    assert not judge(case("absorbed", truth), diagnosis(invisible=silent))["experiment"]


def test_unknown_is_said_or_a_name_is_wrong() -> None:
    truth = Truth("unknown")
    row = judge(case("unknown", truth), diagnosis(cause("gravity")))
    assert row["wrong_name"] and not row["unknown"]
    row = judge(case("unknown", truth), diagnosis(cause("gravity"), verdict="partly explained"))
    assert not row["wrong_name"] and row["unknown"]
    row = judge(case("unknown", truth), diagnosis(cause("gravity", others=(Where("unknown"),))))
    assert not row["wrong_name"] and row["unknown"]


# --- counting ---------------------------------------------------------------------------------------------------------


def test_rates_have_exact_intervals() -> None:
    found = rate("x", "", [{"a": k < 3} for k in range(10)], lambda row: row["a"])
    assert (found.hits, found.cases) == (3, 10)
    assert (found.low, found.high) == (pytest.approx(0.0667, abs=1e-4), pytest.approx(0.6525, abs=1e-4))
    assert rate("x", "", [], lambda row: True).cells()[3] == "0"
    assert mean("x", "", [1.0, 2.0, 3.0]).value == 2.0


def test_the_gain_is_covered_where_the_interval_has_the_true_one() -> None:
    base = judge(case("single", Truth("gravity", 1)), diagnosis(cause("gravity")))
    rows = [base | {"group": "single", "error": "", "strength": 0.1, "true_gain": true} for true in (0.1, 0.149, 0.2)]
    line = next(each for each in rates(rows) if "covers" in each.what)
    assert (line.hits, line.cases) == (2, 3)
    first = next(each for each in rates(rows) if each.what == "one effect at 0.1: true cause first")
    assert (first.hits, first.cases) == (3, 3)


def test_rates_by_rig_and_joints_where_there_are_several() -> None:
    def null(rig: str, joints: float, *causes: Cause) -> dict[str, Any]:
        row = judge(case("null"), diagnosis(*causes)) | {"true_gain": 0.2}
        return row | {"group": "null", "error": "", "rig": rig, "joints": joints}

    rows = [null("matched", 1.0), null("matched", 2.0), null("numpy", 2.0, cause("gravity"))]
    lines = {each.what: (each.hits, each.cases) for each in rates_by_part(rows)}
    assert lines["nothing hidden: a false cause; matched"] == (0, 2)
    assert lines["nothing hidden: a false cause; numpy"] == (1, 1)
    assert lines["nothing hidden: a false cause; 1 joint"] == (0, 1)
    assert lines["nothing hidden: a false cause; 2 joints"] == (1, 2)
    # the gain of a case without a cause is 0 by construction: it is no question
    assert lines["the gain's interval covers the true gain; numpy"] == (0, 1)
    assert "the gain's interval covers the true gain; matched" not in lines
    assert not rates_by_part(rows[:1]) and "; 2 joints |" in markdown(rows)


def test_an_absorbed_effect_that_no_motion_shows_is_not_asked_for() -> None:
    truth = Truth("force_offset", None, 2)
    listed = (Invisible(Where("force_offset", None, 2), "", 0.001, "change the pretension"),)
    row = judge(case("absorbed", truth), diagnosis(verdict="adequate", invisible=listed))
    row |= {"group": "absorbed", "error": "", "named_after_experiment": False}
    rows = [row | {"shown_strength": strength} for strength in (1e-6, 0.29, 0.31)] + [row]
    by_name = {each.what: (each.hits, each.cases) for each in rates(rows)}
    assert by_name["absorbed by refitting: “not visible”, with an experiment"] == (4, 4)
    assert by_name["the same where a motion shows it: named after the experiment"] == (0, 2)
