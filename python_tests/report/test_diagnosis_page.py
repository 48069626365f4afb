"""Report, words and page of a diagnosis, on made-up ones: complete, true to it, escaped; and in a real browser."""

from __future__ import annotations

import html
import json
import math
import re
from dataclasses import replace
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from matplotlib.image import imread

import diagnosis_examples as examples
from real_browser import Elements, figures_of, framed, measure, needs_nothing_else, visit
from repetitions import repeated
from tendonfmu.diagnosis.cause import CausePlace
from tendonfmu.diagnosis.names import title_of
from tendonfmu.diagnosis.reported import reported_causes
from tendonfmu.diagnosis.result import Diagnosis, ModelErrors, RemainderMap
from tendonfmu.diagnosis.sizes import size_of
from tendonfmu.report.diagnosis_files import build_report, report_text
from tendonfmu.report.diagnosis_page import diagnosis_page, waterfall_of
from tendonfmu.report.diagnosis_text import (
    left_of,
    left_sentence,
    lines,
    names_of,
    tables,
    unit_of,
)
from tendonfmu.report.numbers import percent, percent_interval, probability
from tendonfmu.statistics.intervals import Interval

THRESHOLDS = (5e-4, 0.01)  # m/s, rad/s
HOSTILE = "<script>alert('x')</script>&\"$\\frac{"
SCHEMA = json.loads((files_of("tendonfmu") / "schema" / "diagnosis.schema.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def full() -> Diagnosis:
    """The example with everything in it."""
    return examples.three_causes()


@pytest.fixture(scope="module")
def page(full: Diagnosis) -> str:
    return diagnosis_page(full)


def plain(text: str) -> str:
    """As it is read, all spaces alike."""
    return " ".join(" ".join(Elements(text).words).replace("\u00a0", " ").split())


def parsed(diagnosis: Diagnosis) -> Any:
    """The report after a journey through its text."""
    return json.loads(report_text(build_report(diagnosis, ["diagnosis.html"])))


# --- the report -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", examples.ALL)
def test_the_report_is_as_contract_and_schema_say(name: str) -> None:
    found = examples.ALL[name]()
    report = parsed(found)
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(report, SCHEMA)
    assert report["format"] == "tendonfmu-diagnosis-1" and report["verdict"] == found.verdict
    assert report["nominal"]["bias_only_rms"] == list(found.bias_only_rms)
    assert report["extended"]["finger"] == "extended.json" and report["extended"]["fmu"] == "extended.fmu"
    assert report["gain"] == {"value": found.gain.value, "interval": [found.gain.low, found.gain.high]}
    assert report["next_experiment"] == found.experiment.sentence
    assert report["kind"] == found.kind and report["signals"] == found.signals
    assert report["least_gain"] == found.least_gain
    named = [entry for entry in report["causes"] if entry["effect"] not in ("contact", "unknown")]
    without_term = report["causes"][len(named) :]
    touched = (found.load is not None) + (found.event_gain is not None)
    assert [entry["effect"] for entry in without_term] == ["contact"] * touched + [
        "unknown"
    ] * found.unexplained.unknown
    assert all(entry["gain"]["interval"][0] > 0 for entry in report["causes"])
    assert [cause["effect"] for cause in named] == [cause.where.effect for cause in found.causes]
    for entry, cause in zip(named, found.causes, strict=True):
        assert (entry["joint"], entry["tendon"]) == (cause.where.joint, cause.where.tendon)
        assert entry["parameters"] == {path: value for path, (value, _) in cause.parameters.items()}
        assert [(place["joint"], place["tendon"]) for place in entry["places"]] == [
            (place.joint, place.tendon) for place in cause.places
        ]
        assert entry["parameters"] == {path: v for place in entry["places"] for path, v in place["parameters"].items()}
        assert [other["effect"] for other in entry["confusable_with"]] == [
            other.effect for other in cause.confusable_with
        ]


@pytest.mark.parametrize("name", examples.ALL)
def test_the_waterfall_leads_from_the_nominal_to_the_extended_model(name: str) -> None:
    """Over all joints; each step names its cause, in the order of the causes, and the page's values add up."""
    found = examples.ALL[name]()
    report = parsed(found)
    first, *steps = report["waterfall"]
    assert (first["effect"], first["rms"]) == (None, found.steps[0])
    assert [(step["effect"], step["joint"], step["rms"]) for step in steps] == [
        (cause.where.effect, cause.where.joint, rms) for cause, rms in zip(found.causes, found.steps[1:], strict=True)
    ]
    for rms, model in ((found.steps[0], "nominal"), (found.steps[-1], "extended")):
        assert rms == pytest.approx(math.sqrt(np.mean(np.square(report[model]["test_rms"]))), rel=0.03)
    fall = waterfall_of(found, names_of(found))
    values = [float(row.value.replace("−", "-").replace("+", "")) for row in fall.rows]
    assert len(values) == (len(found.causes) + 2 if found.causes else 1)
    assert sum(values[:-1]) == pytest.approx(values[-1], abs=1e-9) or not found.causes
    last = fall.rows[-1].parts
    assert [part.tone for part in last] == ["noise", "predictable"]
    assert fall.floor is not None and last[0].width == pytest.approx(fall.floor, abs=0.01)
    assert all(0.0 <= part.start <= part.start + part.width <= 100.01 for row in fall.rows for part in row.parts)


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


def test_what_is_too_small_has_no_numbers(full: Diagnosis) -> None:
    (entry,) = parsed(full)["too_small"]
    assert entry["effect"] == "inertia" and entry["parameters"] == {} and entry["gain"]["interval"][0] > 0
    assert entry["places"] == [{"joint": 2, "tendon": None, "parameters": {}, "units": {}}]


def test_what_is_uncertain_is_named_with_the_recording_that_would_settle_it(full: Diagnosis) -> None:
    (entry,) = parsed(full)["uncertain"]
    assert entry["effect"] == "gravity" and entry["gain"]["interval"][0] < 0 and "90 s" in entry["experiment"]
    assert "Test on 90 s of such motion" in plain(diagnosis_page(full))
    (line,) = (line for line in lines(full) if line.startswith("uncertain"))
    assert "joint 1" in line and line.endswith(entry["experiment"])


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
    found = replace(examples.one_cause(), noise_floor=(math.nan, 1e-3), gain=nothing)
    report = parsed(found)
    jsonschema.validate(report, SCHEMA)
    assert report["noise_floor"] == [None, 1e-3] and report["gain"] == {"value": None, "interval": [None, None]}
    text = plain(diagnosis_page(found))
    assert "nan" not in text.lower().split() and "inf" not in text.lower().split()


def test_a_part_without_a_name_has_a_map(full: Diagnosis) -> None:
    edges = (np.linspace(-1.0, 1.0, 4), np.linspace(10.0, 20.0, 3))
    torque = np.array([[1e-3, np.nan, -1e-3], [2e-3, 0.0, -2e-3]])
    shown = RemainderMap(2, ("angle of mcp (rad)", "force of flexor (N)"), edges, torque)
    page = diagnosis_page(replace(full, unexplained=replace(full.unexplained, map=shown)))
    assert 'id="views_map"' in page and "over angle of mcp and force of flexor" in page
    assert 'id="views_map"' not in diagnosis_page(full)


def test_a_wrong_report_is_refused(full: Diagnosis) -> None:
    report = parsed(full)
    for path, value in ((("verdict",), "fine"), (("causes", 0, "effect"), "magic"), (("causes", 0, "joint"), 0)):
        spoiled = json.loads(json.dumps(report))
        node = spoiled
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = value
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(spoiled, SCHEMA)


# --- words ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("verdict", ["adequate", "explained", "partly explained", "unexplained"])
@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("kind", ["model", "change"])
def test_every_verdict_has_a_page(full: Diagnosis, verdict: str, count: int, kind: str) -> None:
    """With any number of causes: error before and after, a card for each cause, and evidence of each."""
    given = replace(full, event_gain=None, unexplained=replace(full.unexplained, unknown=False), kind=kind)
    found = replace(given, verdict=verdict, causes=given.causes[:count], steps=given.steps[: count + 1], too_small=())
    text = diagnosis_page(found)
    assert ("5.68 → 2.41" in text) == (count > 0) and "5.68" in text
    assert text.count('<article class="card"') == count
    assert verdict in plain(text) and not re.search(r"\b(1 causes|0 causes|None|causes explains)\b", plain(text))


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("load_friction", {"coulomb": (8.1e-5, "m")}, "81 µN·m"),
        ("preload_friction", {"coulomb": (0.2, "N"), "beyond": (-0.1, "1")}, "0.2 N of friction, −0.1 times"),
        (
            "pulley_eccentricity",
            {"sine": (3e-4, "m"), "cosine": (4e-4, "m"), "turns": (8.97, "1")},
            "0.5 mm, 8.97 times",
        ),
        ("pulley_eccentricity", {"sine": (3e-4, "m"), "turns": (1.0, "1")}, "0.3 mm"),
        ("gravity", {"sine": (0.03, "N.m"), "cosine": (-0.04, "N.m")}, "50 mN·m"),
        ("presliding", {"displacement": (3.2e-4, "m")}, "0.32 mm"),
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
        ("asymmetric_friction", {"coulomb": (0.02, "N.m")}, "coulomb 20 mN·m"),
        ("friction_drift", {"amplitude": (-0.18, "1")}, "amplitude −18 %"),
    ],
)
def test_a_size_is_told_in_units_that_suit(effect: str, numbers: dict[str, tuple[float, str]], words: str) -> None:
    place = CausePlace(1, None, {f"extensions[1].{name}": number for name, number in numbers.items()})
    assert words in size_of(effect, [place], THRESHOLDS).replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("preload_friction", [(0.2, "N"), (0.5, "N"), (0.1, "N")], "0.5 N of friction at the largest of 3 places"),
        ("preload_friction", [(0.2, "N"), (0.2, "N")], "0.2 N of friction, at each of 2 places"),
        ("presliding", [(0.03, "s"), (1.3e-3, "rad")], "15 µm at tendons, 0.3 mrad at joints; other at 1 place"),
    ],
)
def test_the_size_of_several_places(effect: str, numbers: list[tuple[float, str]], words: str) -> None:
    name = "displacement" if effect == "presliding" else "coulomb"
    places = [CausePlace(None, k, {f"extensions[{k}].{name}": number}) for k, number in enumerate(numbers, start=1)]
    assert words in size_of(effect, places, THRESHOLDS).replace("\u00a0", " ")
    assert size_of(effect, [replace(place, parameters={}) for place in places], THRESHOLDS) == ""


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
    assert left is not None and left.memory == memory
    assert ("noise" in left_sentence(found)) == (memory == "") and memory in left_sentence(found)


