"""What is off between angles and tendons is a cause: encoders, zeros, moment arms, springs, and nothing else."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pandas as pd
import pytest

from command import Call
from encoder_finger import EncoderFinger, encoder_finger
from repetitions import repeated
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.inputs import read_input
from tendonfmu.diagnosis.kinematic_causes import KinematicCauses, find_kinematic_causes
from tendonfmu.diagnosis.result import Cause, Diagnosis, Experiment, Invisible
from tendonfmu.diagnosis.tendon_equation import Off, encoder_offsets
from tendonfmu.files import write_table
from tendonfmu.recordings import Learned

FINGER = encoder_finger(1)  # two joints, four tendons
SECONDS = 40.0


def found(now: EncoderFinger, then: EncoderFinger | None, number: int = 0, test: bool = True) -> KinematicCauses:
    recordings = [now.recording(10 * number + k, SECONDS) for k in (1, 2)]
    reference = None if then is None else [then.recording(10 * number + 3, SECONDS)]
    given = read_input(
        (then or FINGER).description, recordings[:1], recordings[1:] if test else [], reference, 1, 0.03, True
    )
    return find_kinematic_causes(given, 0.03, 0)


def columns_of(frame: pd.DataFrame) -> dict[str, Any]:
    return {str(column): frame[column].to_numpy() for column in frame}


def placed(causes: Sequence[Cause]) -> list[tuple[str, int | None, int | None]]:
    return [(cause.effect, cause.joint, cause.tendon) for cause in causes]


@pytest.mark.parametrize(
    ("what", "size", "effect", "joint", "tendon", "words"),
    [
        ("encoder", np.radians(3.0), "encoder_offset", 1, None, "it reads 3° more than"),
        ("encoder", -np.radians(1.0), "encoder_offset", 1, None, "° less than"),
        ("zero", 1.5e-4, "zero", None, 2, "+0.15\xa0mm"),
        ("arm", 0.035, "moment_arm", 1, 2, "+3.5\xa0%"),
        ("stiffness", 0.1, "tendon_nonlinearity", None, 2, "+10\xa0%"),
    ],
)
@pytest.mark.parametrize("with_reference", [False, True])
def test_each_is_named_alone(
    what: str, size: float, effect: str, joint: int | None, tendon: int | None, words: str, with_reference: bool
) -> None:
    (cause,) = found(FINGER.but(what, size, tendon=1, joint=0), FINGER if with_reference else None).causes
    assert placed([cause]) == [(effect, joint, tendon)]
    assert words in cause.size and cause.gain.low > 0.5 and cause.p_value < 1e-6 and cause.gain_unit == "m"
    assert (cause.title == "a tendon's stiffness is off") == (what == "stiffness")
    assert (cause.changed is not None) == with_reference
    if cause.changed is not None and what in ("encoder", "zero"):
        assert cause.changed.change.value == pytest.approx(size, rel=0.02)


@pytest.mark.parametrize("number", repeated([1, 2, 3], 0))
def test_nothing_is_named_where_nothing_is_off(number: int) -> None:
    """Springs that stiffen, and another load than the reference's, are no change."""
    finger = encoder_finger(number, hardening=0.004)
    loaded = EncoderFinger(**{**vars(finger), "pretension": 1.25 * finger.pretension})
    assert found(finger, finger, number, test=False).causes == ()
    assert found(loaded, finger, number).causes == ()


@pytest.mark.parametrize(("hardening", "share"), [(0.002, 1.0), (0.006, 1.0), (0.06, 0.8), (0.06, 0.7)])
def test_a_spring_that_stiffens_has_the_described_zero(hardening: float, share: float) -> None:
    """hardening: per N, h/k² of a spring whose force is k·e + h·e²; k is a share of the described stiffness."""
    frames = [FINGER.recording(seed, SECONDS) for seed in (1, 2)]
    for frame in frames:
        force, stiffness = frame["tendon_force[2]"], FINGER.stiffness[1]
        stretch = 2.0 * force / (share * stiffness) / (1.0 + np.sqrt(1.0 + 4.0 * hardening * force))
        frame["tendon_position[2]"] += stretch - force / stiffness
    given = read_input(FINGER.description, frames[:1], frames[1:], None, 1, 0.03, True)
    assert placed(find_kinematic_causes(given, 0.03, 0).causes) == [("tendon_nonlinearity", None, 2)]


@pytest.mark.parametrize("with_reference", [False, True])
def test_an_arm_that_is_a_little_off_is_no_cause_but_corrected(with_reference: bool) -> None:
    now = FINGER.but("arm", 0.012, tendon=1, joint=0)
    answer = found(now, FINGER if with_reference else None)
    assert answer.causes == () and placed(answer.too_small) == [("moment_arm", 1, 2)]
    arm, described = (
        data["tendons"][1]["moment_arms"][0] for data in (answer.edited(FINGER.description), FINGER.description)
    )
    assert arm / described == pytest.approx(1.0 if with_reference else 1.012, abs=0.002)


def test_a_coupling_and_several_places() -> None:
    now = FINGER.but("coupling", 5e-4, tendon=1, joint=1).but("zero", 2e-4, tendon=0).but("zero", -1e-4, tendon=3)
    causes = found(now, FINGER).causes
    assert sorted(placed(causes), key=str) == [("joint_coupling", 2, 2), ("zero", None, None)]
    assert "a tendon moves with a joint that it does not pass" in [cause.title for cause in causes]
    (zeros,) = (cause for cause in causes if cause.effect == "zero")
    assert [place.tendon for place in zeros.places] == [1, 4] and "at the largest of 2 places" in zeros.size


