"""The command `tendonfmu score` as a user calls it, on the demo's recordings."""

from __future__ import annotations

import json
import re
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

from command import Answer, Call
from fit_cases import small_finger
from real_browser import Elements
from repository_paths import ROOT
from tendonfmu.detect.scoring import scaled_bounds
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.model import finger_from_data
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import read_recording

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
DEMO = ROOT / "examples" / "demo_recording"
PUSHES, FREE_X4 = DEMO / "index_finger_pushes.parquet", DEMO / "index_finger_free_x4.parquet"
# docs/reference/commands/score.md#report
LITERAL = {"format", "events", "found", "false_alarms", "free_minutes", "median_delay_s", "free_rms"}
LITERAL |= {"contact_torque_rms_error"}

Table = dict[str, NDArray[np.float64]]


def shown_in(figures: Path) -> list[str | None]:
    """The figures on the page that is alone in the folder."""
    (page,) = figures.iterdir()
    assert page.name == "score.html"
    return [section["id"] for section in Elements(page.read_text("utf-8")).all("section")]


def report_of(answer: Answer, path: str = "s.json") -> dict[str, Any]:
    assert answer.status == 0, answer
    report: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "score_report.schema.json").read_text())
    jsonschema.validate(report, schema, cls=jsonschema.Draft202012Validator)
    return report


@pytest.fixture(scope="session")
def pushes() -> Table:
    """8 to 23 s of the demo's pushes: four of them, three found."""
    whole = read_table(PUSHES, lambda _file, _names: None)
    rows = slice(4000, 11500)
    return {name: np.array(column[rows]) for name, column in whole.items()}


def written(table: Table, name: str, **changes: NDArray[Any] | None) -> Path:
    """As a file in the test's folder; None leaves a column out."""
    changed = {**table, **changes}
    write_table(Path(name), {key: column for key, column in changed.items() if column is not None})
    return Path(name)


# --- what comes out ---------------------------------------------------------------------------------------------------


def test_the_demo_is_scored_as_by_hand(call: Call) -> None:
    """Counted again by hand: a loop over samples, nothing of the product's."""
    answer = call("score", INDEX, PUSHES, FREE_X4, "-o", "s.json")
    report = report_of(answer)
    assert set(report) > LITERAL
    assert (report["format"], report["events"], report["found"]) == ("tendonfmu-score-1", 11, 8)
    recording = read_recording(PUSHES)
    contact = Instance.from_description(json.loads(INDEX.read_text())).run(recording.arrays())["contact"].ravel()
    assert recording.contact is not None
    delays = delays_by_hand(recording.time, recording.contact, contact)
    assert [each["delay_s"] for each in report["recordings"][0]["event_list"]] == [
        None if delay is None else pytest.approx(delay) for delay in delays
    ]
    known = [delay for delay in delays if delay is not None]
    assert report["median_delay_s"] == report["delay_s"]["median"]["value"] == pytest.approx(np.median(known))
    for key in ("events", "found", "missed", "false_alarms", "free_minutes", "held"):
        assert report[key] == pytest.approx(sum(each[key] for each in report["recordings"]))
    assert 0.8 < report["recordings"][0]["free_minutes"] < 0.83 and len(report["free_rms"]) == 4
    assert "8 of 11 found" in answer.out and "no column contact" in answer.err
    own = [point for point in report["roc"]["points"] if point["factor"] == 1.0]
    assert [(each["found"], each["false_alarms"]) for each in own] == [(8, report["false_alarms"])]
    # thresholds in a range of 32, from latched up for good to nothing found
    factors = [point["factor"] for point in report["roc"]["points"]]
    assert factors == sorted(factors) and factors[-1] / factors[0] == 32.0
    assert report["roc"]["points"][-1]["found"] == report["roc"]["points"][-1]["false_alarms"] == 0


def delays_by_hand(time: NDArray[Any], label: NDArray[Any], contact: NDArray[Any]) -> list[float | None]:
    """Of labels that are further apart than 100 ms."""
    time, label, contact = time.tolist(), label.tolist(), contact.tolist()
    found: list[float | None] = []
    for k in range(1, len(time)):
        if not label[k] or label[k - 1]:
            continue
        quiet = not any(on for t, on in zip(time[:k], contact[:k], strict=True) if t >= time[k] - 0.2 - 1e-9)
        inside = next((i for i in range(k, len(time)) if contact[i] or not label[i]), k)
        found.append(time[inside] - time[k] if quiet and contact[inside] and label[inside] else None)
    return found


