"""Report, words and page of a diagnosis, on made-up ones: complete, true to it, escaped; and in a real browser."""

from __future__ import annotations

import html
import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from matplotlib.image import imread

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

import diagnosis_examples as examples
from real_browser import Elements, figures_of, framed, measure, needs_nothing_else, visit
from repetitions import repeated
from tendonfmu.diagnosis.reported import reported_causes
from tendonfmu.diagnosis.result import Diagnosis, FoundPlace, ModelErrors, Where
from tendonfmu.diagnosis.size import size_of
from tendonfmu.report.diagnosis_numbers import percent, percent_interval, probability, unit_of
from tendonfmu.report.diagnosis_page import PAGE, diagnosis_page, write_diagnosis_page
from tendonfmu.report.diagnosis_report import build_report, report_text
from tendonfmu.report.diagnosis_text import (
    headline,
    left_sentence,
    lines,
    names_of,
    tables,
    title_of,
)
from tendonfmu.report.diagnosis_waterfall import waterfall_of
from tendonfmu.statistics.intervals import Interval

THRESHOLDS = (5e-4, 0.01)  # m/s, rad/s
LARGEST = 5_000_000  # bytes
HOSTILE = "<script>alert('x')</script>&\"$\\frac{"
SCHEMA = json.loads((files_of("tendonfmu") / "schema" / "diagnosis.schema.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, dict[Path, str]]:
    """Page of the example with everything in it."""
    found = examples.three_causes()
    return found, write_diagnosis_page(found, tmp_path_factory.mktemp("diagnosis"))


@pytest.fixture(scope="module")
def page(written: tuple[Diagnosis, dict[Path, str]]) -> str:
    return next(iter(written[1])).read_text("utf-8")


def plain(text: str) -> str:
    """As it is read, all spaces alike."""
    return " ".join(" ".join(Elements(text).words).replace("\u00a0", " ").split())


def parsed(found: Diagnosis) -> Any:
    """The report after a journey through its text."""
    return json.loads(report_text(build_report(found, ["diagnosis.html"])))


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
        assert [(each["joint"], each["tendon"]) for each in entry["places"]] == [
            (each.joint, each.tendon) for each in cause.places
        ]
        assert entry["parameters"] == {path: v for each in entry["places"] for path, v in each["parameters"].items()}
        assert [each["effect"] for each in entry["confusable_with"]] == [each.effect for each in cause.confusable_with]


@pytest.mark.parametrize("name", examples.ALL)
def test_the_waterfall_leads_from_the_nominal_to_the_extended_model(name: str) -> None:
    """Over all joints; each step names its cause, in the order of the causes."""
    found = examples.ALL[name]()
    report = parsed(found)
    first, *steps = report["waterfall"]
    model = "model of the reference" if found.kind == "change" else "nominal model"
    assert first == {"label": model, "effect": None, "joint": None, "tendon": None, "rms": found.steps[0]}
    assert [(step["effect"], step["joint"], step["rms"]) for step in steps] == [
        (cause.where.effect, cause.where.joint, rms) for cause, rms in zip(found.causes, found.steps[1:], strict=True)
    ]
    for rms, model in ((found.steps[0], "nominal"), (found.steps[-1], "extended")):
        assert rms == pytest.approx(math.sqrt(np.mean(np.square(report[model]["test_rms"]))), rel=0.03)


def test_what_is_too_small_has_no_numbers() -> None:
    report = parsed(examples.three_causes())
    (entry,) = report["too_small"]
    assert entry["effect"] == "inertia" and entry["parameters"] == {} and entry["gain"]["interval"][0] < 0
    assert entry["places"] == [{"joint": 2, "tendon": None, "parameters": {}, "units": {}}]


def test_contact_and_unknown_are_causes_only_where_their_gain_is_certain() -> None:
    full = examples.three_causes()
    assert [each.where.effect for each in reported_causes(full)[-2:]] == ["contact", "unknown"]
    assert reported_causes(full)[-2].where.joint is None  # events at both joints
    one = replace(full, events=(full.events[0], replace(full.events[1], peak=0.01)))
    assert reported_causes(one)[-2].where.joint == 2  # of the one event that is large enough
    doubtful = replace(full, event_gain=Interval(0.2, 0.05, 0.4), unexplained=replace(full.unexplained, unknown=False))
    assert reported_causes(doubtful) == list(full.causes)
    small = replace(full, events=(replace(full.events[0], peak=0.01),))
    assert "contact" not in {each.where.effect for each in reported_causes(small)}


def test_what_is_not_known_is_null() -> None:
    nothing = Interval(math.nan, -math.inf, math.inf)
    found = replace(examples.one_cause(), noise_floor=(math.nan, 1e-3), gain=nothing)
    report = parsed(found)
    jsonschema.validate(report, SCHEMA)
    assert report["noise_floor"] == [None, 1e-3] and report["gain"] == {"value": None, "interval": [None, None]}
    text = plain(diagnosis_page(found))
    assert "nan" not in text.lower().split() and "inf" not in text.lower().split()


def test_a_wrong_report_is_refused() -> None:
    report = parsed(examples.three_causes())
    for path, value in ((("verdict",), "fine"), (("causes", 0, "effect"), "magic"), (("causes", 0, "joint"), 0)):
        spoiled = json.loads(json.dumps(report))
        node = spoiled
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = value
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(spoiled, SCHEMA)


# --- words ------------------------------------------------------------------------------------------------------------

NAMED = "weight of a link that the model leaves out, at joint 2 (pip)"
HEADLINES = {
    ("adequate", 0): "The model is adequate: these data show nothing that it lacks.",
    ("adequate", 3): "The model is adequate: three causes were found, but what they explain hardly matters.",
    ("explained", 1): f"One cause explains what the model gets wrong: {NAMED}.",
    ("explained", 3): "Three causes together explain what the model gets wrong.",
    ("partly explained", 1): f"One cause explains part of what the model gets wrong: {NAMED}.",
    ("partly explained", 3): "Three causes together explain part of what the model gets wrong.",
    ("unexplained", 0): "The model gets something wrong, and no effect that is known explains it.",
    ("unexplained", 1): f"One cause was found, but it explains little of what the model gets wrong: {NAMED}.",
}


@pytest.mark.parametrize("verdict", ["adequate", "explained", "partly explained", "unexplained"])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_every_verdict_reads_right(verdict: str, count: int) -> None:
    """With any number of causes: headline, error, and nothing that speaks of a gain where nothing was added."""
    full = replace(examples.three_causes(), event_gain=None)
    full = replace(full, unexplained=replace(full.unexplained, unknown=False))
    found = replace(full, verdict=verdict, causes=full.causes[:count], steps=full.steps[: count + 1], too_small=())
    said = headline(found)
    assert HEADLINES.get((verdict, count), said) == said
    text = plain(diagnosis_page(found))
    assert said in text and said in lines(found)
    assert ("less error" in text) == ("the error falls from 5.68 to 2.41 mN·m rms" in text) == (count > 0)
    assert ("the error is 5.68 mN·m rms" in text) == (count == 0)
    assert ("Where the error comes from" in text) == (count > 0) == ("without it with it" in text)
    assert not re.search(r"\b(1 causes|0 causes|None|causes explains)\b", text)


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("load_friction", {"coulomb": (8.1e-5, "m")}, "81 µN·m of friction for each newton of tendon force"),
        ("preload_friction", {"coulomb": (0.2, "N")}, "0.2 N of friction"),
        (
            "preload_friction",
            {"coulomb": (0.2, "N"), "beyond": (-0.1, "1")},
            "0.2 N of friction, −0.1 times as much at the joints beyond",
        ),
        (
            "pulley_eccentricity",
            {"sine": (3e-4, "m"), "cosine": (4e-4, "m"), "turns": (8.97, "1")},
            "the arm goes up and down by 0.5 mm, 8.97 times while the joint would turn once",
        ),
        ("pulley_eccentricity", {"sine": (3e-4, "m"), "turns": (1.0, "1")}, "the arm goes up and down by 0.3 mm"),
        ("gravity", {"sine": (0.03, "N.m"), "cosine": (-0.04, "N.m")}, "50 mN·m at most"),
        ("presliding", {"displacement": (3.2e-4, "m")}, "over 0.32 mm"),
        ("presliding", {"displacement": (0.03, "s")}, "over 15 µm at tendons, 0.3 mrad at joints"),
        ("time_delay", {"delay": (-8e-4, "s")}, "the forces come 0.8 ms earlier than the positions"),
        ("force_gain", {"correction": (-0.021, "1")}, "the true force is 2.1 % smaller than measured"),
        ("moment_arm", {"correction": (-2.5e-4, "m")}, "−0.25 mm on the described arm"),
        ("inertia", {"inertia": (1.2e-5, "kg.m2")}, "1.2·10⁻⁵ kg·m²"),
        ("edge_friction", {"a.coulomb": (0.021, "1"), "b.coulomb": (0.03, "1")}, "up to 3 % of the tendon force"),
        (
            "asymmetric_friction",
            {"positive.coulomb": (0.02, "N.m"), "negative.coulomb": (0.03, "N.m")},
            "20 mN·m in the positive direction, 30 mN·m in the negative one",
        ),
        ("asymmetric_friction", {"coulomb": (0.02, "N.m")}, "coulomb 20 mN·m"),
        ("friction_drift", {"amplitude": (-0.18, "1")}, "amplitude −18 %"),
        ("contact", {}, ""),
    ],
)
def test_a_size_is_told_in_units_that_suit(effect: str, numbers: dict[str, tuple[float, str]], words: str) -> None:
    place = FoundPlace(1, None, {f"extensions[1].{name}": number for name, number in numbers.items()})
    assert size_of(effect, [place], THRESHOLDS).replace("\u00a0", " ") == words


