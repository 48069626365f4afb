"""The command `tendonfmu diagnose` as a user calls it, and `excite --discriminate`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import diagnosis_examples as examples
from command import Call
from tendonfmu.commands.command import several_values
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.errors import InputError
from tendonfmu.estimate.files import check_unseen
from tendonfmu.files.tables import read_table
from tendonfmu.recordings.recording import Recording
from tendonfmu.report.diagnosis_files import write_diagnosis
from tendonfmu.tasks.phases import PhaseState

NAMED = {"diagnosis.html", "diagnosis.json", "extended.json", "extended.fmu", "nominal.json"}

Called = list[tuple[Any, ...]]


@pytest.fixture
def answering(monkeypatch: pytest.MonkeyPatch) -> Callable[[Diagnosis], Called]:
    """Puts a diagnosis in the place of the computation; gives what it was asked."""

    def put(found: Diagnosis) -> Called:
        asked: Called = []

        def answer(finger: Path, recordings: Sequence[Path], tests: Sequence[Path], **options: Any) -> Diagnosis:
            options["progress"](PhaseState(1, 2, "fitting", 1, 2, 0.0, None))
            asked.append((finger.name, [each.name for each in recordings], [each.name for each in tests], options))
            return found

        monkeypatch.setattr("tendonfmu.diagnosis.diagnose", answer)
        return asked

    return put


def brief(found: Diagnosis) -> Diagnosis:
    """Without what takes long to draw."""
    return replace(found, views=found.views[:1])


def files_in(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def test_it_writes_everything(call: Call, answering: Callable[[Diagnosis], Called]) -> None:
    found = examples.three_causes()
    asked = answering(found)
    words = "diagnose f.json a.csv b.csv --test c.csv d.csv -o new/out --seed 3 --kinematics 3 --jobs 2"
    answer = call(*words.split(), "--least-gain", "0.1")
    assert answer.status == 0
    finger, recordings, tests, options = asked[0]
    assert (finger, recordings, tests) == ("f.json", ["a.csv", "b.csv"], ["c.csv", "d.csv"])
    assert (options["seed"], options["kinematics"], options["jobs"], options["least_gain"]) == (3, 3, 2, 0.1)
    report = json.loads(Path("new/out/diagnosis.json").read_text(encoding="utf-8"))
    jsonschema.validate(report, json.loads((files_of("tendonfmu") / "schema" / "diagnosis.schema.json").read_text()))
    assert set(report["files"]) == files_in(Path("new/out")) == NAMED
    assert files_in(Path("new")) == {"out"}  # nothing is left beside it
    assert [line for line in answer.err.splitlines() if line.startswith("tendonfmu: warning: ")] == [
        f"tendonfmu: warning: {sentence}" for sentence in found.warnings
    ]
    assert "new/out/diagnosis.html" in answer.err
    assert json.loads(Path("new/out/extended.json").read_text()) == found.extended_data
    for name in ("extended.json", "nominal.json"):
        assert call("check", f"new/out/{name}").status == 0


def test_an_earlier_diagnosis_is_replaced_and_nothing_else(
    call: Call, answering: Callable[[Diagnosis], Called]
) -> None:
    answering(brief(examples.three_causes()))
    assert call("diagnose", "f.json", "a.csv", "-o", "out").status == 0
    Path("out/notes.png").write_text("mine")
    answering(brief(examples.adequate()))
    answer = call("diagnose", "f.json", "a.csv", "-o", "out", "--json")
    report = json.loads(Path("out/diagnosis.json").read_text(encoding="utf-8"))
    assert answer.status == 0 and json.loads(answer.out) == report
    assert report["verdict"] == "adequate" and report["causes"] == []
    assert files_in(Path("out")) == {*report["files"], "notes.png"} == {*NAMED, "notes.png"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("f.json", "a.csv", "-o", "f.json"), "f.json: a file; expected a folder"),
        (("out/extended.json", "a.csv", "-o", "out"), "out/extended.json: the same file as the input"),
        (("f.json", "a.csv", "--test", "a.csv", "-o", "new"), "a.csv: a test, but trained on as well; expected"),
        (("f.json", "a.csv", "--test", "link.csv", "-o", "new"), "link.csv: a test, but trained on as well"),
        (("f.json", "a.csv", "--test", "copy.csv", "-o", "new"), "copy.csv: a test, but trained on as well, as a.csv"),
        (("f.json", "a.csv", "copy.csv", "-o", "new"), "copy.csv: given twice, as a.csv"),
        (("f.json", "a.csv", "-o", "new", "--least-gain", "0.6"), "--least-gain"),
        (("f.json", "a.csv", "-o", "new", "--kinematics", "4"), "--kinematics"),
        (("f.json", "a.csv", "-o", "new", "--jobs", "0"), "--jobs"),
    ],
)
def test_bad_usage_is_one_line(call: Call, tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    (tmp_path / "out").mkdir()
    for name in ("f.json", "a.csv", "out/extended.json"):
        (tmp_path / name).write_text("{}")
    (tmp_path / "a.csv").write_text("time,tendon_force[1]\n")
    (tmp_path / "copy.csv").write_text("time,tendon_force[1]\n")
    (tmp_path / "link.csv").symlink_to(tmp_path / "a.csv")
    (tmp_path / "finger.json").write_text(json.dumps(examples.adequate().nominal_data))
    answer = call("diagnose", *arguments)
    assert answer.status == 2 and words in answer.err and answer.err.count("\n") == 1 and answer.out == ""
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ("f a --test b c -o d", "f a --test b --test c -o d"),
        ("f a --test=b c --seed 1 e", "f a --test=b --test c --seed 1 e"),
        ("--test b f a", "--test b f a"),
        ("f --test b a", "f --test b a"),
        ("-o d f a --test b -- c", "-o d f a --test b -- c"),
        ("f a --test b --test c d", "f a --test b --test c --test d"),
        ("f a --test", "f a --test"),
        ("f a --test b c --pushes d e -o o", "f a --test b --test c --pushes d --pushes e -o o"),
    ],
)
def test_several_tests_after_the_recordings(given: str, read: str) -> None:
    assert several_values(given.split(), {"--test", "--pushes", "-o", "--seed"}) == read.split()


def test_a_test_that_holds_what_is_trained_on_is_refused() -> None:
    """Whatever its file's name and format, and when it begins."""
    motion = np.random.default_rng(1).normal(size=(50, 2))
    groups = {"tendon_force": motion, "tendon_position": motion[:, ::-1]}
    monday = Recording(Path("monday.csv"), np.arange(50) / 100, groups)
    copy = Recording(Path("copy.parquet"), 7.0 + np.arange(50) / 100, {k: v.copy() for k, v in groups.items()})
    other = Recording(Path("other.csv"), monday.time, {**groups, "tendon_force": motion + 1e-3})
    check_unseen([monday], [other])
    with pytest.raises(InputError, match=r"copy\.parquet: a test, but trained on as well: the same samples as monday"):
        check_unseen([monday], [other, copy])


