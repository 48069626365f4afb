"""Recordings that a fit should not take as they are: each gets a sentence, and a sound result or a refusal."""

from __future__ import annotations

import copy
import re
import warnings
from typing import Any

import numpy as np
import pytest

from fit_cases import jam, small_finger
from fit_finger import made_recording
from tendonfmu.errors import InputError
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.recordings.prepared import slack_sentences
from tendonfmu.recordings.recording import Recording


def fitted(recording: Recording | list[Recording], finger: dict[str, Any] | None = None, **options: Any) -> FrictionFit:
    settings = {"share": ["tendons"], "kinematics": 3, "max_passes": 8} | options
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        return FrictionFit(finger or small_finger(), **settings).fit(recording)


def refusal(*arguments: Any, **options: Any) -> str:
    with pytest.raises(InputError) as refused:
        fitted(*arguments, **options)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def said(fit: FrictionFit, *words: str) -> bool:
    return any(all(word in sentence for word in words) for sentence in fit.warnings_)


def without_reference(recording: Recording) -> Recording:
    """External torque taken out of the forces' column: the rest is a recording without a reference sensor."""
    groups = {name: values for name, values in recording.groups.items() if name != "external_torque"}
    return Recording(recording.path, recording.time, groups, recording.contact)


def test_a_good_recording_gets_no_warning() -> None:
    fit = fitted(made_recording(), max_passes=60)
    assert fit.warnings_ == []
    assert fit.converged_


# --- motion -----------------------------------------------------------------------------------------------------------


def test_no_motion_is_refused() -> None:
    recording = made_recording()
    for name in ("joint_position", "joint_velocity", "tendon_position"):
        recording.groups[name][:] = 0.0
    recording.groups["tendon_force"][:] = 10.0
    assert "no motion" in refusal(recording)
    assert "no motion" in refusal(recording, kinematics=1)


def test_a_joint_that_never_moves_is_named_and_its_numbers_stay() -> None:
    fit = fitted(made_recording(still=1))
    assert said(fit, "joint 2 (tip) never moves")
    of_tip = [p for p in fit.report_["parameters"] if p["path"].startswith("joints[2].load_friction")]
    assert len(of_tip) == 4
    for parameter in of_tip:
        assert parameter["reason"] == "never_moves"
        assert "move joint tip" in parameter["advice"]
        assert parameter["value"] == pytest.approx(parameter["start"], rel=1e-6)
        assert not parameter["identified"]
    assert any(p["identified"] for p in fit.report_["parameters"])


def test_a_tendon_without_force_is_named_and_its_numbers_stay() -> None:
    recording = made_recording()
    # the reference takes over what the tendon did: all else is explained as before
    arm = np.array(small_finger()["tendons"][0]["moment_arms"])
    recording.groups["external_torque"] -= recording.groups["tendon_force"][:, :1] * arm
    recording.groups["tendon_force"][:, 0] = 0.0
    fit = fitted(recording, share=[])
    assert said(fit, "tendon_force[1] (tendon_1) is 0 throughout")
    first = [p for p in fit.report_["parameters"] if p["path"].startswith("tendons[1]")]
    assert first
    for parameter in first:
        assert parameter["value"] == pytest.approx(parameter["start"], rel=1e-6)
        assert parameter["reason"] == "noise"
        assert "tendon force" in parameter["advice"]


def test_slack_tendons_are_named() -> None:
    finger = small_finger()
    jam(finger)
    fit = fitted(made_recording(), finger, only=["joints[*].cover"], share=[])
    assert said(fit, "tendon 1 (tendon_1) is slack", "expected a recording with more pretension")
    throughout = slack_sentences(np.ones((3, len(fit.description_.tendon_names)), dtype=bool), fit.description_)
    assert "is slack in 100 % of the samples" in throughout[0]


# --- units and signs --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kinematics", "group", "factor", "words"),
    [
        (1, "tendon_position", 1e3, 'at each of "tendon_position[1]" to "tendon_position[4]": "unit": "mm"'),
        (2, "joint_position", 180 / np.pi, 'at each of "joint_position[1]", "joint_position[2]": "unit": "deg"'),
        (3, "joint_velocity", -1.0, 'at "joint_velocity[1]": "sign": -1'),
        (1, "tendon_position", -1.0, 'at each of "tendon_position[1]" to "tendon_position[4]": "sign": -1'),
    ],
)
def test_what_does_not_belong_is_refused(kinematics: int, group: str, factor: float, words: str) -> None:
    """Units and signs, with what to write into the map of columns."""
    recording = made_recording()
    assert not said(fitted(recording, kinematics=kinematics, max_passes=1), "map of columns")
    recording.groups[group][:] *= factor
    assert words in refusal(recording, kinematics=kinematics)


def test_what_was_checked_is_neither_checked_nor_told_again() -> None:
    recording = made_recording()
    recording.time[2200:] += 5.0
    recording.groups["joint_position"][:] *= 180 / np.pi
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(small_finger(), share=["tendons"], kinematics=1, max_passes=1).fit(recording, checked=True)
    assert not said(fit, "gap") and not said(fit, "map of columns")


# --- samples ----------------------------------------------------------------------------------------------------------


def cut(recording: Recording, rows: Any) -> Recording:
    groups = {name: values[rows] for name, values in recording.groups.items()}
    contact = None if recording.contact is None else recording.contact[rows]
    return Recording(recording.path, recording.time[rows], groups, contact)


def test_three_samples_are_refused() -> None:
    assert re.search(r"3 samples.*at least 20", refusal(cut(made_recording(), slice(0, 3))))