@pytest.mark.parametrize(
    ("effect", "numbers", "words"),
    [
        ("preload_friction", [(0.2, "N"), (0.5, "N"), (0.1, "N")], "0.5 N of friction at the largest of 3 places"),
        ("preload_friction", [(0.2, "N"), (0.2, "N")], "0.2 N of friction, at each of 2 places"),
        (
            "presliding",
            [(0.03, "s"), (1.3e-3, "rad")],
            "over 15 µm at tendons, 0.3 mrad at joints; other at 1 place",
        ),
    ],
)
def test_the_size_of_several_places(effect: str, numbers: list[tuple[float, str]], words: str) -> None:
    name = "displacement" if effect == "presliding" else "coulomb"
    places = [FoundPlace(None, k, {f"extensions[{k}].{name}": number}) for k, number in enumerate(numbers, start=1)]
    assert size_of(effect, places, THRESHOLDS).replace("\u00a0", " ") == words
    assert size_of(effect, [replace(each, parameters={}) for each in places], THRESHOLDS) == ""


def test_a_touched_finger_is_told_beside_the_verdict() -> None:
    text = headline(replace(examples.adequate(), events=(examples.STALL,), event_gain=Interval(0.3, 0.1, 0.5)))
    assert text.startswith("The model is adequate") and "they were left out (one event, 1.2 s in all)." in text


