"""Commands on hands: the worst finger is named first, one that fails is left out; the page; the whole story."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tendonfmu as tf
from command import Call
from real_browser import Elements
from small_hand import FINGERS, worn_columns, write_worn_hand
from tendonfmu import diagnosis
from tendonfmu.commands.hand.commands import split_files
from tendonfmu.commands.hand.results import (
    CALIBRATION,
    PAGE,
    PartRow,
    calibration_row,
    stand_out,
    verdict,
    write_hand_page,
)


def words(page: Path) -> str:
    return " ".join(" ".join(Elements(page.read_text("utf-8")).words).replace("\u00a0", " ").split())


# --- pages, from reports ----------------------------------------------------------------------------------------------


def calibration(error: float, before: float = 4.0) -> dict[str, Any]:
    return {
        "error": {"as_given": [1e-3 * before], "calibrated": [1e-3 * error], "pretensions": []},
        "structure": {"causes": []},
        "alarms": {"alarms": 0, "minutes": 2.0, "interval": [0.0, 100.0]},
        "detection": {"false_alarms_per_hour": 6.0},
        "pushes": None,
        "warnings": [],
    }


@pytest.fixture
def hand(tmp_path: Path) -> tf.Hand:
    return tf.read_hand(write_worn_hand(tmp_path)["hand"])


def test_the_worst_finger_is_named_and_one_that_failed(hand: tf.Hand, tmp_path: Path) -> None:
    hand.path.write_text(hand.path.read_text().replace("right_hand", "<script>"))
    hand = tf.read_hand(hand.path)
    for errors, tones, words_of in (
        ((1.0, 3.0), ("fine", "fine"), "No finger of 2 stands out."),
        ((1.0, 1.2, 3.0), ("fine", "fine", "doubt"), "f2 is the worst: 3.00 mN·m are left on unseen motion."),
        ((5.0, 1.0), ("bad", "fine"), "f0 is the worst: 5.00 mN·m are left on unseen motion."),
        ((1.0,), ("fine",), "No finger of 1 stands out. 1 finger left out: ring."),
    ):
        rows = [
            calibration_row(hand.parts[0], calibration(each))._replace(name=f"f{k}") for k, each in enumerate(errors)
        ]
        rows = stand_out(rows)
        assert tuple(row.tone for row in rows) == tones
        rows += [PartRow("failed", -1.0, "", ("–",) * 4, "ring", "no motion")] if len(errors) == 1 else []
        assert verdict(rows) == words_of
        write_hand_page(hand, rows, CALIBRATION, tmp_path, recordings={}, files={})
        page = (tmp_path / PAGE).read_text("utf-8")
        assert "<script>" not in page and 'href="f0/calibration.html"' in page and "ring/" not in page
        assert ("ring was left out: no motion" in words(tmp_path / PAGE)) == (len(errors) == 1)


# --- splitting --------------------------------------------------------------------------------------------------------


def test_split_files_keep_their_time_if_nothing_changed(tmp_path: Path) -> None:
    """By their time a repeated history knows what it has done."""
    files = write_worn_hand(tmp_path, monday=worn_columns(1, seconds=2.0))
    (tmp_path / "other").mkdir()
    shutil.copy(files["monday"], tmp_path / "other" / "monday.parquet")
    hand, out = tf.read_hand(files["hand"]), tmp_path / "out"
    groups = [[files["monday"]], [tmp_path / "other" / "monday.parquet"]]
    split, failed = split_files(hand, groups, out)
    assert failed == {} and list(split) == list(FINGERS)
    assert [[Path(each).name for each in files] for files in split["ring"]] == [
        ["monday.parquet"],
        ["monday_2.parquet"],
    ]
    before = {file: file.stat().st_mtime_ns for file in out.rglob("*.parquet")}
    split_files(hand, groups, out)
    assert len(before) == 4 and {file: file.stat().st_mtime_ns for file in before} == before
    read = tf.read_recording(split["ring"][0][0])
    np.testing.assert_array_equal(read["tendon_force[1]"], worn_columns(1, seconds=2.0)["ring_tendon_force[1]"])


# --- commands ---------------------------------------------------------------------------------------------------------


def test_the_worse_finger_is_named(tmp_path: Path, call: Call) -> None:
    """And the finger whose reference says contact all the time is left out with its reason."""
    then, later = worn_columns(1), worn_columns(2, "ring")
    files = write_worn_hand(tmp_path, then=then | {"index_contact": np.ones_like(then["time"])}, later=later)
    answer = call(
        *("diagnose", files["hand"], files["later"], "--reference", files["then"], "-o", "out"),
        *("--kinematics", "3", "--json"),
    )
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert report["format"] == "tendonfmu-hand-diagnosis-1" and list(report["fingers"]) == ["ring"]
    assert [cause["effect"] for cause in report["fingers"]["ring"]["causes"]] == ["joint_friction"]
    assert "labelled contact" in report["failed"]["index"] and "warning: index: left out: " in answer.err
    assert "ring is the worst: " in words(Path("out/hand.html")) and Path("out/ring/diagnosis.html").is_file()
    assert not Path("out/index").exists() and report["failed"]["index"].startswith("recordings/index/then.parquet: ")


def test_a_finger_without_columns_is_its_row(tmp_path: Path, call: Call) -> None:
    columns = worn_columns(1, seconds=4.0)
    files = write_worn_hand(tmp_path, day={name: column for name, column in columns.items() if "ring" not in name})
    answer = call("score", files["hand"], files["day"], "-o", "score.json", "--kinematics", "3")
    wanted = "no column tendon_force[1]; expected one tendon_force[i] per tendon, in N"
    assert answer.status == 0 and f"warning: ring: left out: {files['day']}:ring: {wanted}" in answer.err
    assert list(json.loads(Path("score.json").read_text())["failed"]) == ["ring"]
    answer = call("check", files["hand"], files["day"], "--json")
    assert answer.status == 1 and f"ring: recordings do not belong to {files['hand']}" in answer.err
    belongs = {name: part["recordings"][0]["belongs"] for name, part in json.loads(answer.out)["fingers"].items()}
    assert belongs == {"index": True, "ring": False}


@pytest.mark.parametrize("kind", [(), pytest.param(("--history",), marks=pytest.mark.long)])
def test_an_internal_error_of_one_finger_is_its_row(
    tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch, kind: tuple[str, ...]
) -> None:
    name = "diagnose_history" if kind else "diagnose"
    real, broken = getattr(diagnosis, name), {"index"}

    def breaks(finger: Any, *given: Any, **options: Any) -> Any:
        if finger.path.stem in broken:
            raise KeyError(f"no {finger.path.stem}")
        return real(finger, *given, **options)

    monkeypatch.setattr(diagnosis, name, breaks)
    files = write_worn_hand(tmp_path, then=worn_columns(1, seconds=20.0), later=worn_columns(2, "ring", seconds=20.0))
    command = ("diagnose", files["hand"], files["later"], "--reference", files["then"], "-o", "out", *kind)
    answer = call(*command, "--kinematics", "3", "--json")
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert list(report["fingers"]) == ["ring"]
    assert report["failed"]["index"].startswith("internal error (KeyError), a fault of tendonfmu, not of its input; ")
    assert "KeyError: 'no index'" in Path("out/tendonfmu-error-index.txt").read_text()
    assert "please send the report out/tendonfmu-error-index.txt" in words(Path("out/hand.html"))
    broken.add("ring")
    answer = call(*command, "--kinematics", "3")
    assert answer.status == 3 and answer.err.count("\n") == 1 and "a fault of tendonfmu" in answer.err
    if kind:
        broken.clear()  # what failed is tried again
        assert set(json.loads(call(*command, "--kinematics", "3", "--json").out)["fingers"]) == {"index", "ring"}
        assert not Path("out/tendonfmu-error-index.txt").exists()


def test_a_score_counts_each_finger(tmp_path: Path, call: Call) -> None:
    columns = worn_columns(1, seconds=8.0)
    pushed = (columns["time"] % 4.0 > 3.0).astype(float)
    files = write_worn_hand(tmp_path, day=columns | {"ring_touch": pushed, "ring_force": pushed})
    answer = call(
        *("score", files["hand"], files["day"], "-o", "score.json", "--json", "--labels", "ring_touch"),
        *("--kinematics", "3"),
    )
    assert answer.status == 0, answer.err
    assert {part["events"] for part in json.loads(answer.out)["fingers"].values()} == {2}  # the label of all
    answer = call("score", files["hand"], files["day"], "-o", "score.json", "--labels", "touch", "--kinematics", "3")
    report = json.loads(Path("score.json").read_text())
    assert report["format"] == "tendonfmu-hand-score-1" and report["events"] == 2
    alone = tf.split_recording(tf.read_hand(files["hand"]), files["day"], ["touch"])["ring"]
    score = tf.score(tmp_path / "ring.json", alone, labels="touch", kinematics=3)
    assert report["fingers"]["ring"]["false_alarms"] == score.false_alarms
    assert "index" in report["failed"]  # it has no column with that label


# --- for real ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_calibrated_hand_does_not_depend_on_jobs(tmp_path: Path, call: Call) -> None:
    """It is a hand again, for `run` and `--from`; another call repeats nothing."""
    files = write_worn_hand(tmp_path, free=worn_columns(1, seconds=24.0), more=worn_columns(4, seconds=16.0))
    assert call("calibrate", files["hand"], files["free"], "-o", "one").status == 0
    assert call("calibrate", files["hand"], files["free"], "-o", "two", "--jobs", "2").status == 0
    for name in FINGERS:
        assert Path(f"one/{name}/finger.json").read_bytes() == Path(f"two/{name}/finger.json").read_bytes()
    assert Path("one/hand.json").read_bytes() == Path("two/hand.json").read_bytes()
    assert call("calibrate", files["hand"], files["free"], "-o", "one").status == 0
    report = json.loads(Path("one/ring/calibration.json").read_text())
    assert report["steps"]["repeated"] == ["diagnosis", "fit", "tune"]
    assert call("run", "one/hand.json", files["more"], "-o", "out.csv").status == 0
    assert call("calibrate", files["hand"], files["more"], "-o", "later", "--from", "one/hand.json").status == 0
    assert "previous" in json.loads(Path("later/ring/calibration.json").read_text())["error"]