def test_labels_force_and_recordings_without_a_reference(call: Call, pushes: Table) -> None:
    load = {name: None for name in pushes if name.startswith("external")}
    force = np.linspace(0.0, 2.0, len(pushes["time"]))
    labelled = written(pushes, "a.parquet", contact=None, touched=pushes["contact"], newton=force)
    plain = written(pushes, "b.parquet", touched=pushes["contact"], contact=None, **load)
    options = ("--labels", "touched", "--force", "newton", "--figures", "fig", "--json")
    answer = call("score", INDEX, labelled, plain, "-o", "s.json", *options)
    report = report_of(answer)
    assert json.loads(answer.out) == report
    assert shown_in(Path("fig")) == ["contacts", "events", "roc"]
    first, second = report["recordings"]
    assert (report["labels"], report["events"], first["events"], second["events"]) == ("touched", 8, 4, 4)
    assert (first["external_torque"], second["external_torque"]) == (True, False)
    assert second["contact_torque_rms_error"] is second["contact_torque_slope"] is None
    assert report["contact_torque_rms_error"] == first["contact_torque_rms_error"]
    assert second["at_alarm"]["external_torque"] is second["at_alarm"]["force"] is None
    for event in first["event_list"]:
        assert event["found"] == (event["force"] is not None)
        if event["found"]:
            k = int(np.argmin(np.abs(pushes["time"] - event["alarm_s"])))
            assert event["force"] == pytest.approx(force[k])
            assert event["external_torque"] == pytest.approx([pushes[f"external_torque[{j}]"][k] for j in range(1, 5)])


def test_without_an_event_false_alarms_are_all(call: Call, pushes: Table) -> None:
    alarms = report_of(call("score", INDEX, written(pushes, "all.parquet"), "-o", "s.json"))["found"]
    nothing = {name: None for name in pushes if name.startswith("external")}
    free = written(pushes, "free.parquet", contact=None, **nothing)
    answer = call("score", INDEX, free, "-o", "s.json", "--figures", "fig")
    report = report_of(answer)
    assert "no event in column contact: false alarms only" in answer.err
    assert (report["events"], report["median_delay_s"], report["found_share"]["value"]) == (0, None, None)
    assert report["contact_torque_rms_error"] is None
    # what found a push is false without the label
    assert report["false_alarms"] >= alarms > 0
    assert report["false_alarms_per_minute"]["value"] == pytest.approx(report["false_alarms"] / 0.25, rel=1e-3)
    assert shown_in(Path("fig")) == ["contacts"]


def test_a_reference_sensor_labels_a_recording_that_has_no_label(call: Call, pushes: Table) -> None:
    labelled = report_of(call("score", INDEX, written(pushes, "all.parquet"), "-o", "s.json"))
    noise = np.random.default_rng(1).normal(0.0, 2e-4, len(pushes["time"]))
    sensed = {name: values + noise + 0.05 for name, values in pushes.items() if name.startswith("external")}
    answer = call("score", INDEX, written(pushes, "rec.parquet", contact=None, **sensed), "-o", "s.json")
    report = report_of(answer)
    assert "no column contact: contact is where external_torque is more than" in answer.err
    keys = ("events", "found", "false_alarms")
    assert [report[key] for key in keys] == [labelled[key] for key in keys]
    onsets = [[event["onset_s"] for event in each["recordings"][0]["event_list"]] for each in (report, labelled)]
    assert np.abs(np.subtract(*onsets)).max() < 0.05


def test_an_fmu_scores_the_same_without_a_roc(call: Call, pushes: Table) -> None:
    recording = written(pushes, "rec.parquet")
    assert call("build", INDEX, "-o", "finger.fmu").status == 0
    packed = report_of(call("score", "finger.fmu", recording, "-o", "fmu.json"), "fmu.json")
    plain = report_of(call("score", INDEX, recording, "-o", "s.json"))
    assert packed["roc"]["points"] is None and "FINGER.json" in packed["roc"]["absent"]
    assert plain["roc"]["absent"] is None
    if packed["contact_torque_within_two_std"] is None:  # not all that an FMU puts out is read of it
        for report in (plain, *plain["recordings"]):
            report["contact_torque_within_two_std"] = None
    # the residual of an FMU is got from its outputs
    for key in set(plain) - {"model", "roc"}:
        close_to(packed[key], plain[key], key, tolerance=1e-3 if key.startswith(("free_rms", "recordings")) else 0.0)