@pytest.mark.parametrize(
    ("test", "floor", "unknown", "words"),
    [
        (2.0e-3, 1.9e-3, True, "2.00 mN·m are left. 0.10 of it can be predicted from what was recorded, but has no "
         "name; the rest, 1.90, is noise to these sensors."),
        (2.0e-3, 1.9e-3, False, "but has no name, and is too little to matter; the rest, 1.90, is noise"),
        (2.0e-3, 2.0e-3, False, "2.00 mN·m are left. Nothing that was recorded predicts any of it"),
        (2.0e-3, math.nan, False, ""),
    ],
)  # fmt: skip
def test_what_is_left_and_the_noise_floor_add_up(test: float, floor: float, unknown: bool, words: str) -> None:
    found = examples.one_cause()
    rest = replace(found.unexplained, unknown=unknown)
    errors = replace(found.extended, test_rms=(test, test))
    assert words in left_sentence(replace(found, extended=errors, noise_floor=(floor, floor), unexplained=rest))


@pytest.mark.parametrize("name", examples.ALL)
def test_the_values_of_the_waterfall_add_up_as_shown(name: str) -> None:
    found = examples.ALL[name]()
    fall = waterfall_of(found, names_of(found))
    values = [float(row.value.replace("−", "-").replace("+", "")) for row in fall.rows]
    assert len(values) == (len(found.causes) + 2 if found.causes else 1)
    assert sum(values[:-1]) == pytest.approx(values[-1], abs=1e-9) or not found.causes
    last = fall.rows[-1].parts
    assert [part.tone for part in last] == ["noise", "nameless"]
    assert fall.floor is not None and last[0].width == pytest.approx(fall.floor, abs=0.01)
    assert all(0.0 <= part.start <= part.start + part.width <= 100.01 for row in fall.rows for part in row.parts)


