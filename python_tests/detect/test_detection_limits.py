"""Where detection ends and how it recovers (bench/detection_limits.py), held to what the equations say."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from repository_paths import ROOT
from tendonfmu.model.balance import moment_arms
from tendonfmu.model.native import run_recording

sys.path.insert(0, str(ROOT / "bench"))

Numbers = NDArray[np.float64]
FINGER: dict[str, Any] = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
RATE, FORCE, JOINT = 500.0, 10.0, 1
RELEASE = 2.0  # s
STEADY = 0.4472  # s, (noise² · noise_time / drift_variance)^½ of the example's bias at 10 N
PER_NEWTON = [0.0003, 0.0007, 0.0006, 0.0004]  # N·m per N
INNOVATION = {
    "method": "innovation",
    "threshold": [0.02, 0.02, 0.02, 0.012],
    "threshold_per_force": [0.0025, 0.006, 0.005, 0.0035],
    "innovation": {"time": 0.05, "threshold": [4 * each for each in PER_NEWTON], "threshold_per_force": PER_NEWTON},
    "hold_time": 0.05,
    "release_time": RELEASE,
}


def resting(load: Numbers) -> dict[str, Numbers]:
    """A finger that stands at 10 N of pretension, its tendons holding a load [N] N·m on one joint."""
    arms = moment_arms(FINGER)
    stiffness = np.array([tendon["stiffness"] for tendon in FINGER["tendons"]])
    torque = np.zeros((len(load), arms.shape[1]))
    torque[:, JOINT] = load
    force = FORCE + (torque - FORCE * arms.sum(axis=0)) @ np.linalg.pinv(arms)
    return {"time": np.arange(len(load)) / RATE, "tendon_force": force, "tendon_position": force / stiffness}


@pytest.mark.parametrize("rise", [0.1, 1.0, 10.0])
def test_the_bias_takes_of_a_slow_load_what_its_time_constant_says(rise: float) -> None:
    time, top = np.arange(0, 6.0 + rise, 1 / RATE), 0.06
    made = resting(top * np.clip((time - 5.0) / rise, 0.0, 1.0))
    at = round((5.0 + rise) * RATE)
    left = top * STEADY / rise * (1 - np.exp(-rise / STEADY))  # of a ramp through a filter of first order
    never = run_recording(FINGER | {"contact": {"threshold": [1e6] * 4}}, made)
    assert never["residual"][at, JOINT] == pytest.approx(left, rel=0.02)
    paper, ours = (run_recording(data, made) for data in (FINGER, FINGER | {"contact": INNOVATION}))
    assert paper["contact"].any() == (left > 0.018 + 0.0027 * FORCE)
    assert ours["contact"].any() == (rise == 0.1)  # the change within 50 ms is 0.05/rise of the load beyond that


def test_an_alarm_of_a_sensor_step_ends_with_the_release_time_alone() -> None:
    from detection_limits import recovered

    time = np.arange(0, 75.0, 1 / RATE)
    step = np.where(time >= 10.0, 0.15, 0.0)
    made = resting(step)
    reference = np.zeros((len(time), 4))
    reference[:, JOINT] = step
    paper, ours = (
        recovered(time, run_recording(data, made), reference, np.full(4, 0.01), (10.0, 10.0))
        for data in (FINGER, FINGER | {"contact": INNOVATION})
    )
    assert paper["lasting"] and paper["until"] == np.inf and paper["sound"] == 0.0
    assert ours["at_once"] == 1 and ours["after"] == 0 and not ours["lasting"]
    # from then on the bias follows; it is within 10 of 150 mN·m after ln 15 of its time constants
    assert RELEASE < ours["until"] < RELEASE + np.log(15) * STEADY + 0.1
    assert RELEASE < ours["longest"] <= ours["until"] + 0.1


def test_bristles_hold_most_of_a_push_below_break_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import detection_limit_cases as cases
    from detection_limits import Subject, run_slots

    monkeypatch.setattr(cases, "STUCK_COUNT", 4)
    monkeypatch.setattr(cases, "STUCK_FORCE", (0.2, 0.3))
    fingers = [Subject.of("paper", FINGER), Subject.of("recommended", FINGER | {"contact": INNOVATION})]
    rows = run_slots(tmp_path, [cases.Case("stuck", 40.0, 1)], fingers)
    held = [row for row in rows if row["stays"] == "below"]
    assert len(rows) == 8 and len(held) == 4
    for row in held:
        # 8000 N/m on 9 mm are 0.6 N·m/rad for each tendon; bristles of 25 and 40 µm at 40 N are far stiffer
        assert row["reach"] < 0.1 < 10 * row["springs"] < row["bristles"]
        assert row["reach"] + row["lost"] == pytest.approx(1.0, abs=0.02)
        assert not row["found"] and row["visible"]  # by the change of force alone: the motors stand
        assert row["motor"] < 4e-6 and 0.01 < row["tension"] < 0.1