def test_numbers_are_told_as_people_write_them() -> None:
    shares = (0.577, 0.042, -0.031, -1e-9, 0.0)
    assert [percent(value).replace("\u00a0", " ") for value in shares] == ["58 %", "4.2 %", "−3.1 %", "0 %", "0 %"]
    assert percent_interval(Interval(0.31, 0.27, 0.35)).replace("\u00a0", " ") == "31 % (27 to 35 %)"
    assert [probability(p) for p in (2.1e-7, 0.008, 1e-30, 1.0)] == ["2.1e-7", "0.008", "< 1e-12", "1"]
    large = ModelErrors((20.0, 3.0), (25.0, 3.0))
    assert unit_of(replace(examples.one_cause(), nominal=large)) == (1.0, "N·m")


def test_every_effect_of_the_contract_has_a_title() -> None:
    effects = SCHEMA["$defs"]["effect"]["enum"]
    titles = {title_of(effect) for effect in effects}
    assert len(titles) == len(effects) and not [title for title in titles if title in effects or "_" in title]


def test_the_terminal_shows_all_parts(full: Diagnosis) -> None:
    (causes, errors), said = list(tables(full)), "\n".join(lines(full))
    effects = ("gravity", "load_friction", "friction_drift", "contact", "unknown")
    assert [row[0] for row in causes[2]] == [f"{k}. {effect}" for k, effect in enumerate(effects, start=1)]
    assert [row[1] for row in causes[2]] == [
        *("joint 2 (pip)", "joint 1 (mcp), 2 places", "everywhere", "everywhere", "joint 1 (mcp)")
    ]
    assert errors[2][-1] == ("all joints", "12.4", "5.64", "2.25", "5.68", "2.41", "2.14")
    for part in (
        *(cause.size for cause in full.causes),
        *("train_2.parquet, 17.08 to 18.32 s", full.experiment.sentence, left_sentence(full)),
        *("inertia, at joint 2 (pip)", full.unexplained.description[1:], full.signals),
    ):
        assert part in said