def test_numbers_are_told_as_people_write_them() -> None:
    assert [percent(value).replace("\u00a0", " ") for value in (0.577, 0.042, -0.031, -1e-9, 0.0)] == [
        "58 %",
        "4.2 %",
        "−3.1 %",
        "0 %",
        "0 %",
    ]
    assert percent_interval(Interval(0.31, 0.27, 0.35)).replace("\u00a0", " ") == "31 % (27 to 35 %)"
    assert [probability(p) for p in (2.1e-7, 0.008, 1e-30, 1.0)] == ["2.1e-7", "0.008", "< 1e-12", "1"]
    large = ModelErrors((20.0, 3.0), (25.0, 3.0))
    assert unit_of(replace(examples.one_cause(), nominal=large)) == (1.0, "N·m")


def test_every_effect_of_the_contract_has_a_title() -> None:
    effects = SCHEMA["$defs"]["effect"]["enum"]
    assert len(effects) == 26
    titles = {title_of(effect) for effect in effects}
    assert len(titles) == 26 and not [title for title in titles if title in effects or "_" in title]


def test_the_terminal_says_what_the_page_says() -> None:
    found = examples.three_causes()
    (causes, errors), said = list(tables(found)), "\n".join(lines(found))
    assert [row[0] for row in causes[2]] == [
        *("1. gravity", "2. load_friction", "3. friction_drift", "4. contact", "5. unknown")
    ]
    assert [row[1] for row in causes[2]] == [
        *("joint 2 (pip)", "joint 1 (mcp), 2 places", "everywhere", "everywhere", "joint 1 (mcp)")
    ]
    assert errors[2][-1] == ("all joints", "12.4", "5.64", "2.25", "5.68", "2.41", "2.14")
    for cause in found.causes:
        assert cause.size in said
    assert "left out: train_2.parquet, 17.08 to 18.32 s" in said and f"next: {found.experiment.sentence}" in said
    assert left_sentence(found) in said and "too small to matter: inertia, at joint 2 (pip)" in said
    assert found.unexplained.description[1:] in said and f"estimated from {found.signals}" in said


# --- the page ---------------------------------------------------------------------------------------------------------


def test_files_are_written_and_named(written: tuple[Diagnosis, dict[Path, str]]) -> None:
    files = written[1]
    folder = next(iter(files)).parent
    assert {file.name for file in folder.iterdir()} == {file.name for file in files}
    assert {file.name for file in files} == {PAGE}
    assert 50_000 < (folder / PAGE).stat().st_size < LARGEST


