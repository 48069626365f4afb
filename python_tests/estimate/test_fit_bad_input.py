"""Recordings that a fit should not take as they are: each gets a sentence, and a sound result or a refusal."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fit_cases import jam, small_finger
from fit_finger import made_recording
from tendonfmu.errors import InputError
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.recordings.prepared import slack_sentences
from tendonfmu.recordings.recording import Recording

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")

Change = Callable[[Recording], Recording | None]  # in place, or another recording


def fitted(recording: Recording | list[Recording], finger: dict[str, Any] | None = None, **options: Any) -> FrictionFit:
    settings = {"share": ["tendons"], "kinematics": 3, "passes": 8} | options
    return FrictionFit(finger or small_finger(), **settings).fit(recording)


def said(fit: FrictionFit, *words: str) -> bool:
    return any(all(word in sentence for word in words) for sentence in fit.warnings_)


def labelled(recording: Recording, contact: Any) -> Recording:
    return Recording(recording.path, recording.time, recording.groups, np.broadcast_to(contact, len(recording)))


def without_reference(recording: Recording) -> Recording:
    groups = {name: values for name, values in recording.groups.items() if name != "external_torque"}
    return Recording(recording.path, recording.time, groups, recording.contact)


def cut(recording: Recording, rows: slice) -> Recording:
    groups = {name: values[rows] for name, values in recording.groups.items()}
    return Recording(recording.path, recording.time[rows], groups, None)


def later(recording: Recording, *jumps: tuple[int, float]) -> None:
    """Set the clock forward from some rows on. jumps: row and s."""
    for row, seconds in jumps:
        recording.time[row:] += seconds


def scaled(group: str, factor: float) -> Change:
    def change(recording: Recording) -> None:
        recording.groups[group][:] *= factor

    return change


def set_to(group: str, element: int | slice, value: float) -> Change:
    def change(recording: Recording) -> None:
        recording.groups[group][:, element] = value

    return change


def no_motion(recording: Recording) -> None:
    for name in ("joint_position", "joint_velocity", "tendon_position"):
        recording.groups[name][:] = 0.0
    recording.groups["tendon_force"][:] = 10.0


def no_force_in_row_100(recording: Recording) -> None:
    recording.groups["tendon_force"][99] = 0.0


def bias(**settings: float) -> dict[str, Any]:
    finger = small_finger()
    finger["bias"] |= settings
    return finger


def without_friction() -> dict[str, Any]:
    finger = small_finger()
    finger["joints"] = [{"name": "base"}, {"name": "tip"}]
    for tendon in finger["tendons"]:
        del tendon["pulley_friction"], tendon["edge_friction"]
    return finger


def same(recording: Recording) -> None:
    pass


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (no_motion, {}, "no motion"),
        (no_motion, {"kinematics": 1}, "no motion"),
        # units and signs, with what to write into the map of columns
        (
            scaled("tendon_position", 1e3),
            {"kinematics": 1},
            'at each of "tendon_position[1]" to "tendon_position[4]": "unit": "mm"',
        ),
        (
            scaled("joint_position", 180 / np.pi),
            {"kinematics": 2},
            'at each of "joint_position[1]", "joint_position[2]": "unit": "deg"',
        ),
        (scaled("joint_velocity", -1.0), {}, 'at "joint_velocity[1]": "sign": -1'),
        (
            scaled("tendon_position", -1.0),
            {"kinematics": 1},
            'at each of "tendon_position[1]" to "tendon_position[4]": "sign": -1',
        ),
        (lambda recording: cut(recording, slice(0, 3)), {}, "3 samples"),
        (
            lambda recording: labelled(without_reference(recording), True),
            {},
            "labelled contact and there is no column external_torque",
        ),
        (set_to("tendon_position", 1, 0.0123), {"kinematics": 1}, "tendon_position[2] stands still at 0.0123 "),
        (same, {"finger": bias(noise_std=0.0)}, "bias.noise_std = 0"),
        (same, {"finger": bias(noise_std=0.0, noise_std_per_force=0.0)}, "bias.noise_std = 0"),
        (no_force_in_row_100, {"finger": bias(noise_std=0.0, noise_std_per_force=3e-4)}, "row 100"),
        (same, {"finger": without_friction(), "share": []}, "nothing to estimate"),
    ],
)
def test_what_is_refused(change: Change, options: dict[str, Any], words: str) -> None:
    recording = made_recording()
    with pytest.raises(InputError) as refused:
        fitted(change(recording) or recording, **options)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_a_good_recording_gets_no_warning() -> None:
    fit = fitted(made_recording(), passes=60)
    assert fit.warnings_ == [] and fit.converged_
    for kinematics in (1, 2):
        assert not said(fitted(made_recording(), kinematics=kinematics, passes=1), "map of columns")
    assert fitted(made_recording(), bias(noise_std=0.0, noise_std_per_force=3e-4)).finished_


def test_what_was_checked_is_neither_checked_nor_told_again() -> None:
    recording = made_recording()
    later(recording, (2200, 5.0))
    recording.groups["joint_position"][:] *= 180 / np.pi
    fit = FrictionFit(small_finger(), share=["tendons"], kinematics=1, passes=1).fit(recording, checked=True)
    assert not said(fit, "gap") and not said(fit, "map of columns")


# --- what a part of the finger does not show --------------------------------------------------------------------------


def test_a_joint_that_never_moves_is_named_and_its_numbers_stay() -> None:
    fit = fitted(made_recording(still=1))
    assert said(fit, "joint 2 (tip) never moves") and not said(fit, "stands still")
    of_tip = [entry for entry in fit.report_["parameters"] if entry["path"].startswith("joints[2].load_friction")]
    assert len(of_tip) == 4
    for entry in of_tip:
        assert entry["reason"] == "never_moves" and "move joint tip" in entry["advice"] and not entry["identified"]
        assert entry["value"] == pytest.approx(entry["start"], rel=1e-6)
    assert any(entry["identified"] for entry in fit.report_["parameters"])


def test_a_tendon_without_force_is_named_and_its_numbers_stay() -> None:
    recording = made_recording()
    # the reference takes over what the tendon did: all else is explained as before
    arm = np.array(small_finger()["tendons"][0]["moment_arms"])
    recording.groups["external_torque"] -= recording.groups["tendon_force"][:, :1] * arm
    recording.groups["tendon_force"][:, 0] = 0.0
    fit = fitted(recording, share=[])
    assert said(fit, "tendon_force[1] (tendon_1) is 0 throughout")
    first = [entry for entry in fit.report_["parameters"] if entry["path"].startswith("tendons[1]")]
    assert first
    for entry in first:
        assert entry["reason"] == "noise" and "tendon force" in entry["advice"]
        assert entry["value"] == pytest.approx(entry["start"], rel=1e-6)


def test_slack_tendons_are_named() -> None:
    finger = small_finger()
    jam(finger)
    fit = fitted(made_recording(), finger, only=["joints[*].cover"], share=[])
    assert said(fit, "tendon 1 (tendon_1) is slack", "expected a recording with more pretension")
    throughout = slack_sentences(np.ones((3, len(fit.description_.tendon_names)), dtype=bool), fit.description_)
    assert "is slack in 100 % of the samples" in throughout[0]


# --- samples that are left out ----------------------------------------------------------------------------------------


def test_labelled_contact_is_left_out_and_counted() -> None:
    recording = without_reference(made_recording())
    contact = np.zeros(len(recording), dtype=bool)
    contact[1000:1500] = True
    fit = fitted(labelled(recording, contact))
    assert said(fit, "500 samples labelled contact are left out")
    entry = fit.report_["recordings"][0]
    assert (entry["contact_left_out"], entry["used"]) == (500, len(recording) - 500)
    # what the forces were meanwhile has no say, wherever the model's memory does not hold it
    pushed = Recording(recording.path, recording.time, copy.deepcopy(recording.groups), contact)
    pushed.groups["tendon_force"][1000:1500] *= 1.5
    other = fitted(pushed)
    for path in fit.parameters_:
        if path.startswith("joints[") and "cover" in path:
            assert abs(other.parameters_[path] - fit.parameters_[path]) < fit.standard_errors_[path]


def test_contact_is_trained_on_where_the_load_is_known() -> None:
    fit = fitted(labelled(made_recording(), True))
    (entry,) = fit.report_["recordings"]
    assert entry["contact_left_out"] == 0 and entry["external_torque"]
    assert fit.parameters_ == fitted(made_recording()).parameters_


@pytest.mark.parametrize(("rate", "duration", "words"), [(10.0, 40.0, "poorly resolved"), (20000.0, 2.0, "decimating")])
def test_rates_that_are_too_low_or_high_are_said(rate: float, duration: float, words: str) -> None:
    fit = fitted(made_recording(rate=rate, duration=duration), passes=3)
    assert said(fit, f"{rate:.5g} samples per second", words)
    assert all(np.isfinite(list(fit.parameters_.values())))


@pytest.mark.parametrize("jump", [2.0, 3600.0])
def test_a_gap_or_a_jump_of_the_clock_cuts_a_recording_in_two(jump: float) -> None:
    whole = made_recording()
    two = fitted([cut(whole, slice(0, 2200)), cut(whole, slice(2200, None))])
    later(whole, (2200, jump))
    fit = fitted(whole)
    assert said(fit, "after row 2200 (10.995 s)", "a gap or a jump of the clock")
    assert fit.report_["recordings"][0]["parts"] == 2
    assert fit.report_["recordings"][0]["duration"] == pytest.approx(19.99, abs=0.02)
    assert fit.z_ == pytest.approx(two.z_, rel=1e-9)


def test_a_short_part_between_gaps_is_left_out() -> None:
    recording = made_recording()
    later(recording, (2200, 5.0), (2210, 5.0))
    fit = fitted(recording)
    assert said(fit, "10 samples in parts of fewer than 20")
    assert fit.report_["recordings"][0]["used"] == len(recording) - 10


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
    assert 700 <= fit.report_["recordings"][0]["faulty_left_out"] <= 700 + 220
    assert not fit.recordings_[0].train[3000:3700].any()


def test_a_stuck_sensor_that_is_not_used_costs_nothing() -> None:
    recording = made_recording()
    recording.groups["tendon_position"][:, 1] = 0.0123
    fit = fitted(recording)
    assert said(fit, "tendon_position[2] stands still", "not used with kinematics 3")
    assert fit.report_["recordings"][0]["used"] == len(recording)