def test_labelled_contact_is_left_out_and_counted() -> None:
    recording = without_reference(made_recording())
    contact = np.zeros(len(recording), dtype=bool)
    contact[1000:1500] = True
    labelled = Recording(recording.path, recording.time, recording.groups, contact)
    fit = fitted(labelled)
    assert said(fit, "500 samples labelled contact are left out")
    entry = fit.report_["recordings"][0]
    assert (entry["contact_left_out"], entry["used"]) == (500, len(recording) - 500)
    # what the forces were meanwhile has no say, wherever the model's memory does not hold it
    pushed = copy.deepcopy(recording.groups)
    pushed["tendon_force"][1000:1500] *= 1.5
    other = fitted(Recording(recording.path, recording.time, pushed, contact))
    slow = [p for p in fit.parameters_ if p.startswith("joints[") and "cover" in p]
    for path in slow:
        assert abs(other.parameters_[path] - fit.parameters_[path]) < fit.standard_errors_[path]


def test_contact_is_trained_on_where_the_load_is_known() -> None:
    recording = made_recording()
    labelled = Recording(recording.path, recording.time, recording.groups, np.ones(len(recording), dtype=bool))
    fit = fitted(labelled)
    assert fit.report_["recordings"][0]["contact_left_out"] == 0
    assert fit.report_["recordings"][0]["external_torque"]
    assert fit.parameters_ == fitted(recording).parameters_


def test_nothing_but_contact_is_refused() -> None:
    recording = without_reference(made_recording())
    labelled = Recording(recording.path, recording.time, recording.groups, np.ones(len(recording), dtype=bool))
    assert "labelled contact and there is no column external_torque" in refusal(labelled)


@pytest.mark.parametrize(("rate", "duration", "words"), [(10.0, 40.0, "poorly resolved"), (20000.0, 2.0, "decimating")])
def test_rates_that_are_too_low_or_high_are_said(rate: float, duration: float, words: str) -> None:
    fit = fitted(made_recording(rate=rate, duration=duration), max_passes=3)
    assert said(fit, f"{rate:.5g} samples per second", words)
    assert all(np.isfinite(list(fit.parameters_.values())))


@pytest.mark.parametrize("jump", [2.0, 3600.0])
def test_a_gap_or_a_jump_of_the_clock_cuts_a_recording_in_two(jump: float) -> None:
    whole = made_recording()
    first, second = cut(whole, slice(0, 2200)), cut(whole, slice(2200, None))
    whole.time[2200:] += jump
    fit = fitted(whole)
    assert said(fit, "after row 2200 (10.995 s)", "a gap or a jump of the clock")
    assert fit.report_["recordings"][0]["parts"] == 2
    assert fit.report_["recordings"][0]["duration"] == pytest.approx(19.99, abs=0.02)
    two = fitted([first, second])
    assert fit.z_ == pytest.approx(two.z_, rel=1e-9)


def test_a_short_part_between_gaps_is_left_out() -> None:
    recording = made_recording()
    recording.time[2200:] += 5.0
    recording.time[2210:] += 5.0
    fit = fitted(recording)
    assert said(fit, "10 samples in parts of fewer than 20")
    assert fit.report_["recordings"][0]["used"] == len(recording) - 10


# --- sensors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("group", "element", "kinematics"),
    [("tendon_position", 1, 1), ("tendon_force", 2, 3), ("joint_position", 0, 3), ("joint_velocity", 1, 3)],
)
def test_a_sensor_that_is_stuck_for_a_while_is_left_out(group: str, element: int, kinematics: int) -> None:
    recording = made_recording(seed=2, duration=40.0)
    values = recording.groups[group]
    values[3000:3700, element] = values[3000, element]
    fit = fitted(recording, kinematics=kinematics)
    assert said(fit, f"{group}[{element + 1}] stands still", "a stuck sensor", "are left out")
    left_out = fit.report_["recordings"][0]["faulty_left_out"]
    assert 700 <= left_out <= 700 + 220
    assert not fit.recordings_[0].train[3000:3700].any()


def test_a_sensor_that_is_stuck_throughout_is_refused() -> None:
    recording = made_recording()
    recording.groups["tendon_position"][:, 1] = 0.0123
    assert re.search(
        r"tendon_position\[2\] stands still at 0.0123 .*expected a working one", refusal(recording, kinematics=1)
    )


def test_a_stuck_sensor_that_is_not_used_costs_nothing() -> None:
    recording = made_recording()
    recording.groups["tendon_position"][:, 1] = 0.0123
    fit = fitted(recording)
    assert said(fit, "tendon_position[2] stands still", "not used with kinematics 3")
    assert fit.report_["recordings"][0]["used"] == len(recording)


def test_a_rest_is_no_stuck_sensor() -> None:
    recording = made_recording(still=1)
    assert not said(fitted(recording), "stands still")


# --- what does not fit ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("per_force", [None, 0.0])
def test_settings_without_noise_are_refused_by_name(per_force: float | None) -> None:
    finger = small_finger()
    finger["bias"]["noise_std"] = 0.0
    if per_force is not None:
        finger["bias"]["noise_std_per_force"] = per_force
    assert "bias.noise_std = 0" in refusal(made_recording(), finger)


def test_noise_per_force_alone_needs_force_in_every_sample() -> None:
    finger = small_finger()
    finger["bias"] |= {"noise_std": 0.0, "noise_std_per_force": 3e-4}
    recording = made_recording()
    assert fitted(recording, finger).finished_
    recording.groups["tendon_force"][99] = 0.0
    assert "row 100" in refusal(recording, finger)


def test_a_finger_without_friction_is_refused() -> None:
    finger = small_finger()
    finger["joints"] = [{"name": "base"}, {"name": "tip"}]
    for tendon in finger["tendons"]:
        del tendon["pulley_friction"], tendon["edge_friction"]
    assert "nothing to estimate" in refusal(made_recording(), finger, share=[])