def test_nothing_is_needed_from_elsewhere(page: str) -> None:
    needs_nothing_else(page)
    elements = Elements(page)
    ids = {attributes["id"] for _, attributes in elements.tags if "id" in attributes}
    targets = {(attributes["href"] or "").removeprefix("#") for attributes in elements.all("a")}
    assert len(targets) == 7 and targets <= ids


def test_figures_are_whole_and_described(page: str) -> None:
    """One for each cause with a term; eight views of each joint, whose times are zoomed together."""
    assert len(figures_of(page)) == 3 + 2 * 8
    assert [each["zoom"] for each in figures_of(page)].count("time") == 2
    told = re.findall(r'<div class="plot"[^>]*>([^<]*)</div>', page)
    assert len(set(told)) == len(told) == 19 and all(len(each) > 40 for each in told)
    assert not re.search(r"[\s\"]nan|NaN|inf[\s\"]", page.split("<body>")[1].split("<script")[0])


def test_the_first_screens_say_it_all(written: tuple[Diagnosis, dict[Path, str]], page: str) -> None:
    """Verdict, waterfall, each cause with places and size, what is left, what the data cannot show, what is next."""
    found, first = written[0], plain(page.split("<nav")[0])
    names = names_of(found)
    assert headline(found) in first and "5.68 → 2.41 mN·m" in first and "95 % interval 54 to 61 %" in first
    order = ["error of the nominal model 5.68", "1. weight of a link that the model leaves out, at joint 2 (pip) −1.78"]
    order += ["3. friction changes in the course of time −0.14", "what is left 2.41", left_sentence(found)]
    order += [found.warnings[2], "The causes, in order of gain", "Seen, too small to matter"]
    order += ["What these data cannot show"]
    assert [first.find(words) for words in order] == sorted(first.find(words) for words in order)
    assert min(first.find(words) for words in order) > 0
    for cause in reported_causes(found):
        assert cause.title[1:] in first and cause.size in first
        assert percent_interval(cause.gain).replace("\u00a0", " ") in first
        for other in cause.confusable_with:
            assert f"{title_of(other.effect)}, at {names.place(other)}" in first
    for each in found.invisible:
        assert each.title in first and each.experiment in first
    assert found.experiment.sentence in first and "--discriminate" in first
    assert all(warning in first for warning in found.warnings)


def test_a_card_has_a_table_of_its_places(page: str) -> None:
    text = plain(page.split("<nav")[0])
    two = "1 (mcp) 3 (edc) 0.23 mN·m of friction for each newton of tendon force 1 (mcp) 4 (lumbrical) 0.11 mN·m of"
    assert f"joint tendon how much {two}" in text
    assert "joint tendon how much all all 18 % less friction in the end" in text
    assert "joint tendon how much 2 (pip) – 12.6 mN·m at most" in text
    assert text.count("joint tendon how much") == 3 and text.count("without it with it") == 3


def test_what_is_too_small_is_folded(page: str) -> None:
    folded = plain(page.split('<details id="too_small">')[1].split("</details>")[0])
    assert "each removes less than 3.0 % of the error" in folded and "The link's inertia joint 2 (pip) 1.1 %" in folded
    assert "too small" not in plain(diagnosis_page(examples.adequate()))


def test_the_tables_hold_the_numbers(page: str) -> None:
    text = plain(page)
    assert "joint 2 (pip) 9.80 6.30 2.10 6.20 2.20 2.08 0.95 0.42" in text
    assert "train_2.parquet 17.08 18.32 joint 2 (pip) 83.0" in text
    assert "extensions[1].sine 0.0121 N·m" in text and "extensions[1].cosine −0.0034 N·m" in text
    assert "214 candidate causes were tested" in text and "Seed 0." in text
    assert "estimated from signals smoothed at 19.6 Hz, without lag" in text


