"""The next experiment: what the menu's choice promises is what rivals really leave of a recording of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tendonfmu.diagnosis.effects import MECHANISMS, Place, Term
from tendonfmu.diagnosis.extension_fit import FitSettings, extended_description, fit_numbers
from tendonfmu.diagnosis.menu import (
    WIDER,
    Entry,
    Recorded,
    Section,
    combined,
    entry_from_json,
    loads,
    motions,
    tensions,
)
from tendonfmu.diagnosis.motion import discriminating_motion, expected_recording, perform
from tendonfmu.diagnosis.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.diagnosis.samples import Samples, exact_model
from tendonfmu.errors import InputError
from tendonfmu.excite.excitation import pretension_vector
from tendonfmu.files.json_node import Node
from tendonfmu.files.tables import write_table
from tendonfmu.model.friction_places import moment_arms
from tendonfmu.recordings.prepared import FitRecording
from tendonfmu.simulate.motion_plan import Joints, expand_motion

NOISE = 0.001  # N·m
LAW = {"static": 0.03, "coulomb": 0.03, "stribeck_velocity": 0.01}
FINGER: dict[str, Any] = {
    "format": "tendonfmu-finger-1",
    "name": "plain",
    "joints": [
        {"name": "base", "friction": {"static": 0.006, "coulomb": 0.006, "stribeck_velocity": 0.1}},
        {"name": "tip"},
    ],
    "tendons": [
        {"name": f"tendon_{k}", "stiffness": 4000.0, "moment_arms": arms, "edge_friction": [LAW, None]}
        for k, arms in enumerate([[0.009, 0.006], [0.009, -0.006], [-0.008, 0.005], [-0.008, -0.005]])
    ],
    "bias": {"drift_variance": 0.0, "noise_std": NOISE},
    "contact": {"threshold": [1.0, 1.0]},
}
RANGES = ((-0.4, 0.4), (-0.5, 0.5))
RATE = 100.0


def usual(seconds: float = 30.0, pretension: float = 10.0) -> Entry:
    return Entry("recorded", (Section(RANGES, 1.0, seconds, pretension),))


def recording_of(data: dict[str, Any], entry: Entry, seed: int = 0, noise: float = NOISE) -> FitRecording:
    """What a finger that is exactly `data` records of an entry, with white noise on the torque."""
    found = expected_recording(data, perform(data, entry, RATE), 3)
    torque = exact_model(data, found)
    target = torque + noise * np.random.default_rng(seed).standard_normal(torque.shape)
    load = found.recording.groups["tendon_force"] @ moment_arms(data) - target
    groups = {**found.recording.groups, "external_torque": load}
    return replace(found, target=target, recording=replace(found.recording, groups=groups))


def accepted(name: str, place: Place, magnitudes: tuple[float, ...] = ()) -> Term:
    return Term(next(each for each in MECHANISMS if each.name == name), place, {}, magnitudes)


JOINT, LOAD = accepted("joint_friction", Place(2), (0.004, 0.0)), accepted("joint_load_friction", Place(2), (1e-4, 0.0))
GAIN = accepted("force_gain", Place(tendon=1))


@pytest.fixture(scope="module")
def planned() -> Experiments:
    """After one recording at one pretension: friction in joint 2, or friction that its load makes? And a gain?"""
    old = recording_of(FINGER, usual())
    return plan_experiments(FINGER, [old], [Question(JOINT, LOAD), Question(GAIN)], noise=[NOISE, NOISE])


def test_load_and_plain_friction_are_told_by_the_pretension(planned: Experiments) -> None:
    """At one pretension friction that grows with the load is constant, as plain friction is."""
    answer = planned.answers[0]
    assert answer.separates and answer.entry.tension != ""
    assert len({section.pretension for section in answer.entry.sections}) > 1 or answer.entry.sections[0].vary
    assert answer.distance > 3 * answer.now and answer.distance > 0.33
    assert planned.best.separates and planned.best.separates[0][0].effect == "joint_friction"
    assert planned.sentence(0) == answer.entry.sentence and answer.entry.tension in planned.sentence(0)
    assert all(name in planned.best.sentence for name in (JOINT.mechanism.title, LOAD.mechanism.title, "joint 2 (tip)"))
    gain = planned.answers[1]
    assert gain.separates and (gain.entry.tension or gain.entry.load) and gain.distance > 2 * gain.now


def test_the_rival_leaves_as_much_as_promised(planned: Experiments) -> None:
    """A finger with the one cause, fitted with the other: the likelihood pays for what the plan says, in the recording
    that there is and the new one together; the same motion again tells nothing.
    """
    truth = dict(extended_description(FINGER, [JOINT]))
    rival = extended_description(FINGER, [LOAD])
    old = recording_of(truth, usual(), seed=1)
    left = []
    for entry in (usual(40.0), planned.answers[0].entry):
        new = recording_of(truth, entry, seed=2)
        samples = Samples.of(truth, [old, new])
        fitted = [fit_numbers(data, samples, FitSettings(threads=1)).data for data in (truth, rival)]
        squares = [float(np.sum(samples.residual(data) ** 2)) for data in fitted]
        left.append(np.sqrt(max(squares[1] - squares[0], 0.0) / len(new.time)))
    assert left[0] < 0.2 * left[1]


# --- the menu ---------------------------------------------------------------------------------------------------------


def all_entries() -> list[Entry]:
    recorded = Recorded(np.array(RANGES), 1.0, 10.0, np.full(4, 25.0), np.array([0.02, 0.02]), 30.0)
    plain = list(motions(recorded))
    varied = [
        each for first in plain[:2] for each in (*tensions(FINGER, first, recorded), *loads(FINGER, first, recorded))
    ]
    return [*plain[:-1], *varied, *combined(FINGER, plain[3], recorded)]


@pytest.mark.parametrize("entry", all_entries(), ids=lambda entry: entry.words[:60])
def test_a_motion_stays_where_it_was_recorded(entry: Entry) -> None:
    """Within its ranges, taut, as fast as it says, at rest at both ends; the same after a report."""
    again = entry_from_json(json.loads(json.dumps(entry.as_json())), 2)
    assert again == entry
    rate = 50.0
    found = perform(FINGER, entry, rate)
    for j in range(2):
        ends = [section.ranges[j] for section in entry.sections]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        assert low - 1e-9 <= found.joint_position[:, j].min() and found.joint_position[:, j].max() <= high + 1e-9
        wider = WIDER if "times the range" in entry.motion else 1.0
        assert wider * RANGES[j][0] - 1e-9 <= low and high <= wider * RANGES[j][1] + 1e-9
    lowest = min(section.pretension if section.vary is None else section.vary.lowest for section in entry.sections)
    assert found.tension.min() >= lowest * min(pretension_vector(FINGER)) * (1 - 1e-9)
    fastest = max(section.max_speed for section in entry.sections)
    assert np.abs(found.joint_velocity).max() <= fastest * (1 + 1e-9)
    middle = (found.joint_position[2:] - found.joint_position[:-2]) * rate / 2
    assert np.abs(middle - found.joint_velocity[1:-1]).max() < 0.05 * fastest
    assert not found.joint_velocity[[0, -1]].any() and not found.joint_acceleration[[0, -1]].any()
    np.testing.assert_allclose(np.diff(found.time), 1 / rate)
    # the tensions hold themselves, and every tendon stays taut under them, its friction and the known load
    np.testing.assert_allclose(found.tension @ moment_arms(FINGER), 0.0, atol=1e-9)
    expected = expected_recording(FINGER, found, 3)
    assert expected.recording.groups["tendon_force"].min() > 0
    assert bool(entry.load) == bool(found.load.any())


@pytest.mark.parametrize(("largest", "highest"), [(100.0, 20.0), (15.0, None), (5.0, 10.0)])
def test_no_tendon_is_pulled_more_than_it_was(largest: float, highest: float | None) -> None:
    """Twice the recorded pretension of 10 N, or what its tightest tendon has borne; at least the recorded one."""
    recorded = Recorded(np.array(RANGES), 1.0, 10.0, np.full(4, largest), np.array([0.02, 0.02]), 30.0)
    first, varied = tensions(FINGER, next(motions(recorded)), recorded)
    most = highest or largest / float(pretension_vector(FINGER).max())
    assert [section.pretension for section in first.sections] == pytest.approx([most / 4, most / 2, most])
    assert [section.vary and section.vary.highest for section in varied.sections] == [pytest.approx(most)]


def test_a_menu_has_what_a_finger_can_do() -> None:
    """One joint with a cable loop holds no pretension: known loads only."""
    loop = {
        "joints": [{"friction": LAW}],
        "tendons": [{"stiffness": 1e5, "moment_arms": [0.005], "bidirectional": True}],
    }
    recorded = Recorded(np.array([[-1.0, 1.0]]), 2.0, 3.0, np.array([9.0]), np.array([0.02]), 30.0)
    entry = next(motions(recorded))
    assert list(tensions(loop, entry, recorded)) == []
    (loaded,) = loads(loop, entry, recorded)
    assert [section.load for section in loaded.sections] == [pytest.approx((sign * 0.06,)) for sign in (1, -1, 1, -1)]
    assert combined(loop, entry, recorded) == []


# --- the motion for the robot -----------------------------------------------------------------------------------------


def report(folder: Path, planned: Experiments) -> Path:
    folder.mkdir(exist_ok=True)
    experiment = {"sentence": planned.best.sentence, "motion": planned.best.motion}
    found = {"format": "tendonfmu-diagnosis-1", "next_experiment": planned.best.sentence, "experiment": experiment}
    (folder / "diagnosis.json").write_text(json.dumps(found), encoding="utf-8")
    return folder


def test_the_motion_can_be_run(planned: Experiments, tmp_path: Path) -> None:
    """It is a motion file of a rig, and has the pretensions that the plan asks for."""
    found = discriminating_motion(report(tmp_path, planned), FINGER, limits=[(-0.6, 0.6), (-0.6, 0.6)])
    file = tmp_path / "motion.csv"
    write_table(file, found.columns())
    motion = expand_motion(
        Node({"kind": "file", "file": str(file)}, "motion"), Joints([-0.6, -0.6], [0.6, 0.6]), 0, None
    )
    levels = np.array(motion.pretension["value"])
    for section in found.entry.sections:
        assert section.vary is not None or np.isclose(levels, section.pretension).any()
    assert found.sentence == planned.best.sentence
    assert any(found.entry.words in line for line in found.lines())


def test_a_wrong_folder_is_refused(planned: Experiments, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing"):
        discriminating_motion(tmp_path / "nothing", FINGER)
    folder = report(tmp_path, planned)
    with pytest.raises(InputError, match=r"joint 1 .* -0.1 to 0.1 rad"):
        discriminating_motion(folder, FINGER, limits=[(-0.1, 0.1), (-0.6, 0.6)])
    one = {"joints": [{}], "tendons": [{"stiffness": 1e4, "moment_arms": [0.01]}]}
    with pytest.raises(InputError, match=r"experiment.motion.sections\[1\]"):
        discriminating_motion(folder, one)
    (folder / "diagnosis.json").write_text('{"format": "tendonfmu-fit-1"}', encoding="utf-8")
    with pytest.raises(InputError, match='"tendonfmu-fit-1"'):
        discriminating_motion(folder, FINGER)
    (folder / "diagnosis.json").write_text('{"format": "tendonfmu-diagnosis-1", "experiment": {}}', encoding="utf-8")
    with pytest.raises(InputError, match="experiment"):
        discriminating_motion(folder, FINGER)
