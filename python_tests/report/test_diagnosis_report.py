"""The report and the words of a diagnosis: complete, true to it, and with sizes in units that suit."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.resources import files as files_of
from typing import Any

import jsonschema
import pytest

import diagnosis_examples as examples
from tendonfmu.diagnosis.effects import title_of
from tendonfmu.diagnosis.names import reported_causes, size_of
from tendonfmu.diagnosis.result import CausePlace, Diagnosis, ModelErrors
from tendonfmu.files import report_text
from tendonfmu.report.diagnosis_files import build_report
from tendonfmu.report.diagnosis_page import diagnosis_page
from tendonfmu.report.diagnosis_text import headline, left_of, left_sentence, lines, tables, unit_of
from tendonfmu.report.diagnosis_types import EFFECTS
from tendonfmu.report.kit import percent, percent_interval, probability
from tendonfmu.statistics.intervals import Interval

MOVING = {"velocity_threshold": {"tendon": 5e-4, "joint": 0.01}, "extensions": [{"effect": "presliding"}] * 3}
SCHEMA = json.loads((files_of("tendonfmu") / "schema" / "diagnosis.schema.json").read_text("utf-8"))


def parsed(diagnosis: Diagnosis) -> Any:
    """The report after a journey through its text."""
    return json.loads(report_text(build_report(diagnosis, ["diagnosis.html"])))


# --- the report -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", examples.ALL)
def test_the_report_is_as_contract_and_schema_say(name: str) -> None:
    found = examples.ALL[name]()
    report = parsed(found)
    jsonschema.validate(report, SCHEMA)
    for key in ("verdict", "kind", "least_gain"):
        assert report[key] == getattr(found, key)
    assert report["delivered"]["extended"]["test_rms"] == list(found.delivered[1].test_rms)
    assert report["nominal"]["bias_only_rms"] == list(found.bias_only_rms)
    assert report["gain"] == {"value": found.gain.value, "interval": [found.gain.low, found.gain.high]}
    assert report["next_experiment"] == found.experiment.sentence
    named, without_term = report["causes"][: len(found.causes)], report["causes"][len(found.causes) :]
    touched = (found.load is not None) + (found.event_gain is not None)
    expected = ["contact"] * touched + ["unknown"] * found.unexplained.unknown
    assert [entry["effect"] for entry in without_term] == expected
    assert all(entry["gain"]["interval"][0] > 0 for entry in report["causes"])
    for entry, cause in zip(named, found.causes, strict=True):
        assert tuple(entry[key] for key in ("effect", "joint", "tendon")) == tuple(vars(cause.where).values())
        assert entry["parameters"] == {path: value for path, (value, _) in cause.parameters.items()}
        assert entry["parameters"] == {path: v for place in entry["places"] for path, v in place["parameters"].items()}
        assert entry["intervals"] == {path: [size.low, size.high] for path, size in cause.intervals.items()}
        assert entry["intervals"] == {
            path: ends for place in entry["places"] for path, ends in place["intervals"].items()
        }
        places = [(place["joint"], place["tendon"]) for place in entry["places"]]
        assert places == [(place.joint, place.tendon) for place in cause.places]
        rivals = [other["effect"] for other in entry["confusable_with"]]
        assert rivals == [other.effect for other in cause.confusable_with]
    first, *steps = report["waterfall"]
    assert (first["effect"], first["rms"]) == (None, found.steps[0])
    assert [(step["effect"], step["rms"]) for step in steps] == [
        (cause.where.effect, rms) for cause, rms in zip(found.causes, found.steps[1:], strict=True)
    ]


def test_a_change_is_reported_then_and_now() -> None:
    report = parsed(examples.changed())
    assert report["references"] == ["march_1.parquet"] and report["repeated"] == 1
    number, term, load = report["causes"]
    assert (number["number"], number["unit"], number["reference"], number["now"]) == ("coulomb", "1", 0.03, 0.036)
    assert number["change"]["value"] == pytest.approx(0.006)
    assert number["now_interval"] == pytest.approx([0.0356, 0.0364])
    assert [size["value"] for size in number["by_recording"]] == [0.033, 0.036, 0.039]
    assert number["evidence"][0]["reference"][-1] is None and number["evidence"][0]["reference"][0] is not None
    assert term["reference"] == 0.0 and term["now"] == term["change"]["value"] and term["by_recording"] == []
    assert load["effect"] == "contact" and load["change"]["value"] == pytest.approx(0.0494)
    assert "force_offset" in [other["effect"] for other in load["confusable_with"]]


def test_what_is_too_small_has_no_numbers_and_what_is_uncertain_an_experiment(full: Diagnosis) -> None:
    report = parsed(full)
    (small,), (uncertain,) = report["too_small"], report["uncertain"]
    assert small["effect"] == "inertia" and small["parameters"] == {} and small["gain"]["interval"][0] > 0
    assert uncertain["effect"] == "gravity" and "90 s" in uncertain["experiment"]
    assert uncertain["gain"]["interval"][0] < 0
    (line,) = (line for line in lines(full) if line.startswith("uncertain"))
    assert "joint 1" in line and line.endswith(uncertain["experiment"])
    # what would not matter even then is in the report alone
    other = replace(full, uncertain=(replace(full.uncertain[0], gain=Interval(0.01, -0.03, 0.05)),))
    assert len(parsed(other)["uncertain"]) == 1 and not [line for line in lines(other) if line.startswith("uncertain")]


def test_contact_and_unknown_are_causes_only_where_their_gain_is_certain(full: Diagnosis) -> None:
    assert [cause.where.effect for cause in reported_causes(full)[-2:]] == ["contact", "unknown"]
    assert reported_causes(full)[-2].where.joint is None  # events at both joints
    one = replace(full, events=(full.events[0], replace(full.events[1], peak=0.01)))
    assert reported_causes(one)[-2].where.joint == 2  # of the one event that is large enough
    doubtful = replace(full, event_gain=Interval(0.2, 0.05, 0.4), unexplained=replace(full.unexplained, unknown=False))
    assert reported_causes(doubtful) == list(full.causes)
    small = replace(full, events=(replace(full.events[0], peak=0.01),))
    assert "contact" not in {cause.where.effect for cause in reported_causes(small)}


def test_what_is_not_known_is_null() -> None:
    nothing = Interval(math.nan, -math.inf, math.inf)
    report = parsed(replace(examples.one_cause(), noise_floor=(math.nan, 1e-3), gain=nothing))
    jsonschema.validate(report, SCHEMA)
    assert report["noise_floor"] == [None, 1e-3] and report["gain"] == {"value": None, "interval": [None, None]}


# --- words ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("load_friction", {"coulomb": (8.1e-5, "m")}, "81 µN·m"),
        ("preload_friction", {"coulomb": (0.2, "N"), "beyond": (-0.1, "1")}, "0.2 N of friction, −0.1 times"),
        ("pulley_eccentricity", {"sine": (3e-4, "m"), "cosine": (4e-4, "m"), "turns": (8.97, "1")}, "0.5 mm, 8.97 ti"),
        ("gravity", {"sine": (0.03, "N.m"), "cosine": (-0.04, "N.m")}, "50 mN·m"),
        ("presliding", {"displacement": (3.2e-4, "m")}, "over 0.32 mm at tendons"),
        ("presliding", {"displacement": (0.03, "s")}, "15 µm at tendons, 0.3 mrad at joints"),
        ("time_delay", {"delay": (-8e-4, "s")}, "0.8 ms earlier"),
        ("force_gain", {"correction": (-0.021, "1")}, "2.1 % smaller"),
        ("moment_arm", {"correction": (-2.5e-4, "m")}, "−0.25 mm"),
        ("inertia", {"inertia": (1.2e-5, "kg.m2")}, "1.2·10⁻⁵ kg·m²"),
        ("edge_friction", {"a.coulomb": (0.021, "1"), "b.coulomb": (0.03, "1")}, "up to 3 %"),
        (
            "asymmetric_friction",
            {"positive.coulomb": (0.02, "N.m"), "negative.coulomb": (0.03, "N.m")},
            "20 mN·m in the positive direction, 30 mN·m",
        ),
        ("friction_drift", {"amplitude": (-0.18, "1")}, "amplitude −18 %"),
    ],
)
def test_a_size_is_told_in_units_that_suit(effect: str, numbers: dict[str, tuple[float, str]], words: str) -> None:
    place = CausePlace(1, None, {f"extensions[1].{name}": number for name, number in numbers.items()})
    assert words in size_of(effect, [place], MOVING).replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("preload_friction", [(0.2, "N"), (0.5, "N"), (0.1, "N")], "0.5 N of friction at the largest of 3 places"),
        ("preload_friction", [(0.2, "N"), (0.2, "N")], "0.2 N of friction, at each of 2 places"),
        ("presliding", [(0.03, "s"), (1.3e-3, "rad")], "15 µm at tendons, 0.3 mrad at joints; different at 1 place"),
    ],
)
def test_the_size_of_several_places(effect: str, numbers: list[tuple[float, str]], words: str) -> None:
    name = "displacement" if effect == "presliding" else "coulomb"
    places = [CausePlace(None, k, {f"extensions[{k}].{name}": number}) for k, number in enumerate(numbers, start=1)]
    assert words in size_of(effect, places, MOVING).replace("\u00a0", " ")
    assert size_of(effect, [replace(place, parameters={}) for place in places], MOVING) == ""


@pytest.mark.parametrize(("floor", "left"), [(1.9e-3, (2.0, 1.9, 0.1)), (2.0e-3, (2.0, 2.0, 0.0)), (math.nan, None)])
def test_what_is_left_and_the_noise_floor_add_up(floor: float, left: tuple[float, ...] | None) -> None:
    one = examples.one_cause()
    errors = replace(one.extended, test_rms=(2.0e-3, 2.0e-3))
    found = replace(one, extended=errors, noise_floor=(floor, floor))
    parts = left_of(found)
    assert (parts is None) == (left is None) == (left_sentence(found) == "")
    if parts is not None:
        assert (parts.whole, parts.noise, parts.predictable) == pytest.approx(left)


@pytest.mark.parametrize(
    ("white", "memory"),
    [((0.08, 0.3), ""), ((0.7, 0.3), "28 ms"), ((0.7, 0.9), "95 ms"), ((0.7, 0.999), "1 s or more")],
)
def test_a_correlated_remainder_is_not_called_noise(white: tuple[float, float], memory: str) -> None:
    """A correlation of c after 10 ms lasts 10 ms/ln(1/c)."""
    found = replace(examples.one_cause(), noise_floor=examples.one_cause().extended.test_rms)
    views = [view for k, share in enumerate(white, start=1) for view in examples.views_of(k, 1e-3, {}, share)]
    found = replace(found, views=tuple(views))
    left = left_of(found)
    assert left is not None and left.memory.startswith(memory) and bool(left.memory) == bool(memory)
    assert ("noise" in left_sentence(found)) == (memory == "") and memory in left_sentence(found)


@pytest.mark.parametrize(("gain", "correlated", "is_told"), [(0.4, 0.9, True), (0.4, 0.1, False), (0.6, 0.9, False)])
def test_an_explained_error_says_where_most_of_it_remains(gain: float, correlated: float, is_told: bool) -> None:
    one = examples.one_cause()
    views = tuple(view for k in (1, 2) for view in examples.views_of(k, 1e-3, {}, correlated))
    found = replace(one, verdict="explained", gain=Interval(gain, gain, gain), views=views)
    told = " mN·m remain, correlated over 95 ms: no recorded signal predicts them."
    assert (told in headline(found)) == is_told
    assert f'class="verdict {"" if is_told else "good"}"' in diagnosis_page(found)


def test_numbers_are_told_as_people_write_them() -> None:
    shares = (0.577, 0.042, -0.031, -1e-9, 0.0)
    assert [percent(value).replace("\u00a0", " ") for value in shares] == ["58 %", "4.2 %", "−3.1 %", "0 %", "0 %"]
    assert percent_interval(Interval(0.31, 0.27, 0.35)).replace("\u00a0", " ") == "31 % (27 to 35 %)"
    assert [probability(p) for p in (2.1e-7, 0.008, 1e-30, 1.0)] == ["2.1e-7", "0.008", "< 1e-12", "1"]
    large = ModelErrors((20.0, 3.0), (25.0, 3.0))
    assert unit_of(replace(examples.one_cause(), nominal=large)) == (1.0, "N·m")
    assert not [effect for effect in EFFECTS if title_of(effect) in EFFECTS or "_" in title_of(effect)]


def test_the_terminal_shows_all_parts(full: Diagnosis) -> None:
    (causes, errors), said = list(tables(full)), "\n".join(lines(full))
    effects = ("gravity", "load_friction", "friction_drift", "contact", "unknown")
    assert [row[0] for row in causes[2]] == [f"{k}. {effect}" for k, effect in enumerate(effects, start=1)]
    places = ["joint 2 (pip)", "joint 1 (mcp), 2 places", "everywhere", "everywhere", "joint 1 (mcp)"]
    assert [row[1] for row in causes[2]] == places
    assert errors[2][-1] == ("all joints", "12.4", "5.64", "2.25", "5.68", "2.41", "2.14")
    parts = (full.experiment.sentence, left_sentence(full), full.unexplained.description[1:])
    assert all(part in said for part in (*parts, "train_2.parquet, 17.08 to 18.32 s", "inertia, at joint 2 (pip)"))
