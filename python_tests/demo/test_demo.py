"""The demo as a user calls it: it is run once, and everything that it says and leaves is looked at."""

from __future__ import annotations

import json
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from command import DemoRun
from optional_parts import require
from real_browser import Elements, measure, needs_nothing_else
from repository_paths import ROOT
from tendonfmu.demo import demo
from tendonfmu.demo.page import story_report
from tendonfmu.files.tables import read_table

HIDDEN = ROOT / "examples" / "demo_recording" / "two_joints_hidden.json"
LARGEST = 4_000_000  # bytes of the page
PAGE = "story.html"
CHAPTERS = ("calibrate", "detect", "diagnose", "fit", "run")


@pytest.mark.slow
def test_the_demo_tells_the_whole_story(demo_run: DemoRun, tmp_path: Path) -> None:
    folder, answer = demo_run
    assert answer.status == 0, answer
    says_every_chapter(answer.out, answer.err)
    leaves_what_it_lists(folder, answer.out)
    finds_what_was_hidden(folder, answer.out)
    page = (folder / PAGE).read_text("utf-8")
    is_self_contained(folder, page)
    tells_the_same(page, answer.out)
    fits_screens(tmp_path, page)


def test_chapters_that_cannot_be_are_left_out_loudly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "HAS_ESTIMATION", False)
    story = demo.Story(tmp_path / "out")
    assert [each.name for each in story.chapters] == ["detect", "run"]
    assert "calibrate, diagnose, fit are left out: " in story.missing and "Eigen" in story.missing
    report = story_report(story)
    assert (report["format"], report["left_out"]) == ("tendonfmu-demo-1", story.missing)
    assert [each["name"] for each in report["chapters"]] == ["detect", "run"]


def says_every_chapter(out: str, err: str) -> None:
    for number, name in enumerate(CHAPTERS, start=1):
        assert f"{number} {name}: " in err
    for words in ("mcp_abduction", "as given:   8 of 11 pushes found", "16 numbers from 60 s of motion"):
        assert words in out, out
    found, pushes = re.findall(r"calibrated: (\d+) of (\d+) pushes found", out)[0]
    assert int(pushes) == 11 and int(found) >= 10
    assert re.search(r"warning: 1\.\d min of free motion: at most \d+", out), "what so little motion does not support"
    before, after = (float(each) for each in re.findall(r"error falls from ([\d.]+) to ([\d.]+) mN·m rms\n", out)[0])
    assert 0 < after < 0.9 * before


def leaves_what_it_lists(folder: Path, out: str) -> None:
    recordings = {f"index_finger_{name}.csv" for name in ("free", "free_x4", "pushes")}
    own = {PAGE, "index_finger.fmu", "compensated.png", "fit", "calibration", *recordings}
    assert {file.name for file in folder.iterdir()} == own
    for line in out.splitlines():
        if line.startswith("  tendonfmu-demo"):
            assert (folder.parent / line.split()[0]).is_file(), line
    assert {"report.html", "fitted.json"} < {file.name for file in (folder / "fit").iterdir()}
    calibrated = {file.name for file in (folder / "calibration").iterdir()}
    assert {"calibration.html", "finger.json", "finger.fmu", "calibration.json", "diagnosis"} <= calibrated
    tables = {name: read_table(folder / name, lambda *_: None) for name in recordings}
    assert {len(table["time"]) for table in tables.values()} == {30000}
    assert tables["index_finger_free.csv"]["contact"].mean() < 0.05
    assert 0.1 < tables["index_finger_pushes.csv"]["contact"].mean() < 0.3


