"""The page of a fit: complete, self-contained, escaped; and in a real browser without errors, at any width."""

from __future__ import annotations

import copy
import dataclasses
import html
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import worn_finger
from fit_pictures import made_up_picture
from real_browser import Elements, figures_of, measure, needs_nothing_else, visit
from repetitions import repeated
from tendonfmu.errors import InputError
from tendonfmu.estimate.picture import FitPicture
from tendonfmu.report.fit_page import PAGE, fit_page, write_fit_page
from tendonfmu.report.fit_text import page_tables, residual_tables
from tendonfmu.report.numbers import rounded

LARGEST = 5_000_000  # bytes
HOSTILE = "<script>alert('x')</script>&\"$\\frac{"

Written = tuple[FitPicture, Path, dict[Path, str]]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    picture = made_up_picture()
    folder = tmp_path_factory.mktemp("fit") / "figures"
    return picture, folder, write_fit_page(picture, folder)


@pytest.fixture(scope="module")
def page(written: Written) -> str:
    return (written[1] / PAGE).read_text("utf-8")


def test_files_are_written_and_named(written: Written) -> None:
    _, folder, files = written
    assert {file.name for file in files} == {file.name for file in folder.iterdir()}
    assert next(iter(files)).name == PAGE
    assert {"torque_1.png", "torque_3.png", "residual_2.png", "laws_joints.png", "laws_tendon_8.png"} <= {
        file.name for file in files
    }
    assert 500_000 < (folder / PAGE).stat().st_size < LARGEST
    for file in files:
        if file.suffix == ".png":
            image = imread(file)[:, :, :3]
            assert min(image.shape[:2]) > 300 and 0.005 < np.mean(image < 0.98) < 0.6, file.name


def test_nothing_is_needed_from_elsewhere(page: str) -> None:
    needs_nothing_else(page)


def test_figures_are_whole_and_described(page: str) -> None:
    """3 × 4 torque, 2 × 12 residual, 44 laws, 1 error, 1 correlation; times of a recording are zoomed together."""
    figures = figures_of(page)
    assert len(figures) == 82 and all(figure["data"] for figure in figures)
    heat = figures[-1]["data"][0]["z"]
    assert heat.dtype == np.int8 and (np.diag(heat) == 100).all()
    linked = [figure["zoom"] for figure in figures if figure["zoom"]]
    assert {name: linked.count(name) for name in linked} == dict.fromkeys(
        ("torque_1", "torque_2", "torque_3", "residual_1", "residual_2"), 4
    )
    told = re.findall(r'<div class="plot"[^>]*>([^<]*)</div>', page)
    assert len(told) == 82 and min(map(len, told)) > 40 and len(set(told)) > 75


def test_every_number_is_in_the_tables(written: Written, page: str) -> None:
    picture = written[0]
    table = page.split('id="numbers"')[1]
    assert table.count("<tr") - table.count("<thead") == len(picture.report["parameters"])
    assert table.count('class="doubtful"') == sum(not entry["identified"] for entry in picture.report["parameters"])
    for entry in picture.report["parameters"][::40]:
        assert f"{entry['value']:.4g}" in table


def test_the_first_screen_says_it_all(written: Written, page: str) -> None:
    """How much is left, of what, against the start, the bias alone and the friction alone; by joint; what is known."""
    picture = written[0]
    first = page.split("<nav")[0].replace("\u00a0", " ")
    residual = picture.report["residual"]["train"]
    for key in ("torque_rms", "rms", "start_rms", "bias_only_rms", "model_only_rms"):
        for value in residual[key]:
            assert f"{1e3 * value:.1f}" in first or f"{1e3 * value:.2f}" in first, (key, value)
    together = {key: np.sqrt(np.mean(np.square(residual[key]))) for key in residual}
    assert f"{100 * together['rms'] / together['torque_rms']:.0f} %" in first
    assert f"{picture.report['identified']['count']}/{picture.report['identified']['of']}" in first
    assert picture.report["warnings"][0] in html.unescape(page.split("<nav")[1])


def test_rms_of_all_joints_is_their_mean_power(written: Written) -> None:
    for table in residual_tables(written[0]):
        assert table.rows[-1] is table.all
        values = [row.fitted for row in table.rows[:-1]]
        assert table.all.fitted == pytest.approx(np.sqrt(np.mean(np.square(np.array(values, dtype=float)))))


def changed(picture: FitPicture, **changes: Any) -> FitPicture:
    return dataclasses.replace(picture, report={**picture.report, **changes})


def text_of(picture: FitPicture) -> str:
    """The page without figures, as text."""
    return " ".join("".join(Elements(fit_page(picture)).words).split())


def test_names_and_warnings_are_escaped(written: Written) -> None:
    picture = written[0]
    fitted = copy.deepcopy(dict(picture.fitted.data))
    fitted["joints"][0]["name"] = fitted["tendons"][0]["name"] = HOSTILE
    recordings = [{**picture.report["recordings"][0], "path": HOSTILE}]
    hostile = changed(picture, finger=HOSTILE, warnings=[HOSTILE], recordings=recordings, options={HOSTILE: [HOSTILE]})
    text = fit_page(dataclasses.replace(hostile, fitted=dataclasses.replace(picture.fitted, data=fitted)))
    assert "<script" not in text  # nor one of its own: no figures
    assert text.count("&lt;script&gt;") >= 6