# --- the page ---------------------------------------------------------------------------------------------------------


def test_nothing_is_needed_from_elsewhere(page: str) -> None:
    needs_nothing_else(page)
    assert 50_000 < len(page) < 5_000_000
    elements = Elements(page)
    ids = {attributes["id"] for _, attributes in elements.tags if "id" in attributes}
    targets = {(attributes["href"] or "").removeprefix("#") for attributes in elements.all("a")}
    assert len(targets) == 7 and targets <= ids


def test_figures_are_whole_and_described(full: Diagnosis, page: str) -> None:
    """One for each cause with a term; eight views of each joint, whose times are zoomed together."""
    figures = figures_of(page)
    assert len(figures) == 3 + 2 * 8
    assert [figure["zoom"] for figure in figures].count("time") == 2
    evidence, drawn = full.causes[0].evidence[0], figures[0]["data"]
    dots = next(trace for trace in drawn if trace["mode"] == "markers")
    np.testing.assert_allclose(dots["y"], 1e3 * evidence.before, rtol=1e-5)
    told = re.findall(r'<div class="plot"[^>]*>([^<]*)</div>', page)
    assert len(set(told)) == len(told) == 19 and all(len(text) > 40 for text in told)
    assert not re.search(r"[\s\"]nan|NaN|inf[\s\"]", page.split("<body>")[1].split("<script")[0])


