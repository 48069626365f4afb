"""The page of a run: complete, self-contained, escaped; its numbers are those of the outputs; and in a real browser."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Call
from fmu_binary import FINGER
from real_browser import figures_of, measure, needs_nothing_else
from repetitions import repeated
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.report.run_page import run_page, run_report

HOSTILE = "<script>alert('x')</script>&\"$\\frac{"
JOINTS, TENDONS, SAMPLES = 2, 3, 400
CONTACT = (slice(100, 150), slice(300, 320))

Table = dict[str, Any]


@pytest.fixture(scope="module")
def table() -> Table:
    """Outputs with two contacts at the first joint, and one slack tendon."""
    time, random = np.arange(SAMPLES) / 100, np.random.default_rng(1)
    flags = np.zeros(SAMPLES, dtype=bool)
    for part in CONTACT:
        flags[part] = True
    found: Table = {"time": time, "contact": flags}
    for j in range(1, JOINTS + 1):
        friction = 0.02 * j * np.sin(3 * time)
        left = 0.001 * random.standard_normal(SAMPLES) + 0.05 * (flags & (j == 1))
        found |= {
            f"joint_torque[{j}]": friction + left,
            f"friction_torque[{j}]": friction,
            f"compensated_torque[{j}]": left,
            f"compensated_torque_std[{j}]": np.full(SAMPLES, 0.002 * (j == 1)),
            f"joint_angle[{j}]": np.cos(time) - j,
            f"joint_speed[{j}]": -np.sin(time),
            f"joint_contact[{j}]": flags & (j == 1),
        }
    for i in range(1, TENDONS + 1):
        found[f"slack[{i}]"] = (time > 3.0) & (i == 2)
    return found


@pytest.fixture(scope="module")
def numbers(table: Table) -> dict[str, Any]:
    return run_report(Path("f.json"), Path("r.csv"), table, None, kinematics=1, output="out.csv")


@pytest.fixture(scope="module")
def page(table: Table, numbers: dict[str, Any]) -> str:
    return run_page(numbers, table, np.arange(SAMPLES) < 120)


def test_the_numbers_are_those_of_the_outputs(table: Table, numbers: dict[str, Any]) -> None:
    assert numbers["contact"]["intervals"] == [(1.0, 1.5), (3.0, 3.2)]
    assert (numbers["contact"]["samples"], numbers["contact"]["share"]) == (70, 70 / SAMPLES)
    first, second = numbers["joints"]
    assert (first["contact_share"], second["contact_share"]) == (70 / SAMPLES, 0.0)
    assert first["compensated_torque_rms"] == pytest.approx(0.05 * (70 / SAMPLES) ** 0.5, rel=0.02)  # pushes
    assert first["free_compensated_torque_rms"] == pytest.approx(0.001, rel=0.1)  # noise, ± 5 % of 330 samples
    assert second["joint_torque_rms"] == pytest.approx(np.sqrt(np.mean(table["joint_torque[2]"] ** 2)))
    assert second["angle"] == [pytest.approx(np.cos(3.14) - 2, abs=1e-3), -1.0]
    assert [each["slack_share"] for each in numbers["tendons"]] == [0.0, 99 / SAMPLES, 0.0]


def test_without_free_motion_its_numbers_are_none(table: Table) -> None:
    always = table | {"contact": np.ones(SAMPLES, dtype=bool)}
    found = run_report(Path("f.fmu"), Path("r.csv"), always, None, kinematics=1, output="-")
    assert found["joints"][0]["free_joint_torque_rms"] is None
    assert "–" in run_page(found, always)


def test_the_page_is_whole_and_linked(page: str) -> None:
    needs_nothing_else(page)
    figures = figures_of(page)
    assert [each["zoom"] for each in figures] == ["time"] * (1 + 2 * JOINTS + 2 * JOINTS) and all(
        each["data"] for each in figures
    )
    stripes = [len(each["layout"].get("shapes", [])) for each in figures]
    assert stripes == [2, 2, 0, 0, 0, 0, 0, 0, 0]  # contact at the first joint only
    rows = next(each["layout"]["yaxis"]["ticktext"] for each in figures if "ticktext" in each["layout"]["yaxis"])
    assert rows == ["labelled contact", "contact, joint 1", "contact, joint 2", "slack, tendon 2"]
    targets = set(re.findall(r'href="#([^"]+)"', page))
    assert len(targets) > 4 and targets <= set(re.findall(r'id="([^"]+)"', page))


def test_names_are_escaped(table: Table, numbers: dict[str, Any]) -> None:
    joints = [{**each, "name": HOSTILE} for each in numbers["joints"]]
    tendons = [{**each, "name": HOSTILE} for each in numbers["tendons"]]
    text = run_page({**numbers, "finger": HOSTILE, "joints": joints, "tendons": tendons}, table)
    assert "<script>alert" not in text
    needs_nothing_else(text)


def test_nothing_happened_is_said(table: Table) -> None:
    quiet = {name: values if values.dtype != bool else np.zeros(SAMPLES, bool) for name, values in table.items()}
    found = run_report(Path("f.json"), Path("r.csv"), quiet, None, kinematics=1, output="out.csv")
    text = run_page(found, quiet)
    assert "in_contact" not in text and len(figures_of(text)) == 8  # no panel of contacts


@pytest.mark.parametrize("width", repeated([1280, 390], 1))
def test_the_page_fits_screens(browser: str, page: str, tmp_path: Path, width: int) -> None:
    found = measure(browser, tmp_path, page, width)
    assert found["out"] == [] and found["scroll"] <= found["width"] and found["requests"] == []
    assert len(found["drawings"]) == 9 and all(found["drawn"])
    assert found["zoomed"] == ["time"] * 9


def test_the_page_is_dark_for_those_who_want_it(browser: str, page: str, tmp_path: Path) -> None:
    found = measure(browser, tmp_path, page, 1280, "--blink-settings=preferredColorScheme=0")
    assert found["paper"] == "rgb(20, 24, 28)" and set(found["ink"]) == {"rgb(228, 232, 236)"}


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    columns: Table = {"time": np.arange(50) / 100}
    for i in range(1, len(FINGER["tendons"]) + 1):
        columns |= {f"tendon_force[{i}]": np.full(50, 5.0), f"tendon_position[{i}]": np.linspace(0, 1e-3, 50)}
    write_table(tmp_path / "r.csv", columns)
    return "finger.json", "r.csv"


def test_the_command_writes_a_file_or_into_a_folder(call: Call, files: tuple[str, str], tmp_path: Path) -> None:
    for given, page in (("page.html", "page.html"), ("new/folder", "new/folder/run.html")):
        answer = call("run", *files, "-o", "out.csv", "--report", given, "--json")
        assert answer.status == 0 and f"{page}: the run, to be read in a browser" in answer.err
        text, report = (tmp_path / page).read_text(encoding="utf-8"), json.loads(answer.out)
        assert all(f"<h3>{each['name']}</h3>" in text for each in report["joints"])
        assert [each["name"] for each in report["joints"]] == [each["name"] for each in FINGER["joints"]]
    assert call("build", "finger.json", "-o", "f.fmu").status == 0
    packed = json.loads(call("run", "f.fmu", "r.csv", "-o", "out.csv", "--json").out)
    assert packed == report | {"model": "f.fmu"}
    torque = read_table(tmp_path / "out.csv", lambda *_: None)["joint_torque[1]"]
    assert packed["joints"][0]["joint_torque_rms"] == pytest.approx(np.sqrt(np.mean(torque**2)))


@pytest.mark.parametrize(
    ("output", "page", "words"),
    [
        ("out.csv", "finger.json/x", "finger.json is a file"),
        ("out.csv", "absent/page.html", "no folder absent"),
        ("out.csv", "-", "standard output takes tables only"),
    ],
)
def test_a_page_that_cannot_be_is_refused_first(
    call: Call, files: tuple[str, str], tmp_path: Path, output: str, page: str, words: str
) -> None:
    answer = call("run", *files, "-o", output, "--report", page)
    assert answer.status == 2 and words in answer.err and not (tmp_path / "out.csv").exists()
