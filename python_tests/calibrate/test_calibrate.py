"""From free motion to a tuned FMU: what the folder holds, what is done again, and what the sentences say."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from command import Call, DemoRun
from tendonfmu.calibration import calibration
from tendonfmu.calibration.calibration import Calibration, Options, calibrate
from tendonfmu.calibration.fit import DIAGNOSED, JUDGED, fit_all, stretches_for_diagnosis
from tendonfmu.calibration.report import errors_of, left_out
from tendonfmu.calibration.text import calibration_page, size_rows, tiles, verdict, write_calibration
from tendonfmu.cli.command import several_values
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.errors import InputError
from tendonfmu.estimate.structure import described
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.prepared import Held, prepare
from tendonfmu.recordings.recording import Recording, read_recording
from tendonfmu.recordings.smoothing import Signals
from tendonfmu.report.numbers import rounded, together
from tendonfmu.tasks.steps import Steps

Numbers = NDArray[np.float64]

PUSH = 0.06  # N·m
FINGER, FREE, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"


def pushed(recording: Recording, data: dict[str, Any]) -> tuple[dict[str, Numbers], int]:
    """The recording as it would be with pushes of `PUSH` on joint 1 for 0.5 s every 3 s, and how many there are: the
    forces that bear them, and springs stretched by these."""
    arms = np.array([tendon["moment_arms"] for tendon in data["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    since = (recording.time - recording.time[0]) % 3.0
    touched = (since >= 2.0) & (since < 2.5)
    torque = np.zeros((len(recording), arms.shape[1]))
    torque[:, 0] = PUSH * np.minimum((since - 2.0) / 0.02, 1.0) * touched
    change = torque @ np.linalg.pinv(arms)
    columns: dict[str, Numbers] = {"time": recording.time, "contact": touched.astype(float)}
    force, position = (
        recording.groups["tendon_force"] + change,
        recording.groups["tendon_position"] + change / stiffness,
    )
    for i in range(len(stiffness)):
        columns[f"tendon_force[{i + 1}]"] = force[:, i]
        columns[f"tendon_position[{i + 1}]"] = position[:, i]
    for j in range(arms.shape[1]):
        columns[f"external_torque[{j + 1}]"] = torque[:, j]
    return columns, int((np.diff(touched.astype(int)) == 1).sum())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Finger, free motion, a test and pushes."""
    found = tmp_path_factory.mktemp("finger")
    with as_file(files("tendonfmu") / "data") as data:
        for name in (FINGER, FREE, UNSEEN):
            shutil.copy(data / name, found / name)
    columns, _ = pushed(read_recording(found / UNSEEN), json.loads((found / FINGER).read_text()))
    write_table(found / "pushes.parquet", columns)
    return found


@pytest.fixture(scope="module")
def calibrated(folder: Path, demo_run: DemoRun) -> tuple[Calibration, Path]:
    """The result, and the folder that it is written to: that of the demo, without pushes, goes on."""
    out = folder / "out"
    shutil.copytree(demo_run.folder / "calibration", out)
    found = calibrate(
        folder / FINGER, [folder / FREE], out, tests=[folder / UNSEEN], pushes=[folder / "pushes.parquet"]
    )
    write_calibration(found, out)
    return found, out


def test_the_missing_weight_is_built_in_and_the_error_falls(calibrated: tuple[Calibration, Path]) -> None:
    report = calibrated[0].report
    assert report["structure"]["verdict"] == "explained"
    assert [each["title"] for each in report["structure"]["causes"]] == ["The link's weight"]
    rms = {name: together(report["error"][name]) for name in ("bias_only", "as_given", "fitted", "calibrated")}
    assert rms["bias_only"] > rms["as_given"] > rms["fitted"] > 1.2 * rms["calibrated"]


