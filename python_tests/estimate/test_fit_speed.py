"""A loose guard of the fit's speed: a tenth of what docs/evidence/speed.md says, in CPU time."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from fit_data import wavy_motion
from repository_paths import ROOT
from tendonfmu.estimate import estimation
from tendonfmu.model.description import Finger, read_finger
from tendonfmu.model.friction_places import balanced_forces

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
PASS, FILTER = 15_000, 2_000  # samples per second of CPU time, 468 unknowns


@pytest.fixture(scope="module")
def finger() -> Finger:
    return read_finger(FINGER)


@pytest.fixture(scope="module")
def recording(finger: Finger) -> dict[str, Any]:
    """10 s at 1 kHz, all joints moving."""
    motion = wavy_motion(1, 10.0, 1000.0, len(finger.joint_names))
    force = balanced_forces(finger.data, motion, np.full(len(motion["time"]), 20.0))
    return {**motion, "tendon_force": force}


def test_a_pass_over_the_data(finger: Finger, recording: dict[str, Any]) -> None:
    estimator = estimation.Estimator(finger.image)
    assert len(estimator.unknowns) == 468
    estimator.add_recording(recording, kinematics_source=3)
    begin = time.process_time()
    _, _, information = estimator.evaluate(estimator.start)
    seconds = time.process_time() - begin
    assert np.count_nonzero(np.diag(information)) > 300
    assert len(recording["time"]) / seconds > PASS


def test_the_filter(finger: Finger, recording: dict[str, Any]) -> None:
    learner = estimation.Learner(finger.image)
    first = {name: values[:5000] for name, values in recording.items()}
    begin = time.process_time()
    learner.run(first, kinematics_source=3)
    seconds = time.process_time() - begin
    assert np.isfinite(learner.z).all() and np.any(learner.z != [unknown.start for unknown in learner.unknowns])
    assert len(first["time"]) / seconds > FILTER