# --- the next experiment ----------------------------------------------------------------------------------------------


def test_a_motion_that_discriminates_takes_no_plan_of_its_own(call: Call, tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(examples.adequate().nominal_data))
    answer = call("excite", "finger.json", "--discriminate", "out", "-o", "m.csv", "--duration", "60")
    assert answer.status == 2 and "--duration" in answer.err
    answer = call("excite", "finger.json", "--discriminate", "out", "-o", "m.csv")
    assert answer.status == 2 and "diagnosis.json" in answer.err and answer.err.count("\n") == 1
    write_diagnosis(replace(brief(examples.adequate()), experiment=examples.NO_EXPERIMENT), tmp_path / "out")
    answer = call("excite", "finger.json", "--discriminate", "out", "-o", "m.csv")
    assert answer.status == 2 and "out" in answer.err and not Path("m.csv").exists()


def test_the_next_experiment_is_written(call: Call, tmp_path: Path) -> None:
    found = brief(examples.three_causes())
    (tmp_path / "finger.json").write_text(json.dumps(found.nominal_data))
    write_diagnosis(found, tmp_path / "out")
    told = json.loads(
        call("excite", "finger.json", "--discriminate", "out", "-o", "m.csv", "--rate", "50", "--json").out
    )
    answer = call("excite", "finger.json", "--discriminate", "out", "-o", "m.csv", "--rate", "50")
    assert answer.status == 0, answer.err
    assert told["format"] == "tendonfmu-discriminating-motion-1" and told["sentence"] in answer.out
    motion = read_table(tmp_path / "m.csv", lambda *_: None)
    assert motion["time"][1] == 0.02 and motion["time"][-1] >= 59.9
    assert motion["pretension"].max() == pytest.approx(25.0)
    assert np.ptp(motion["joint_position[1]"]) < 1e-9 and np.ptp(motion["joint_position[2]"]) > 0.5
    assert np.abs(motion["joint_velocity[2]"]).max() <= 0.4 * 1.001
    assert found.experiment.sentence in answer.out and "m.csv: 3" in answer.err