def test_all_numbers_are_fitted_to_all_motion(calibrated: tuple[Calibration, Path], folder: Path) -> None:
    """From covers that are twice too stiff it finds back."""
    data = json.loads((calibrated[1] / "finger.json").read_text())
    data["contact"] = {"threshold": data["contact"]["threshold"]}
    for joint in data["joints"]:
        joint["cover"]["stiffness"] *= 2.0
    start = described(read_finger(calibrated[1] / "finger.json"), data)
    free = [prepare(start, read_recording(folder / FREE), 1, Held())]
    found = fit_all(start, free, Signals(30.0, 1), FitSettings(), given=data, seed=0)
    wrong, right = (together(errors_of(each, free, False)) for each in (data, found.data))
    assert right < 0.9 * wrong and "uncertainty" in found.data["contact"]


def test_pushes_are_found(calibrated: tuple[Calibration, Path], folder: Path) -> None:
    pushes = calibrated[0].report["pushes"]
    _, count = pushed(read_recording(folder / UNSEEN), json.loads((folder / FINGER).read_text()))
    assert pushes["events"] == count and pushes["found"] >= 0.9 * count and pushes["false_alarms"] == 0
    assert sum(each["events"] for each in pushes["sizes"]) == count
    assert sum(each["found"] for each in pushes["sizes"]) == pushes["found"]
    assert pushes["sizes"][-1]["from"] == 6.0, "they are large"


def test_little_motion_supports_a_higher_rate_and_says_what_is_missing(calibrated: tuple[Calibration, Path]) -> None:
    report = calibrated[0].report
    assert report["detection"]["false_alarms_per_hour"] == 6.0 < report["detection"]["tuned_for_per_hour"] < 200.0
    assert any("min more of free motion" in sentence for sentence in report["next"])


def test_what_is_wrong_with_a_recording_is_said_once(
    calibrated: tuple[Calibration, Path], folder: Path, tmp_path: Path
) -> None:
    """A gap, which the readers of each step see, too."""
    whole = read_recording(folder / FREE)
    rows = (whole.time < 10.0) | ((whole.time > 12.0) & (whole.time < 25.0))
    columns = {f"{name}[{k + 1}]": each[rows] for name, group in whole.groups.items() for k, each in enumerate(group.T)}
    write_table(tmp_path / "gap.parquet", {"time": whole.time[rows], **columns})
    previous = calibrated[1] / "finger.json"  # so that nothing is diagnosed
    found = calibrate(folder / FINGER, [tmp_path / "gap.parquet"], tmp_path / "out", previous=previous)
    assert sum(" gap" in sentence for sentence in found.report["warnings"]) == 1, found.report["warnings"]


def test_the_folder_holds_finger_fmu_page_and_report(calibrated: tuple[Calibration, Path]) -> None:
    from tendonfmu.fmu.fmpy_client import run_fmu

    found, out = calibrated
    finger = read_finger(out / "finger.json")
    assert finger.data == json.loads(json.dumps(found.data)) and "gravity" in (out / "finger.json").read_text()
    report = json.loads((out / "calibration.json").read_text(encoding="utf-8"))
    assert report["format"] == "tendonfmu-calibration-1" and report["error"] == found.report["error"]
    page = (out / "calibration.html").read_text(encoding="utf-8")
    assert verdict(report)[1] in page and page.count("The link&#39;s weight") == 1
    assert all((out / file).is_file() for file in report["files"])
    sizes = [f">{rounded(1e3 * joint['friction']['coulomb'], 2)}</text>" for joint in finger.data["joints"]]
    assert all(size in page for size in sizes), "friction is written on the drawing"
    recording = read_recording(out.parent / UNSEEN)
    short = replace(
        recording, time=recording.time[:50], groups={key: each[:50] for key, each in recording.groups.items()}
    )
    assert "compensated_torque[2]" in run_fmu(out / "finger.fmu", short)


