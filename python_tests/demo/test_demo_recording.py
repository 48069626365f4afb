"""The demo's recordings: what their rig gives, and what both descriptions of the finger make of them."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.detect.counting import DetectionScore, score_detection
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import Recording, read_recording
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import simulate

EXAMPLES = ROOT / "examples"
FOLDER = EXAMPLES / "demo_recording"
FINGERS = {
    "given": EXAMPLES / "fingers" / "index_finger.json",
    "calibrated": FOLDER / "index_finger_calibrated.json",
}
NAMES = ("index_finger_free", "index_finger_free_x4", "index_finger_pushes")
STEPS = {"tendon_force": 0.002, "tendon_position": 2e-6, "joint_position": 2e-4, "external_torque": 2e-4}  # of sensors

Array = NDArray[Any]
Outputs = dict[str, Array]


@pytest.fixture(scope="module")
def recordings() -> dict[str, Recording]:
    return {name: read_recording(FOLDER / f"{name}.parquet") for name in NAMES}


@pytest.fixture(scope="module")
def outputs(recordings: dict[str, Recording]) -> dict[tuple[str, str], Outputs]:
    """By description and recording."""
    return {
        (which, name): Instance.from_description(json.loads(path.read_text(encoding="utf-8"))).run(recording.arrays())
        for which, path in FINGERS.items()
        for name, recording in recordings.items()
    }


def score(recording: Recording, contact: Array) -> DetectionScore:
    label = np.zeros(len(recording), bool) if recording.contact is None else recording.contact
    return score_detection(recording.time, label, contact)


def rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


@needs_plant
@pytest.mark.long
def test_a_recording_is_what_its_rig_gives(recordings: dict[str, Recording]) -> None:
    """Up to the last digits that another compiler makes: steps of the sensors, by how many samples and on average."""
    recording = recordings["index_finger_pushes"]
    fresh = simulate(read_rig(EXAMPLES / "rigs" / "index_finger_pushes.json")).recording
    np.testing.assert_array_equal(fresh["time"], recording.time)
    for group, array in recording.groups.items():
        now = np.column_stack([fresh[f"{group}[{k + 1}]"] for k in range(array.shape[1])])
        steps = np.abs(now - array) / STEPS[group]
        assert np.mean(steps > 1.5) < 0.001 and rms(steps.ravel()) < 0.2, group
    assert recording.contact is not None and (fresh["contact"].astype(bool) != recording.contact).sum() <= 22


def test_a_third_of_the_friction_is_left_and_nothing_is_felt(
    recordings: dict[str, Recording], outputs: dict[tuple[str, str], Outputs]
) -> None:
    """A third at the pretension of the training, half at four times that."""
    for name, most in (("index_finger_free", 1 / 3), ("index_finger_free_x4", 1 / 2)):
        found = outputs["given", name]
        assert np.all(rms(found["compensated_torque"]) < most * rms(found["joint_torque"])), name
    assert not outputs["given", "index_finger_free"]["contact"].any()
    for name in ("index_finger_free", "index_finger_pushes"):
        alarms = score(recordings[name], outputs["calibrated", name]["contact"]).false_alarms
        assert all(end - begin <= 0.3 for begin, end in alarms), alarms


def test_the_calibrated_finger_is_one_that_calibrate_takes_and_writes() -> None:
    from tendonfmu.calibration.fit import earlier_finger

    given, calibrated = (read_finger(path) for path in FINGERS.values())
    earlier = earlier_finger(given, FINGERS["calibrated"])
    assert earlier.joint_names == given.joint_names and earlier.tendon_names == given.tendon_names
    assert calibrated.data["contact"]["method"] == "bands" and calibrated.data["contact"]["watches_motors"]


def test_pushes_are_found_as_the_readmes_say(
    recordings: dict[str, Recording], outputs: dict[tuple[str, str], Outputs]
) -> None:
    """Pushes and the longest false alarm of both descriptions, and what is left of the torque."""
    own, first = ((folder / "README.md").read_text(encoding="utf-8") for folder in (FOLDER, EXAMPLES.parent))
    pushes = recordings["index_finger_pushes"]
    given, calibrated = (score(pushes, outputs[which, "index_finger_pushes"]["contact"]) for which in FINGERS)
    assert (len(given.events), given.found) == (11, 8) and given.free_alarm_share < 0.12
    assert calibrated.found >= 10 and np.median(calibrated.delays) < 0.03
    assert [int(count) for count in re.findall(r"(\d+) of the 11 pushes", own)] == [given.found, calibrated.found]
    assert f"**{calibrated.found} of 11 pushes**" in first
    longest = max((end - begin for begin, end in calibrated.false_alarms), default=0.0)
    for page in (own, first):
        (median,) = re.findall(r"11 of (?:the )?11 pushes[^.]*half of them within (\d+)\s+ms", page)
        assert int(median) == round(1e3 * float(np.median(calibrated.delays)))
        (said,) = re.findall(r"no false alarm longer than ([\d.]+)\s+s", page)
        assert longest <= float(said) <= longest + 0.3
    rows = [re.findall(r"([\d.]+) → ([\d.]+)", line) for line in own.splitlines() if "→" in line]
    for (which, name), row in zip(
        [(which, name) for which in FINGERS for name in (*NAMES, "in contact")], rows, strict=True
    ):
        recording = recordings.get(name, pushes)
        found = outputs[which, name if name in NAMES else "index_finger_pushes"]
        before, left = found["joint_torque"], found["compensated_torque"]
        part = np.ones(len(recording), bool) if recording.contact is None else ~recording.contact
        if name == "in contact":
            before, part = recording.groups["external_torque"], ~part
            left = left - before
        # another machine may simulate a slip otherwise
        expected = 1e3 * np.column_stack([rms(before[part]), rms(left[part])])
        np.testing.assert_allclose(np.array(row, dtype=float), expected, rtol=0.02, atol=0.1)


def test_a_load_that_rises_over_seconds_is_found(recordings: dict[str, Recording]) -> None:
    """30 mN·m at the second joint over 4 s: the bias would have them. By the bands most are found."""
    free, finger = recordings["index_finger_free"], read_finger(FINGERS["calibrated"]).data
    arms = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
    since = (free.time - free.time[0]) % 14.0 - 8.0
    loaded = (since >= 0.0) & (since < 5.0)
    load = 0.03 * np.outer(np.minimum(since / 4.0, 1.0) * loaded, np.linalg.pinv(arms)[1])
    groups = {
        "time": free.time,
        "tendon_force": free.groups["tendon_force"] + load,
        "tendon_position": free.groups["tendon_position"] + load / stiffness,
    }

    outputs = Instance.from_description(finger).run(groups)
    result = score_detection(free.time, loaded, outputs["contact"].ravel())
    assert len(result.events) >= 4 and result.found >= 3
