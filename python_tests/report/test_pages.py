"""Every page: numbers as in the result, names escaped, nothing needed from elsewhere, all of it drawn by a browser."""

from __future__ import annotations

import copy
import dataclasses
import html
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import diagnosis_examples as examples
from real_browser import Elements, figures_of, measure, needs_nothing_else
from repetitions import repeated
from tendonfmu.diagnosis.effects import Where, title_of
from tendonfmu.diagnosis.names import reported_causes
from tendonfmu.diagnosis.result import Diagnosis, RemainderMap
from tendonfmu.estimate.fit_report import FitPicture
from tendonfmu.report.diagnosis_page import diagnosis_page, waterfall_of
from tendonfmu.report.diagnosis_text import names_of
from tendonfmu.report.fit_page import fit_page, residual_tables
from tendonfmu.report.kit import percent_interval
from tendonfmu.report.run_page import run_page, run_report
from tendonfmu.statistics.intervals import Interval

HOSTILE = "<script>alert('x')</script>&\"$\\frac{"


@pytest.fixture(scope="module")
def pages(fit: FitPicture, full: Diagnosis, table: dict[str, Any], run_numbers: dict[str, Any]) -> dict[str, str]:
    return {
        "fit": fit_page(fit),
        "diagnosis": diagnosis_page(full),
        "run": run_page(run_numbers, table, np.arange(len(table["time"])) < 120),
    }


def plain(text: str) -> str:
    """As it is read, all spaces alike."""
    return " ".join(" ".join(Elements(text).words).replace("\u00a0", " ").split())


# --- every page -------------------------------------------------------------------------------------------------------

NAMES = ("fit", "diagnosis", "run")


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_needed_from_elsewhere(pages: dict[str, str], name: str) -> None:
    page = pages[name]
    needs_nothing_else(page)
    elements = Elements(page)
    ids = {attributes["id"] for _, attributes in elements.tags if "id" in attributes}
    assert {(each["href"] or "").removeprefix("#") for each in elements.all("a")} <= ids
    assert all(figure["data"] for figure in figures_of(page))


def hostile_fit(fit: FitPicture) -> str:
    fitted = copy.deepcopy(dict(fit.fitted.data))
    fitted["joints"][0]["name"] = fitted["tendons"][0]["name"] = HOSTILE
    recordings = [{**fit.report["recordings"][0], "path": HOSTILE}]
    report = {**fit.report, "finger": HOSTILE, "warnings": [HOSTILE], "recordings": recordings}
    named = dataclasses.replace(fit.fitted, data=fitted)
    return fit_page(dataclasses.replace(fit, report=report, fitted=named))


def hostile_diagnosis(full: Diagnosis) -> str:
    nominal = copy.deepcopy(dict(full.nominal_data))
    nominal["joints"][1]["name"] = nominal["tendons"][2]["name"] = HOSTILE
    cause = dataclasses.replace(full.causes[0], title=HOSTILE, size=HOSTILE, explanation=HOSTILE)
    given = {"finger": HOSTILE, "warnings": (HOSTILE,), "recordings": (HOSTILE,), "causes": (cause,)}
    return diagnosis_page(dataclasses.replace(full, nominal_data=nominal, **given))


def test_names_and_warnings_are_escaped(
    fit: FitPicture, full: Diagnosis, table: dict[str, Any], run_numbers: dict[str, Any]
) -> None:
    named = {key: [{**each, "name": HOSTILE} for each in run_numbers[key]] for key in ("joints", "tendons")}
    for text in (hostile_fit(fit), hostile_diagnosis(full), run_page(run_numbers | named | {"finger": HOSTILE}, table)):
        needs_nothing_else(text)
        assert "<script>alert" not in text and HOSTILE in html.unescape(text)


@pytest.mark.parametrize(
    ("name", "width"), repeated([(name, width) for width in (1280, 390) for name in NAMES], 0, 1, 2)
)
def test_a_browser_draws_it(browser: str, pages: dict[str, str], tmp_path: Path, name: str, width: int) -> None:
    """All figures, nothing wider than the screen, nothing asked for from elsewhere."""
    page = pages[name]
    found = measure(browser, tmp_path, page, width)
    assert found["width"] == found["scroll"] == width and found["out"] == []
    assert [address for address in found["requests"] if not address.startswith("data:")] == []
    assert len(found["drawings"]) == len(figures_of(page)) and min(found["drawn"]) > 0


