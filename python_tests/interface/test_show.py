"""How fingers, recordings and results show themselves: HTML with escaped texts, and figures with all that they name."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import diagnosis_examples as examples
import tendonfmu as tf
from real_browser import Elements
from repository_paths import ROOT
from tendonfmu.drawing import sheets_figure
from tendonfmu.interface import Diagnosis, diagnosing
from tendonfmu.report import diagnosis_sheets

INDEX = ROOT / "examples/demo_recording/index_finger_calibrated.json"
PUSHES = ROOT / "examples/demo_recording/index_finger_pushes.parquet"
TRAINING = ROOT / "examples/demo_recording/two_joints_training.parquet"
EVIL = "<script>&amp;"


def axes_of(figure: Any, letter: str) -> list[str]:
    return [name for name in figure.to_plotly_json()["layout"] if name.startswith(f"{letter}axis")]


def test_a_finger_shows_its_properties_and_routing() -> None:
    finger = tf.read_finger(INDEX).replace({"name": EVIL, "joints[2].name": EVIL, "tendons[3].name": EVIL})
    page = finger._repr_html_()
    assert "<script>" not in page and "&lt;script&gt;&amp;amp;" in page
    elements = Elements(page)
    assert len([tag for tag, _ in elements.tags if tag == "polyline"]) == finger.tendons
    assert "5500 to 8000 N/m" in page


def test_a_recording_shows_its_signals() -> None:
    frame = pd.read_parquet(PUSHES)
    recording = tf.Recording.from_frame(frame, name=EVIL)
    page = recording._repr_html_()
    assert "<script>" not in page and "30000 samples" in page and "tendon_force" in page
    figure = recording.plot()
    assert len(axes_of(figure, "y")) == len(recording.groups) == 4
    assert {trace.name for trace in figure.data} == set(frame.columns) - {"time", "contact"}
    pushes = int((np.diff(frame["contact"].astype(int), prepend=0) > 0).sum())
    assert len(figure.layout.shapes) == pushes * len(recording.groups)
    force = next(trace for trace in figure.data if trace.name == "tendon_force[3]")
    assert force.y.max() == frame["tendon_force[3]"].max()  # thinned to extremes
    assert "<script>" not in figure.layout.title.text


def test_a_run_shows_every_joint() -> None:
    out = tf.run(INDEX, PUSHES)
    figure = out.plot()
    assert len(axes_of(figure, "y")) == 4 and len(figure.data) == 12
    assert sum(trace.showlegend for trace in figure.data) == 3
    assert [figure.layout[name].matches for name in axes_of(figure, "x")] == [None, "x", "x", "x"]  # zoomed together
    page = out._repr_html_()
    assert "compensated_torque[4]" in page and "samples in contact" in page


@pytest.mark.parametrize("make", [examples.three_causes, examples.adequate])
def test_a_diagnosis_shows_the_panels_of_its_page(make: Any) -> None:
    found = Diagnosis(replace(make(), finger=EVIL))
    figure, panels = found.plot(), [panel for sheet in diagnosis_sheets(found.found) for panel in sheet.panels]
    assert len(axes_of(figure, "x")) == len(panels) > 3
    placed = [annotation for annotation in figure.layout.annotations if annotation.text]
    assert len(placed) == len(panels)
    domains = {tuple(figure.layout[name].domain) for name in axes_of(figure, "x")}
    assert len(domains) == 2 and all(0 <= low < high <= 1 for low, high in domains)
    evidence = [panel for sheet in diagnosis_sheets(found.found) if sheet.section != "views" for panel in sheet.panels]
    assert len(axes_of(found.plot(residuals=False), "x")) == len(evidence) < len(panels)
    page = found._repr_html_()
    assert "<script>" not in page and found.verdict in page
    assert [each.effect for each in found.causes] == [each["effect"] for each in found.report["causes"]]


def test_keys_of_a_figure_are_in_lines_above_the_panels() -> None:
    found = Diagnosis(examples.three_causes())
    layout = found.plot().layout
    meanings = {meaning for sheet in diagnosis_sheets(found.found) for _, meaning in sheet.keys}
    heading, *keys = layout.title.text.removesuffix("</sup>").split("<br>")
    assert heading == repr(found)[1:-1] and len(keys) > 1
    shown = [re.sub(r"<.*?>", "", line) for line in keys]
    assert all(len(line) < 90 for line in shown)  # a page of 640 px
    assert {each.strip() for line in shown for each in line.split("■")[1:]} == {html.escape(each) for each in meanings}
    assert layout.margin.t >= 75 + 18 * len(keys)


def test_warnings_name_the_line_of_the_caller() -> None:
    with pytest.warns(tf.FitWarning) as found:
        tf.fit(ROOT / "examples/demo_recording/two_joints.json", TRAINING, only="joints[1].friction.coulomb", passes=2)
    assert {each.filename for each in found if each.category is tf.FitWarning} == {__file__}
    with pytest.warns(tf.TuneWarning) as found:
        tf.tune(INDEX, INDEX.with_name("index_finger_free.parquet"))
    assert {each.filename for each in found if each.category is tf.TuneWarning} == {__file__}


def test_all_functions_warn_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording without a label, and what a diagnosis says of its recordings."""
    with pytest.warns(tf.ScoreWarning, match="no column contact") as found:
        scored = tf.score(INDEX, pd.read_parquet(PUSHES).drop(columns="contact").iloc[:4000])
    own = [each for each in found if each.category is tf.ScoreWarning]
    assert {each.filename for each in own} == {__file__} and [str(each.message) for each in own] == scored.warnings
    assert "<li>" in scored._repr_html_()
    made = replace(examples.adequate(), warnings=("too little <motion>",))
    monkeypatch.setattr(diagnosing, "find", lambda *_, **__: made)
    with pytest.warns(tf.DiagnosisWarning, match="^too little <motion>$") as found:
        diagnosed = tf.diagnose(INDEX, TRAINING)
    assert [each.filename for each in found] == [__file__]
    assert "<li>too little &lt;motion&gt;</li>" in diagnosed._repr_html_()


@pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")
def test_a_fit_lists_its_warnings_in_a_notebook() -> None:
    path = "joints[1].friction.coulomb"
    found = tf.fit(ROOT / "examples/demo_recording/two_joints.json", TRAINING, only=path, passes=2)
    assert found.warnings and found._repr_html_().count("<li>") == len(found.warnings)


def test_a_cause_has_a_short_text_and_its_gain_is_explained() -> None:
    found = Diagnosis(examples.three_causes())
    for cause in found.causes:
        assert len(repr(cause)) < 160 and repr(cause).startswith(f"<Cause {cause.effect}") and cause.size in repr(cause)
    assert "with the other causes" in found._repr_html_()
    assert "lacks only" not in Diagnosis(examples.adequate())._repr_html_()


def test_no_panel_is_no_error() -> None:
    assert len(sheets_figure("nothing", []).data) == 0


def test_results_name_themselves(tmp_path: Path) -> None:
    finger = tf.read_finger(INDEX)
    assert repr(finger) == "<Finger index_finger: 4 joints, 8 tendons>"
    assert repr(tf.Runner(finger)) == "<Runner of <Finger index_finger: 4 joints, 8 tendons>, kinematics 1>"
    assert repr(tf.read_recording(PUSHES)).startswith(f"<Recording {PUSHES}: 30000 samples in 59.998 s, ")