def test_a_short_recording_leaves_it_uncertain() -> None:
    now, then = FINGER.but("encoder", 0.05).recording(1, 20.0), FINGER.recording(2, 40.0)
    given = read_input(FINGER.description, [now], [], [then], 1, 0.03, True)
    answer = find_kinematic_causes(given, 0.03, 0)
    assert answer.causes == () and placed(answer.uncertain) == [("encoder_offset", 1, None)]


def test_the_fewest_offsets_and_zeros() -> None:
    arms = np.array([[0.01, 0.0], [-0.008, 0.0], [0.009, 0.007], [-0.007, -0.009]])
    known_to = np.full(4, 1e-5)
    slipped = encoder_offsets(-arms @ [0.05, 0.0], known_to, arms)
    assert slipped.joints.tolist() == [0] and not slipped.single.any()
    np.testing.assert_allclose(slipped.offset, [0.05], rtol=1e-9)
    alone = encoder_offsets(np.array([0.0, 0.0, 2e-4, 0.0]), known_to, arms)
    assert alone.joints.tolist() == [] and alone.single.tolist() == [False, False, True, False]
    both = encoder_offsets(-arms @ [0.0, -0.03] + [1e-3, 0.0, 0.0, 0.0], known_to, arms)
    assert both.joints.tolist() == [1] and both.single.tolist() == [True, False, False, False]


def _learned(is_known: bool) -> Learned:
    return Learned("tendons[1].moment_arms[1]", 0.01, 1e-5, 0.01, is_known, 1e-4, 0.5)


def test_what_is_named_here_is_not_too_small_there() -> None:
    """The search of the torque looks for some of the same effects."""
    zero, other = Cause(Where("zero", None, 1)), Cause(Where("viscous_change", 1, None))
    fields = dict.fromkeys((each.name for each in dataclasses.fields(Diagnosis)), ())
    tried = Diagnosis(
        **{**fields, "verdict": "adequate", "tested": 3, "too_small": (zero, other), "uncertain": (zero,)}
    )
    arms = [Where("moment_arm", 1, tendon) for tendon in (1, 2, 3)]
    known = {where: Off(where, _learned(where.tendon != 2), 1e-4) for where in arms[:2]}
    hidden = tuple(Invisible(where, "", 0.0, "") for where in arms)
    both = KinematicCauses(is_change=False, known=known, causes=(zero,)).in_diagnosis(
        dataclasses.replace(tried, experiment=Experiment("Record more."), extended_data={}, invisible=hidden)
    )
    assert (both.causes, both.too_small, both.uncertain) == ((zero,), (other,), ())
    assert [each.where.tendon for each in both.invisible] == [2, 3], "positions show the first arm, whatever the torque"


def test_too_many_columns_are_refused(tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lack of memory is no fault of the package."""
    monkeypatch.setattr("tendonfmu.diagnosis.candidate_columns._MOST_MEMORY", 1e-9)
    write_table(tmp_path / "rec.parquet", columns_of(FINGER.recording(1, 20.0)))
    (tmp_path / "finger.json").write_text(json.dumps(FINGER.description), encoding="utf-8")
    said = call("diagnose", tmp_path / "finger.json", tmp_path / "rec.parquet", "-o", tmp_path / "out")
    assert said.status == 2 and "columns of candidate causes need" in said.err and said.err.count("\n") == 1


def test_the_command_says_what_slipped(tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """The verdict, the files and the page agree, and no warning says the same again."""
    monkeypatch.chdir(tmp_path)
    finger = encoder_finger(1)
    now = finger.but("encoder", np.radians(3.0), joint=1).but("zero", 3e-4, tendon=0)
    for name, each, seed in (("then", finger, 3), ("now", now, 1)):
        frame = each.recording(seed, SECONDS)
        write_table(Path(f"{name}.parquet"), columns_of(frame))
    Path("finger.json").write_text(json.dumps(finger.description), encoding="utf-8")
    said = call("diagnose", "finger.json", "now.parquet", "--reference", "then.parquet", "-o", "out")
    assert said.status == 0, said.err
    assert "encoder_offset" in said.out and "° more than before" in said.out
    report = json.loads(Path("out/diagnosis.json").read_text(encoding="utf-8"))
    schema = json.loads((files("tendonfmu") / "schema" / "diagnosis.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(report, schema)
    assert report["verdict"] == "explained" and report["warnings"] == []
    causes = {cause["effect"]: cause for cause in report["causes"]}
    assert set(causes) == {"encoder_offset", "zero"}
    gains = [cause["gain"]["value"] for cause in report["causes"]]
    assert gains == sorted(gains, reverse=True) and report["gain"]["value"] == 0.0
    encoder = causes["encoder_offset"]
    assert encoder["now"] == pytest.approx(np.radians(3.0), rel=0.02) and encoder["unit"] == "rad"
    assert {"effect": "zero", "joint": None, "tendon": 3} in encoder["confusable_with"]
    extended = json.loads(Path("out/extended.json").read_text(encoding="utf-8"))
    zeros = [np.array([part.get("zero") or 0.0 for part in each["tendons"]]) for each in (extended, finger.description)]
    np.testing.assert_allclose(zeros[0] - zeros[1], [3e-4, 0.0, 0.0, 0.0], atol=5e-6)