# --- numbers ----------------------------------------------------------------------------------------------------------


def test_the_page_of_a_fit_holds_its_numbers(fit: FitPicture, pages: dict[str, str]) -> None:
    """What is left, of what, against the start, the bias alone and the friction alone; by joint; what is known."""
    page = pages["fit"]
    first = page.split("<nav")[0].replace("\u00a0", " ")
    residual = fit.report["residual"]["train"]
    for key in ("torque_rms", "rms", "start_rms", "bias_only_rms", "model_only_rms"):
        for value in residual[key]:
            assert f"{1e3 * value:.1f}" in first or f"{1e3 * value:.2f}" in first, (key, value)
    share = np.linalg.norm(residual["rms"]) / np.linalg.norm(residual["torque_rms"])
    assert f"{100 * share:.0f} %" in first or f"{100 * share:.1f} %" in first
    assert f"{fit.report['identified']['count']}/{fit.report['identified']['of']}" in first
    numbers = page.split('id="numbers"')[1]
    for entry in fit.report["parameters"]:
        assert entry["path"].split(".", 1)[1] in page and f"{entry['value']:.4g}".rstrip("0") in numbers, entry
    assert numbers.count('class="doubtful"') == sum(not entry["identified"] for entry in fit.report["parameters"])
    tables = residual_tables(fit.report, fit.fitted.joint_names)
    assert [part.title for part in tables] == ["Training", "Held out of training", "Not trained on: x4"]
    for part, data in zip(tables, (residual, fit.report["residual"]["held_out"]), strict=False):
        assert part.all.fitted == pytest.approx(1e3 * np.sqrt(np.mean(np.square(data["rms"]))))


@pytest.mark.parametrize("change", [{"finished": False}, {"converged": False}])
def test_an_unsettled_fit_says_so_first(fit: FitPicture, change: dict[str, Any]) -> None:
    alert = '<p class="alert"><strong>'
    unsettled = dataclasses.replace(fit, report={**fit.report, **change})
    assert alert not in fit_page(fit) and alert in fit_page(unsettled).split("<main")[0]


def test_what_a_fit_does_not_know_is_left_out(fit: FitPicture) -> None:
    """No held-out data, no start, numbers that are null."""
    train = {**fit.report["residual"]["train"], "bias_only_rms": [None], "start_rms": [None]}
    nis = {"mean": None, "interval": [None, None], "consistent": False}
    innovations = {**fit.report["innovations"], "nis": nis, "whiteness": {"lag_one": [None], "ljung_box_p": [None]}}
    residual = {"train": train, "held_out": None, "comparisons": []}
    report = {**fit.report, "residual": residual, "innovations": innovations}
    text = plain(fit_page(dataclasses.replace(fit, report=report)))
    assert "Held out of training" not in text and "nan" not in text.lower().split()


def test_the_page_of_a_diagnosis_holds_its_numbers(full: Diagnosis, pages: dict[str, str]) -> None:
    """Verdict, errors, each cause with its place, size and gain; what the data cannot show; what is next."""
    page = pages["diagnosis"]
    first, text, names = plain(page.split("<nav")[0]), plain(page), names_of(full)
    for words in (full.verdict, "5.68 → 2.41 mN·m", "54 to 61 %", full.experiment.sentence):
        assert words in first
    for cause in reported_causes(full):
        assert cause.title[1:] in first and cause.size in first
        assert percent_interval(cause.gain).replace("\u00a0", " ") in first
        for other in cause.confusable_with:
            assert f"{title_of(other.effect)}, at {names.place(other)}" in first
    assert all(effect.title in first and effect.experiment in text for effect in full.invisible)
    assert all(warning in text for warning in full.warnings)
    for row in (
        "1 (mcp) 3 (edc) 0.23 mN·m",
        "joint 2 (pip) 9.80 6.30 2.10 6.20 2.20 2.08 0.95 0.42",
        "train_2.parquet 17.08 18.32 joint 2 (pip) 83.0",
        "extensions[1].cosine −0.0034 N·m",
        "Test on 90 s of such motion",
    ):
        assert row in text
    dots = next(trace for trace in figures_of(page)[0]["data"] if trace["mode"] == "markers")
    np.testing.assert_allclose(dots["y"], 1e3 * full.causes[0].evidence[0].before, rtol=1e-5)
    detection = plain(diagnosis_page(examples.one_cause()))
    assert "found 15 22 false alarms 6 1 median delay 142 ms 61 ms" in detection