@pytest.mark.long
def test_the_page_needs_no_plotting_library() -> None:
    """It takes longer to load than all that is drawn; of Plotly, the page takes the file for browsers."""
    code = (
        "import sys, tendonfmu.report.diagnosis_page; sys.exit('matplotlib' in sys.modules or 'plotly' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_detection_gain_is_told_where_there_is_one() -> None:
    text = plain(diagnosis_page(examples.one_cause()))
    assert "of 23 labelled contacts nominal extended found 15 22 false alarms 6 1 median delay 142 ms 61 ms" in text
    assert "labelled contacts" not in plain(diagnosis_page(examples.adequate()))


def test_many_effects_that_cannot_be_seen_are_counted() -> None:
    one = examples.INVISIBLE[0]
    places = tuple(replace(one, where=Where("cover_hardening", joint=1 + k % 2)) for k in range(6))
    few = plain(diagnosis_page(replace(examples.adequate(), invisible=places)))
    assert ", at 6 places, such as joint 1 (mcp). Refitting absorbs it; 0.2 % would be left. To see it: move" in few
    others = tuple(replace(one, where=Where(name), title=name) for name in "abc")
    many = plain(diagnosis_page(replace(examples.adequate(), invisible=places + others)))
    assert "4 effects are not visible in these data" in many and "(6 places, such as joint 1 (mcp)); a; b; c" in many
    others = tuple(replace(one, where=Where(name), title=name) for name in "abcdefg")
    crowd = plain(diagnosis_page(replace(examples.adequate(), invisible=places + others)))
    assert "8 effects are not visible in these data" in crowd and "more it is bent; a; b; c; d" in crowd


def test_what_noise_hides_is_not_said_to_be_absorbed() -> None:
    absorbed, small = examples.INVISIBLE
    text = plain(diagnosis_page(replace(examples.adequate(), invisible=(small,))))
    assert (
        "One of ordinary size would raise the error by 1.1 %, too little to be a cause: it takes 3.0 %. To see it"
        in text
    )
    others = tuple(replace(absorbed, where=Where(name), title=name) for name in "ab")
    text = plain(diagnosis_page(replace(examples.adequate(), invisible=(small, *others))))
    assert "2 effects are not visible in these data, since refitting absorbs them: a; b." in text
    assert (
        "1 effect is visible only if larger than usual (a cause has to lower the error by 3.0 %): the tendon gets"
        in text
    )


def test_names_and_warnings_are_escaped() -> None:
    found = examples.three_causes()
    nominal = json.loads(json.dumps(found.nominal_data))
    nominal["joints"][1]["name"] = nominal["tendons"][2]["name"] = HOSTILE
    cause = replace(found.causes[0], title=HOSTILE, size=HOSTILE, explanation=HOSTILE)
    hostile = replace(
        found, finger=HOSTILE, warnings=(HOSTILE,), recordings=(HOSTILE,), causes=(cause,), nominal_data=nominal
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


def test_a_browser_has_nothing_to_complain_of(
    browser: str, written: tuple[Diagnosis, dict[Path, str]], page: str, tmp_path: Path
) -> None:
    """And there is ink in every part of it."""
    shot = tmp_path / "shot.png"
    done = visit(browser, framed(tmp_path, page, 1280, False), "--window-size=1280,2400", f"--screenshot={shot}")
    assert "CONSOLE" not in done.stderr
    image = imread(shot)[:2400, :1280, :3]
    bands = [np.mean(part < 0.8) for part in np.array_split(image, 8)]
    assert all(0.003 < share < 0.5 for share in bands), bands


def test_a_request_would_be_seen(browser: str, tmp_path: Path) -> None:
    wanting = "<!DOCTYPE html><img src='http://localhost:9/picture.png' alt=''>"
    assert measure(browser, tmp_path, wanting, 390)["requests"] == ["http://localhost:9/picture.png"]