@pytest.mark.parametrize("change", [{"finished": False}, {"converged": False}])
def test_an_unsettled_fit_says_so_first(written: Written, change: dict[str, Any]) -> None:
    alert = '<p class="alert"><strong>'
    assert alert not in fit_page(written[0]) and alert in fit_page(changed(written[0], **change)).split("<main")[0]


def test_what_is_missing_is_left_out(written: Written) -> None:
    """No held-out data, no start, numbers that are null."""
    picture = written[0]
    residual = {"train": {**picture.report["residual"]["train"], "bias_only_rms": [None] * 4}, "held_out": None}
    del residual["train"]["start_rms"]
    innovations = {"nis": {"mean": None, "interval": [None, None], "consistent": False}}
    innovations["whiteness"] = {"lag_one": [None] * 4, "ljung_box_p": [None] * 4}
    text = text_of(changed(picture, residual=residual, innovations=innovations))
    assert "Held out of training" not in text and "nan" not in text.lower().replace("finance", "")


def test_comparisons_have_tables_and_many_of_them_one_tile(written: Written) -> None:
    picture = written[0]
    train = picture.report["residual"]["train"]
    for count in (1, 3):
        runs = [{"label": f"run {k}", **train, "rms": [0.002 * k] * 4} for k in range(1, count + 1)]
        page = changed(picture, residual={"train": train, "held_out": None, "comparisons": runs})
        tables, text = list(residual_tables(page)), fit_page(page)
        assert [table.title for table in tables[1:]] == [f"Not trained on: {run['label']}" for run in runs]
        assert [table.all.fitted for table in tables[1:]] == pytest.approx([2.0 * k for k in range(1, count + 1)])
        assert text.split('<ul class="tiles">')[1].split("</ul>")[0].count("<li>") == 4


def test_one_joint_has_one_table(written: Written) -> None:
    """A row for each set of data instead of a table."""
    picture = written[0]
    one = copy.deepcopy(dict(picture.fitted.data))
    del one["joints"][1:]
    residual = {key: value[:1] for key, value in picture.report["residual"]["train"].items()}
    report: dict[str, Any] = {
        "residual": {"train": residual, "held_out": residual, "comparisons": [{"label": "b", **residual}]},
        "parameters": [each for each in picture.report["parameters"] if each["path"].startswith("joints[1].")],
        "innovations": {"nis": {"mean": None}, "whiteness": {"lag_one": [0.0], "ljung_box_p": [1.0]}},
    }
    found = page_tables(
        dataclasses.replace(changed(picture, **report), fitted=dataclasses.replace(picture.fitted, data=one))
    )
    assert [row.name for row in found[0].rows] == ["Training", "Held out of training", "Not trained on: b"]
    assert len(found) == 1 and found[0].rows[1].fitted == pytest.approx(1e3 * residual["rms"][0])


def test_a_folder_that_cannot_be_made(written: Written, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be made"):
        write_fit_page(written[0], tmp_path / "file" / "figures")


# --- from the command line --------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_command_writes_it(tmp_path: Path) -> None:
    """A real fit, with the two recordings of figs. 6 and 7: training, and four times the pretension."""
    worn_finger.write_files(tmp_path, train=worn_finger.record(), x4=worn_finger.record(pretension=80.0))
    words = "fit finger.json train.parquet -o fitted.json --report r.json --figures figures --compare x4.parquet"
    done = subprocess.run(
        [sys.executable, "-m", "tendonfmu.cli", *words.split()], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "figures"
    assert {"report.html", "torque_1.png", "torque_2.png", "laws_joints.png", "correlation.png"} <= {
        file.name for file in folder.iterdir()
    }
    page = html.unescape((folder / PAGE).read_text("utf-8")).replace("\u00a0", " ")
    report = json.loads((tmp_path / "r.json").read_text("utf-8"))
    assert f"{report['identified']['count']}/{report['identified']['of']}" in page
    for found in (report["residual"]["train"], report["residual"]["comparisons"][0]):
        assert f"<b>{rounded(1e3 * found['rms'][0])}</b>" in page
    assert "Not trained on: x4" in page
    assert all(entry["path"].split(".", 1)[1] in page for entry in report["parameters"])


# --- in a real browser ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", repeated([1280, 400], 1))
def test_a_browser_shows_it_at_any_width(browser: str, page: str, tmp_path: Path, width: int) -> None:
    """All figures there, nothing wider than the page; only tables scroll, each in its own box."""
    found = measure(browser, tmp_path, page, width)
    assert found["width"] == width and found["scroll"] == width and found["out"] == []
    assert len(found["drawings"]) == 82 and all(300 < shown <= width for shown in found["drawings"])
    assert min(found["drawn"]) > 0
    assert found["font"] >= 15
    assert found["zoomed"] == ["torque_1"] * 4  # all joints of the recording, and no other
    assert found["paper"] == "rgb(255, 255, 255)" and set(found["ink"]) == {"rgb(34, 34, 34)"}
    if width == 400:
        assert found["scrolled"] > 5


def test_a_browser_has_nothing_to_complain_of(browser: str, written: Written, tmp_path: Path) -> None:
    file = tmp_path / PAGE
    shutil.copy(written[1] / PAGE, file)
    assert "CONSOLE" not in visit(browser, file, "--dump-dom").stderr