def test_the_command_goes_on_where_the_folder_ends(
    call: Call, calibrated: tuple[Calibration, Path], folder: Path
) -> None:
    given = ("--test", folder / UNSEEN, "--pushes", folder / "pushes.parquet")
    answer = call("calibrate", folder / FINGER, folder / FREE, *given, "-o", calibrated[1])
    assert answer.status == 0, answer.err
    report = json.loads((calibrated[1] / "calibration.json").read_text(encoding="utf-8"))
    assert report["steps"]["repeated"] == ["diagnosis", "fit", "tune", "score"]
    assert verdict(report)[1] in answer.out


def test_what_is_unchanged_is_not_done_again(
    call: Call, calibrated: tuple[Calibration, Path], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, out = calibrated

    def never(*given: Any, **options: Any) -> Any:
        raise AssertionError("done again")

    for name in ("diagnose", "fit_all"):
        monkeypatch.setattr(calibration, name, never)
    again = calibrate(
        folder / FINGER, [folder / FREE], out, tests=[folder / UNSEEN], pushes=[folder / "pushes.parquet"]
    )
    assert again.report["steps"]["repeated"] == ["diagnosis", "fit", "tune", "score"]
    assert again.data == found.data
    tests = ("--test", folder / UNSEEN, "--pushes", folder / "pushes.parquet")
    answer = call("calibrate", folder / FINGER, folder / FREE, *tests, "-o", out, "--json", "--quiet")
    assert answer.status == 0 and answer.err == ""
    assert json.loads(answer.out) == json.loads((out / "calibration.json").read_text(encoding="utf-8"))
    other = calibrate(
        folder / FINGER, [folder / FREE], out, tests=[folder / UNSEEN], options=Options(false_alarms_per_hour=360.0)
    )
    assert other.report["steps"]["repeated"] == ["diagnosis", "fit"] and other.report["pushes"] is None
    with pytest.raises(AssertionError, match="done again"):
        calibrate(folder / FINGER, [folder / UNSEEN], out)


def test_an_earlier_calibration_is_the_prior_of_little_data(
    calibrated: tuple[Calibration, Path], folder: Path, tmp_path: Path
) -> None:
    """Its structure stays and nothing is diagnosed; unseen motion is no worse."""
    _, out = calibrated
    recording = read_recording(folder / FREE)
    columns: dict[str, Numbers] = {"time": recording.time[:5000]}
    for name, values in recording.groups.items():
        columns |= {f"{name}[{i + 1}]": values[:5000, i] for i in range(values.shape[1])}
    write_table(tmp_path / "short.parquet", columns)
    again = calibrate(
        folder / FINGER,
        [tmp_path / "short.parquet"],
        tmp_path / "again",
        tests=[folder / UNSEEN],
        previous=out / "finger.json",
    )
    write_calibration(again, tmp_path / "again")
    error = again.report["error"]
    assert together(error["calibrated"]) <= together(error["previous"]) < together(error["bias_only"])
    assert "gravity" in json.dumps(again.data["extensions"]) and again.report["structure"]["causes"] == []
    page = (tmp_path / "again" / "calibration.html").read_text(encoding="utf-8")
    assert "the earlier calibration" in page and "diagnosis.html" not in page
    other = json.loads((out / "finger.json").read_text())
    other["joints"][0]["name"] = "thumb"
    (tmp_path / "other.json").write_text(json.dumps(other))
    with pytest.raises(InputError, match=r"joints thumb.*expected joint_1"):
        calibrate(folder / FINGER, [folder / FREE], tmp_path / "no", previous=tmp_path / "other.json")


def test_touched_motion_is_no_free_motion(folder: Path, tmp_path: Path) -> None:
    """Said before anything is fitted, not by the thresholds at the end."""
    with pytest.raises(InputError, match=r"pushes.parquet: column contact"):
        calibrate(folder / FINGER, [folder / "pushes.parquet"], tmp_path)


@pytest.mark.parametrize(
    ("free", "tests", "words"), [([], [], "no recording"), ([FREE], [FREE], "a test"), ([FREE, FREE], [], "twice")]
)
def test_recordings_that_cannot_be_are_refused(
    free: list[str], tests: list[str], words: str, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words):
        calibrate(folder / FINGER, [folder / each for each in free], tmp_path, tests=[folder / each for each in tests])


def test_a_recording_of_another_finger_is_refused_before_any_fit(folder: Path, tmp_path: Path) -> None:
    recording = read_recording(folder / FREE)
    columns = {"time": recording.time}
    for name, values in recording.groups.items():
        for i in range(values.shape[1]):
            columns[f"{name}[{i + 1}]"] = values[:, i] * (-1.0 if name == "tendon_position" and i == 1 else 1.0)
    write_table(tmp_path / "turned.parquet", columns)
    with pytest.raises(InputError, match=r"tendon_position\[2\].*sign"):
        calibrate(folder / FINGER, [tmp_path / "turned.parquet"], tmp_path / "out")


@pytest.mark.parametrize(
    ("given", "read", "options"),
    [
        ("f a --test b c --pushes d e -o o", "f a --test b --test c --pushes d --pushes e -o o", "--test --pushes -o"),
        ("f a --pushes d e", "f a --pushes d e", "--test"),  # of a command without pushes
    ],
)
def test_several_tests_and_pushes_after_the_recordings(given: str, read: str, options: str) -> None:
    assert several_values(given.split(), set(options.split())) == read.split()


# --- steps ------------------------------------------------------------------------------------------------------------


def test_a_step_belongs_to_what_it_was_made_from_and_to_the_steps_before_it(tmp_path: Path) -> None:
    done: list[str] = []
    (tmp_path / "page").touch()

    def make(name: str, value: Any) -> dict[str, Any]:
        done.append(name)
        return {"value": value}

    def results(given: str, option: int) -> list[dict[str, Any]]:
        steps = Steps(tmp_path, {"given": given})
        return [
            steps.result("one", {}, lambda: make("one", [given])),
            steps.result("two", {"option": option}, lambda: make("two", option), tmp_path / "page"),
        ]

    first = results("a", 1)
    assert results("a", 1) == first == [{"value": ["a"]}, {"value": 1}] and done == ["one", "two"]
    assert results("a", 2)[1] == {"value": 2} and done == ["one", "two", "two"]
    results("b", 2)
    assert done[3:] == ["one", "two"]
    (tmp_path / ".steps" / "two.json").write_text('{"format": "tendonfmu-calibration-step-1", "key":')  # cut off
    results("b", 2)
    assert done[5:] == ["two"]
    (tmp_path / "page").unlink()
    results("b", 2)
    assert done[6:] == ["two"], "the page that it writes was gone"


# --- stretches that are diagnosed -------------------------------------------------------------------------------------


def motion(seconds: float, name: str = "a.parquet") -> Recording:
    time = np.arange(0.0, seconds, 0.1)
    return Recording(
        Path(name), time, {"tendon_force": np.ones((len(time), 2)), "tendon_position": np.ones((len(time), 2))}
    )


def test_the_shown_motion_is_the_typical_one_of_the_test(calibrated: tuple[Calibration, Path]) -> None:
    shown = calibrated[0].shown
    assert shown.recording == UNSEEN and 10.0 <= shown.time[-1] - shown.time[0] <= 20.0
    before, after = (np.sqrt(np.nanmean(left**2)) for left in (shown.before, shown.after))
    report = calibrated[0].report["error"]
    assert after < 0.9 * before < np.nanstd(shown.torque)
    assert after == pytest.approx(together(report["calibrated"]), rel=0.3)


def test_the_shown_push_is_a_found_one(calibrated: tuple[Calibration, Path]) -> None:
    """Its torque rises from its onset on, and the delay is the median one."""
    result, folder = calibrated
    push = result.push
    assert push is not None and push.joint in result.report["joints"]
    time, felt = np.array(push.time), np.abs(push.felt)
    assert felt[(time > push.delay) & (time < push.end)].max() > 3.0 * np.median(felt[time < 0.0])
    assert 0.0 <= push.delay < push.end and push.delay == pytest.approx(
        result.report["pushes"]["median_delay_s"], abs=0.1
    )
    assert "contact reported after" in (folder / "calibration.html").read_text(encoding="utf-8")
    assert "Labelled pushes" in calibration_page(replace(result, push=None))  # none is found


def test_long_recordings_are_diagnosed_in_part_and_judged_on_another() -> None:
    free = [motion(500.0), motion(1000.0, "b.parquet")]
    seen, judged = stretches_for_diagnosis(free, [])
    assert sum(each.time[-1] - each.time[0] for each in seen) == pytest.approx(DIAGNOSED, abs=1.0)
    assert sum(each.time[-1] - each.time[0] for each in judged) == pytest.approx(JUDGED, abs=16.0)
    for one, other in zip(seen, judged, strict=False):
        assert not set(one.time) & set(other.time) or one.path.stem[0] != other.path.stem[0]
    assert seen[0].path.name == "a, 0 to 30 s.parquet"


def test_short_recordings_are_diagnosed_whole() -> None:
    free = [motion(100.0)]
    assert stretches_for_diagnosis(free, []) == (free, [])
    seen, judged = stretches_for_diagnosis(free, [motion(30.0, "t.parquet")])
    assert len(judged[0].time) == 300 and seen[0].time[-1] == pytest.approx(DIAGNOSED, abs=0.2)


# --- sentences --------------------------------------------------------------------------------------------------------


def report(given: float, calibrated: float, causes: int, limit: float | None) -> dict[str, Any]:
    return {
        "error": {"as_given": [given, given], "calibrated": [calibrated, calibrated]},
        "structure": {"causes": [{}] * causes},
        "detection": {"held_out": {"limit": limit, "alarms": 0, "minutes": 27.0}},
    }


def test_the_verdict_is_one_sentence_with_the_figures() -> None:
    tone, sentence = verdict(report(0.0142, 0.00614, 3, 5.33))
    assert tone == "good" and "from 14.2 to 6.14 mN·m" in sentence and "3 causes" in sentence
    assert "No false alarms in 27 min" in sentence and "fewer than 5.33 an hour" in sentence
    unknown = report(0.0142, 0.00614, 3, None)
    unknown["detection"] |= {"confidence": 0.9, "smallest_torque": {"median": [0.01]}}
    assert verdict(unknown)[1].endswith("27 min of free motion.")
    values = list(tiles(unknown | {"pushes": None, "error": unknown["error"] | {"held_out": True}}))
    assert values[1] == ("0", "in 27 min", "false alarms in free motion")
    tone, sentence = verdict(report(0.005, 0.006, 0, 5.33))
    assert tone == "bad" and "no better" in sentence


def test_pushes_are_told_by_size() -> None:
    rows = [
        {"from": 0.0, "below": 1.5, "events": 4, "found": 1, "interval": [0.1, 0.8]},
        {"from": 1.5, "below": 3.0, "events": 4, "found": 2, "interval": [0.1, 0.8]},
        {"from": 6.0, "below": None, "events": 4, "found": 4, "interval": [0.4, 1.0]},
    ]
    found = size_rows({"pushes": {"sizes": rows}})
    assert [row[0] for row in found] == ["below 1.5 times", "1.5 to 3 times", "6 times and more"]
    assert found[2][1:] == ("4 of 4", "40 to 100 %")
    assert size_rows({"pushes": None}) == [] and math.isclose(together([3.0, 4.0]), math.sqrt(12.5))


def test_many_stretches_that_are_left_out_are_one_warning() -> None:
    events: list[Any] = [
        SimpleNamespace(recording="a.csv", start=10.0 * k, end=11.0 * k, description=f"at joint {k}")
        for k in range(1, 5)
    ]
    assert len(left_out(events[:2])) == 2 and left_out(events[:2])[0].endswith("at joint 1; left out of the fit")
    (said,) = left_out(events)
    assert said.startswith("4 stretches, 10 s in all") and "at joint 4" in said