def test_scaled_bounds_are_all_that_decides() -> None:
    band = {"noise": [0.1, 0.2], "motor_load": [0.0, 3.0]}
    contact = {"threshold": [0.1, 0.2], "method": "bands", "bands": [band] * 4, "deviation": [1.0, 1.0]}
    finger = finger_from_data({**small_finger(), "contact": contact})
    scaled = finger.replace(scaled_bounds(finger, 2.0)).data["contact"]
    assert scaled["threshold"] == [0.2, 0.4] and scaled["deviation"] == [1.0, 1.0]
    assert all(each["noise"] == [0.2, 0.4] and each["motor_load"] == [0.0, 6.0] for each in scaled["bands"])


# --- bad input --------------------------------------------------------------------------------------------------------


def halves(table: Table) -> Path:
    return written(table, "half.csv", contact=0.5 * table["contact"])


def two_tendons(table: Table) -> Path:
    names = [name for name in table if not re.match(r"tendon_\w+\[[3-8]\]", name)]
    return written({name: table[name] for name in names}, "small.csv")


@pytest.mark.parametrize(
    ("make", "options", "words"),
    [
        (halves, (), ("half.csv", "column contact, row 509", "0.5", "expected 0 or 1")),
        (lambda table: written(table, "r.csv"), ("--labels", "touch"), ("r.csv", "no column touch")),
        (lambda table: written(table, "r.csv"), ("--labels", "tendon_force[1]"), ("tendon_force[1]", "signal")),
        (lambda table: written(table, "r.csv"), ("--force", "newton"), ("r.csv", "no column newton", "(N)")),
        (lambda table: written(table, "r.csv"), ("--kinematics", "3"), ("r.csv", "no column joint_velocity[1]")),
        (lambda table: written(table, "r.csv", Contact=table["contact"]), (), ("r.csv", "column 'Contact'", "contact")),
        (two_tendons, (), ("small.csv", "2 columns tendon_force[...], expected 8")),
        (
            lambda table: written({name: column[:1] for name, column in table.items()}, "r.csv"),
            (),
            ("r.csv: one sample",),
        ),
        (lambda table: Path("no.csv"), (), ("no.csv", "no such file")),
        (lambda table: written(table, "r.csv"), ("r.csv",), ("given twice",)),
        (lambda table: written(table, "r.csv"), ("--figures", "r.csv"), ("r.csv: a file; expected a folder",)),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    call: Call, pushes: Table, make: Any, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    short = {name: column[:600] for name, column in pushes.items()}
    answer = call("score", INDEX, make(short), "-o", "s.json", *options)
    assert answer.status == 2 and answer.out == "" and len(answer.err.splitlines()) == 1, answer
    assert all(word in answer.err for word in words), answer.err
    assert not Path("s.json").exists()


def test_what_is_no_model_is_refused(call: Call, pushes: Table) -> None:
    recording = written({name: column[:600] for name, column in pushes.items()}, "r.csv")
    Path("broken.fmu").write_text("no archive")
    for model, words in ((recording, "a recording; expected FINGER.json"), ("broken.fmu", "broken.fmu: not an FMU")):
        answer = call("score", model, recording, "-o", "s.json")
        assert answer.status == 2 and words in answer.err and not Path("s.json").exists(), answer


def close_to(found: Any, shown: Any, key: str, tolerance: float = 6e-3) -> None:
    """By default within what the page rounds to three digits."""
    if isinstance(shown, dict):
        for name, value in shown.items():
            close_to(found[name], value, f"{key}.{name}", tolerance)
    elif isinstance(shown, list):
        for each, value in zip(found, shown, strict=True):
            close_to(each, value, key, tolerance)
    elif isinstance(shown, float):
        assert found == pytest.approx(shown, rel=tolerance, abs=1e-12), key
    else:
        assert found == shown, key
