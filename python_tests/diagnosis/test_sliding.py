"""Fingers that stick and slip: what is stuck says little of the friction, and does not decide what is named."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from tendonfmu.diagnosis.sliding import TIMES, is_stuck, settled

import sticking_finger
from tendonfmu.calibration.fit import fit_all
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.remainder import Remainder, unexplained_of
from tendonfmu.diagnosis.remainder_features import Finding
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.prepared import Held, prepare
from tendonfmu.recordings.recording import read_recording
from tendonfmu.recordings.smoothing import Signals

PHYSICS = {"presliding", "inertia"}  # of any finger; the simulated joint has an inertia


def diagnosed(folder: Path, seed: int, weight: float = 0.0) -> Diagnosis:
    finger, recording = sticking_finger.write(folder, 30.0, seed, weight)
    return diagnose(finger, [recording], kinematics=2)


def friction_of(data: Any) -> float:
    return sticking_finger.described_friction_at(data, 20.0)


# --- which samples ----------------------------------------------------------------------------------------------------


def made(speed: list[list[float]]) -> Any:
    return cast("Any", SimpleNamespace(time=np.arange(len(speed)), model=SimpleNamespace(joint_speed=np.array(speed))))


def test_a_sample_is_stuck_if_anything_that_ever_slides_stands_still() -> None:
    """The tendons begin to move at 0.5 mm/s, 62.5 and 58.8 mrad/s here, the joint at 10 mrad/s."""
    data = sticking_finger.description()
    speeds = [0.0, 0.005, -0.02, 0.06, -0.0626, 0.1, -1.0]
    assert is_stuck(data, made([[each] for each in speeds])).tolist() == [True, True, True, True, False, False, False]


def test_what_never_slides_makes_no_sample_stuck() -> None:
    """A tendon that ends before the second joint never slides there; a joint that is blocked never does, either."""
    data = sticking_finger.description()
    law = data["joints"][0]["friction"]
    data["joints"].append({"name": "blocked", "friction": law})
    for tendon in data["tendons"]:
        tendon["moment_arms"].append(0.0)
        tendon["edge_friction"].append(law)
    assert is_stuck(data, made([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0]])).tolist() == [True, False, False]


# --- the time of presliding -------------------------------------------------------------------------------------------


def test_the_time_of_presliding_is_that_of_the_least_error() -> None:
    """The fitted one stays if no other is better."""
    place = {"effect": "presliding", "joint": 1, "displacement": 1e-3}
    everywhere = {"effect": "presliding", "displacement": 3e-7}
    best = TIMES[3]
    given = {"name": "finger", "extensions": [place, everywhere]}
    found = settled(given, lambda data: abs(data["extensions"][1]["displacement"] - best))
    assert found == {"name": "finger", "extensions": [place, {**everywhere, "displacement": best}]}
    assert given["extensions"] == [place, everywhere]
    fitted = {"extensions": [{"effect": "presliding", "displacement": 0.0053}]}
    assert settled(fitted, lambda data: abs(data["extensions"][0]["displacement"] - 0.0053)) is fitted


# --- what is left -----------------------------------------------------------------------------------------------------


def test_what_is_left_is_measured_by_the_error_of_all_samples() -> None:
    """Half of a residual that holds a hundredth of the squared error: 0.25 % of the rms, which is not material."""
    gain = np.full((10, 1), 0.05)
    found = (Finding(1, "angle", "joint 1"),)
    left = Remainder((0.5,), gain, gain, np.array([1.0]), 1e-9, "over the angle", np.zeros((4, 1)), found)
    alone, all_of_it = (unexplained_of(left, np.array([1.0]), np.array([whole]), 0.03, 1e9) for whole in (1.0, 100.0))
    assert (alone.share, alone.unknown, alone.description) == (0.5, True, "over the angle")
    assert (all_of_it.share, all_of_it.unknown, all_of_it.description) == (0.005, False, "")
    assert all_of_it.gain.high == pytest.approx(1.0 - np.sqrt(1.0 - 0.005), rel=1e-9)


def test_a_friction_law_of_another_form_is_not_unknown_unless_it_is_large() -> None:
    gain, found = np.full((10, 1), 0.05), (Finding(1, "velocity", "joint 1"),)
    left = Remainder((0.5,), gain, 0 * gain, np.array([1.0]), 1e-9, "the velocity", np.zeros((4, 1)), found)
    unknown = [unexplained_of(left, np.ones(1), np.ones(1), 0.03, torque).unknown for torque in (1000.0, 10.0)]
    assert unknown == [False, True]


# --- a calibration's fit to all motion ---


def test_a_calibration_fits_the_friction_of_a_finger_that_sticks(tmp_path: Path) -> None:
    extended = sticking_finger.description() | {"extensions": [{"effect": "presliding", "displacement": 0.01}]}
    path, recording = sticking_finger.write(tmp_path, 30.0, 3)
    path.write_text(json.dumps(extended), encoding="utf-8")
    finger = read_finger(path)
    measured = [prepare(finger, read_recording(recording), 2, Held())]
    sliding, everything = (
        fit_all(
            finger,
            measured,
            Signals(12.0, 2),
            FitSettings(threads=1),
            given=extended,
            seed=0,
            only_sliding=only_sliding,
        ).data
        for only_sliding in (True, False)
    )
    true = sticking_finger.friction_at(20.0)
    assert friction_of(sliding) == pytest.approx(true, rel=0.08)
    assert abs(friction_of(everything) - true) > abs(friction_of(sliding) - true)


# --- whole diagnoses --------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_finger_that_sticks_gets_its_true_friction_and_no_false_cause(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, 3)
    (said,) = (text for text in found.warnings if re.search(r"in 2\d % of the samples", text))
    ((before, after),) = re.findall(r"falls from ([\d.]+) to ([\d.]+) mN·m", said)
    assert float(after) < 0.3 * float(before)
    assert {cause.where.effect for cause in found.causes} <= PHYSICS
    assert found.gain.low > 0.0
    true = sticking_finger.friction_at(20.0)
    assert friction_of(found.extended_data) == pytest.approx(true, rel=0.08)
    assert friction_of(found.nominal_data) > 1.3 * true  # the given structure, fitted to all samples


@pytest.mark.long
def test_a_weight_hidden_in_a_finger_that_sticks_is_found_with_its_size(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, 4, weight=0.05)
    (cause,) = (each for each in found.causes if each.where.effect not in PHYSICS)
    assert cause.where.effect == "gravity"
    largest = max(abs(value) for value, _ in cause.parameters.values())
    assert largest == pytest.approx(0.05, rel=0.2)  # the cover takes a part