def finds_what_was_hidden(folder: Path, out: str) -> None:
    """One cause, the right one at the right place, of the right size, with an interval of its gain above 0."""
    hidden = json.loads(HIDDEN.read_text("utf-8"))
    assert not (files("tendonfmu") / "data" / HIDDEN.name).is_file()
    report: dict[str, Any] = json.loads((folder / "calibration" / "diagnosis" / "diagnosis.json").read_text("utf-8"))
    (cause,) = report["causes"]
    assert {key: cause[key] for key in ("effect", "joint", "tendon")} == {
        key: hidden[key] for key in ("effect", "joint", "tendon")
    }
    assert math.hypot(*cause["parameters"].values()) == pytest.approx(hidden["magnitude"], rel=0.05)
    assert report["gain"]["interval"][0] > 0.1
    the_pages_say(folder, report)
    assert "gravity at joint 2: " in out and "the link's weight, at joint 2" in out


def the_pages_say(folder: Path, report: dict[str, Any]) -> None:
    """Size and errors in the README, and the errors in that of the recordings, as they come out."""
    first = (ROOT / "README.md").read_text("utf-8")
    pattern = (
        r"([\d.]+) mN·m of weight at joint 2; hidden were ([\d.]+)\).*?([\d.]+) mN·m of error are left of ([\d.]+\d)"
    )
    size, hidden, after, before = re.findall(pattern, first, re.DOTALL)[0]
    (cause,) = report["causes"]
    assert float(size) == pytest.approx(1e3 * math.hypot(*cause["parameters"].values()), rel=0.01)
    assert float(hidden) == pytest.approx(1e3 * json.loads(HIDDEN.read_text("utf-8"))["magnitude"], rel=0.01)
    error = json.loads((folder / "calibration" / "calibration.json").read_text("utf-8"))["error"]
    assert float(before) == pytest.approx(together(error["as_given"]), rel=0.01)
    assert float(after) == pytest.approx(together(error["calibrated"]), rel=0.02)
    own = (HIDDEN.parent / "README.md").read_text("utf-8")
    before, after = re.findall(r"falls from ([\d.]+) to ([\d.]+) mN·m rms", own)[0]
    for told, model in ((before, "nominal"), (after, "extended")):
        assert float(told) == pytest.approx(together(report[model]["test_rms"]), rel=0.03)


def together(rms: list[float]) -> float:
    """Of all joints, mN·m."""
    return 1e3 * math.sqrt(sum(value**2 for value in rms) / len(rms))


def is_self_contained(folder: Path, page: str) -> None:
    """Nothing is loaded; links lead into the page or to files that the demo left."""
    elements = Elements(page)
    assert len(page) < LARGEST
    needs_nothing_else(page)
    assert all(len(told) > 40 for told in re.findall(r'<div class="plot"[^>]*>([^<]*)</div>', page))
    ids = {attributes.get("id") for _, attributes in elements.tags}
    targets = {link["href"] or "" for link in elements.all("a")}
    assert {"calibration/calibration.html", "calibration/diagnosis/diagnosis.html", "fit/report.html"} <= targets
    assert {f"#{chapter}" for chapter in CHAPTERS} <= targets
    for target in targets:
        assert target[1:] in ids if target.startswith("#") else (folder / target).is_file(), target


def tells_the_same(page: str, out: str) -> None:
    text = " ".join(" ".join(Elements(page).words).replace("\u00a0", " ").split())
    told = " ".join(out.replace("\u00a0", " ").split())
    for pattern in (r"One cause explains [^.]*\.", r"1\d of 11 pushes found[^;]*?ms", r"16 numbers from .*? rms"):
        sentence = re.search(pattern, told)
        assert sentence is not None and sentence[0] in text, pattern
    for section in CHAPTERS:
        assert '<div class="plot"' in page.split(f'<section id="{section}">')[1].split("</section>")[0], section


def fits_screens(folder: Path, page: str) -> None:
    """Where a browser is installed: nothing sticks out, no picture is broken."""
    browser = require("browser")
    for width in (1280, 390):
        found = measure(browser, folder, page, width)
        assert found["scroll"] <= found["width"] and not found["out"], found["out"]
        assert min(found["drawn"]) > 0 and not found["requests"]