@pytest.mark.parametrize("make", examples.ALL.values(), ids=examples.ALL)
def test_the_waterfall_leads_from_the_nominal_to_the_extended_model(make: Callable[[], Diagnosis]) -> None:
    """The values of its rows add up; what is left is noise and what can be predicted."""
    found = make()
    fall = waterfall_of(found, names_of(found))
    values = [float(row.value.replace("−", "-").replace("+", "")) for row in fall.rows]
    assert len(values) == (len(found.causes) + 2 if found.causes else 1)
    assert sum(values[:-1]) == pytest.approx(values[-1], abs=1e-9) or not found.causes
    last = fall.rows[-1].parts
    assert [part.tone for part in last] == ["noise", "predictable"]
    assert fall.floor is not None and last[0].width == pytest.approx(fall.floor, abs=0.01)
    assert all(0.0 <= part.start <= part.start + part.width <= 100.01 for row in fall.rows for part in row.parts)
    assert plain(diagnosis_page(found)).count(found.verdict) > 0


def test_green_stands_for_a_cause_that_is_certain() -> None:
    known = examples.one_cause()
    (cause,) = known.causes
    rivals = (Where("force_gain", tendon=1), Where("moment_arm", joint=1, tendon=1), Where("cover_stiffness", joint=1))
    unsure = dataclasses.replace(known, causes=(dataclasses.replace(cause, confusable_with=rivals),))
    assert known.verdict == "explained" and 'class="verdict good"' in diagnosis_page(known)
    assert 'class="verdict good"' not in diagnosis_page(unsure)
    assert "It may also be another effect" in plain(diagnosis_page(unsure))


def test_what_a_diagnosis_does_not_know_is_no_number(full: Diagnosis) -> None:
    unknown = dataclasses.replace(
        examples.one_cause(), noise_floor=(math.nan, 1e-3), gain=Interval(math.nan, -math.inf, math.inf)
    )
    assert not {"nan", "inf", "None"} & set(plain(diagnosis_page(unknown)).split())
    edges = (np.linspace(-1.0, 1.0, 4), np.linspace(10.0, 20.0, 3))
    torque = np.array([[1e-3, np.nan, -1e-3], [2e-3, 0.0, -2e-3]])
    shown = RemainderMap(2, ("angle of mcp (rad)", "force of flexor (N)"), edges, torque)
    with_map = dataclasses.replace(full, unexplained=dataclasses.replace(full.unexplained, map=shown))
    assert len(figures_of(diagnosis_page(with_map))) == 1 + len(figures_of(diagnosis_page(full)))


def test_the_numbers_of_a_run_are_those_of_its_outputs(table: dict[str, Any], run_numbers: dict[str, Any]) -> None:
    contact, count = run_numbers["contact"], len(table["time"])
    assert contact["intervals"] == [(1.0, 1.5), (3.0, 3.2)]
    assert (contact["samples"], contact["share"]) == (70, 70 / count)
    first, second = run_numbers["joints"]
    assert (first["contact_share"], second["contact_share"]) == (70 / count, 0.0)
    assert first["compensated_torque_rms"] == pytest.approx(0.05 * (70 / count) ** 0.5, rel=0.02)  # pushes
    assert first["free_compensated_torque_rms"] == pytest.approx(0.001, rel=0.1)  # noise, ± 5 % of 330 samples
    assert second["joint_torque_rms"] == pytest.approx(np.sqrt(np.mean(table["joint_torque[2]"] ** 2)))
    assert second["angle"] == [pytest.approx(np.cos(3.14) - 2, abs=1e-3), -1.0]
    assert [each["slack_share"] for each in run_numbers["tendons"]] == [0.0, 99 / count, 0.0]
    always = table | {"contact": np.ones(count, dtype=bool)}
    found = run_report(Path("f.fmu"), Path("r.csv"), always, None, kinematics=1, output="-")
    assert found["joints"][0]["free_joint_torque_rms"] is None and "–" in run_page(found, always)
