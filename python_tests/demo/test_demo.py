"""The demo as a user calls it: run once, it finds what was hidden, and its page needs nothing else."""

from __future__ import annotations

import json
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from command import DemoRun
from real_browser import Elements, needs_nothing_else
from repository_paths import ROOT
from tendonfmu.commands import demo

HIDDEN = ROOT / "examples" / "demo_recording" / "two_joints_hidden.json"
LARGEST = 4_000_000  # bytes of the page
CHAPTERS = ("calibrate", "detect", "diagnose", "fit", "run")


def numbers(pattern: str, text: str) -> list[float]:
    (found,) = re.findall(pattern, text, re.DOTALL)[:1]
    return [float(each) for each in found]


@pytest.mark.slow
def test_every_chapter_has_its_numbers_and_files(demo_run: DemoRun) -> None:
    folder, answer = demo_run
    assert answer.status == 0, answer
    assert all(f"{number} {name}: " in answer.err for number, name in enumerate(CHAPTERS, start=1))
    assert "as given: 8 of 11 pushes found" in answer.out and "16 numbers of the friction of two_joints" in answer.out
    found, pushes = numbers(r"events: (\d+) of (\d+) found", answer.out)
    assert pushes == 11 and found >= 10
    unseen = r"Not trained on: .* are left, ([\d.]+)\s%; with the starting values ([\d.]+)\s%"
    after, before = numbers(unseen, answer.out)
    assert 0 < after < 0.9 * before
    written = [line.partition(": ")[0] for line in answer.err.splitlines() if line.startswith("tendonfmu-demo")]
    assert len(written) > 10 and all((folder.parent / file).is_file() for file in written)


@pytest.mark.slow
def test_what_was_hidden_is_found_and_the_readme_says_so(demo_run: DemoRun) -> None:
    """One cause, the right one at the right place, of the right size, with an interval of its gain above 0; a torque
    that wanders is no effect, and said to be unknown."""
    hidden = json.loads(HIDDEN.read_text("utf-8"))
    assert not (files("tendonfmu") / "data" / HIDDEN.name).is_file()
    calibration = demo_run.folder / "calibration"
    report: dict[str, Any] = json.loads((calibration / "diagnosis" / "diagnosis.json").read_text("utf-8"))
    (cause,) = (each for each in report["causes"] if each["effect"] != "unknown")
    places = ("effect", "joint", "tendon")
    assert {key: cause[key] for key in places} == {key: hidden[key] for key in places}
    size = math.hypot(*cause["parameters"].values())
    assert size == pytest.approx(hidden["magnitude"], rel=0.05)
    assert report["gain"]["interval"][0] > 0.1

    def together(rms: list[float]) -> float:
        return 1e3 * math.sqrt(sum(value**2 for value in rms) / len(rms))  # of all joints, mN·m

    error = json.loads((calibration / "calibration.json").read_text("utf-8"))["error"]
    expected = [1e3 * size, 1e3 * hidden["magnitude"], together(error["calibrated"]), together(error["as_given"])]
    said = r"([\d.]+) mN·m of weight at joint 2; hidden were ([\d.]+)\).*?([\d.]+) mN·m of error are left of ([\d.]+\d)"
    assert numbers(said, (ROOT / "README.md").read_text("utf-8")) == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_the_page_is_self_contained(demo_run: DemoRun) -> None:
    """Nothing is loaded; links lead into the page or to files that the demo left; each chapter has a figure."""
    page = (demo_run.folder / "story.html").read_text("utf-8")
    assert len(page) < LARGEST
    needs_nothing_else(page)
    elements = Elements(page)
    ids = {attributes.get("id") for _, attributes in elements.tags}
    targets = {link["href"] or "" for link in elements.all("a")}
    assert {"calibration/calibration.html", "calibration/diagnosis/diagnosis.html", "fit/report.html"} <= targets
    for target in targets:
        assert target[1:] in ids if target.startswith("#") else (demo_run.folder / target).is_file(), target
    for chapter in CHAPTERS:
        assert '<div class="plot"' in page.split(f'<section id="{chapter}">')[1].split("</section>")[0], chapter


def test_chapters_that_cannot_be_are_left_out_loudly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tendonfmu.estimate.HAS_ESTIMATION", False)
    story = demo.Story(tmp_path / "out")
    assert "calibrate, diagnose, fit are left out: " in story.missing and "Eigen" in story.missing
    assert story.names == ["detect", "run"]
    for name in story.names:
        story.run(name, lambda words, done, total: None)
    story.write()
    report = story.report()
    assert (report["format"], report["left_out"]) == ("tendonfmu-demo-2", story.missing)
    assert [each["name"] for each in report["chapters"]] == ["detect", "run"]
    assert all(Path(file).is_file() for file in report["files"])