def test_the_first_screens_hold_the_results(full: Diagnosis, page: str) -> None:
    """Verdict, errors, each cause with places and size, what the data cannot show, what is next; in this order."""
    first = plain(page.split("<nav")[0])
    names = names_of(full)
    order = [full.verdict, "5.68 → 2.41 mN·m", "54 to 61 %", "−1.78", "−0.14"]
    assert [first.find(words) for words in order] == sorted(first.find(words) for words in order)
    assert min(first.find(words) for words in order) > 0
    for cause in reported_causes(full):
        assert cause.title[1:] in first and cause.size in first
        assert percent_interval(cause.gain).replace("\u00a0", " ") in first
        for other in cause.confusable_with:
            assert f"{title_of(other.effect)}, at {names.place(other)}" in first
    for effect in full.invisible:
        assert effect.title in first and effect.experiment in plain(page)
    assert full.experiment.sentence in first and "--discriminate" in first
    assert all(warning in plain(page) for warning in full.warnings)


def test_the_tables_hold_the_numbers(page: str) -> None:
    text = plain(page)
    for row in (
        "1 (mcp) 3 (edc) 0.23 mN·m",
        "1 (mcp) 4 (lumbrical) 0.11 mN·m",
        "2 (pip) – 12.6 mN·m",
        "joint 2 (pip) 9.80 6.30 2.10 6.20 2.20 2.08 0.95 0.42",
        "train_2.parquet 17.08 18.32 joint 2 (pip) 83.0",
        "extensions[1].sine 0.0121 N·m",
        "extensions[1].cosine −0.0034 N·m",
        "joint 2 (pip) 1.1 %",
    ):
        assert row in text
    assert '<details id="too_small">' in page
    assert '<details id="too_small">' not in diagnosis_page(examples.adequate())
    detection = plain(diagnosis_page(examples.one_cause()))
    assert "found 15 22 false alarms 6 1 median delay 142 ms 61 ms" in detection


def test_names_and_warnings_are_escaped(full: Diagnosis) -> None:
    nominal = json.loads(json.dumps(full.nominal_data))
    nominal["joints"][1]["name"] = nominal["tendons"][2]["name"] = HOSTILE
    cause = replace(full.causes[0], title=HOSTILE, size=HOSTILE, explanation=HOSTILE)
    hostile = replace(
        full, finger=HOSTILE, warnings=(HOSTILE,), recordings=(HOSTILE,), causes=(cause,), nominal_data=nominal
    )
    text = diagnosis_page(hostile)
    assert text.count("<script") == 3 and text.count("&lt;script&gt;") >= 8
    assert HOSTILE in html.unescape(text)


# --- in a real browser ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", repeated([1280, 390], 1))
def test_a_browser_shows_it_at_any_width(browser: str, page: str, tmp_path: Path, width: int) -> None:
    """All figures there, nothing wider than the page, nothing asked for from elsewhere."""
    found = measure(browser, tmp_path, page, width)
    assert found["width"] == width and found["scroll"] == width and found["out"] == []
    assert [address for address in found["requests"] if not address.startswith("data:")] == []
    assert len(found["drawings"]) == 19 and found["font"] >= 15
    assert all(260 < shown <= width for shown in found["drawings"]) and min(found["drawn"]) > 0
    assert len(set(found["described"])) == 19 and min(map(len, found["described"])) > 40


def test_a_page_is_dark_for_those_who_want_it(browser: str, tmp_path: Path) -> None:
    """What is dark on a light page is light there."""
    page = diagnosis_page(examples.changed())
    found = measure(browser, tmp_path, page, 1280, "--blink-settings=preferredColorScheme=0")
    assert found["paper"] == "rgb(20, 24, 28)" and set(found["ink"]) == {"rgb(228, 232, 236)"}
    assert found["zoomed"] == ["time"] * 2


def test_a_browser_has_nothing_to_complain_of(browser: str, page: str, tmp_path: Path) -> None:
    """And there is ink in every part of it."""
    shot = tmp_path / "shot.png"
    done = visit(browser, framed(tmp_path, page, 1280, False), "--window-size=1280,2400", f"--screenshot={shot}")
    assert "CONSOLE" not in done.stderr
    image = imread(shot)[:2400, :1280, :3]
    bands = [np.mean(part < 0.8) for part in np.array_split(image, 8)]
    assert all(0.003 < share < 0.5 for share in bands), bands
