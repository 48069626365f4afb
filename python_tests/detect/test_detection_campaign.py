"""What the detection campaign (bench/detection.py) compares with is what it says: the matched detector is as good as
its theory in noise that is as it assumes, rivals remove what they predict, their thresholds hold the rate they are for.
"""

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
from tendonfmu.recordings.recording import Recording

sys.path.insert(0, str(ROOT / "bench"))

Numbers = NDArray[np.float64]
FINGER = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
RATE = 100.0


def coloured(seed: int, samples: int, deviation: float) -> Numbers:
    """[N, 2] N·m, correlated over 50 ms and between the joints."""
    from scipy.signal import lfilter

    keep = np.exp(-1 / (RATE * 0.05))
    white = np.random.default_rng(seed).standard_normal((samples, 2)) @ [[1.0, 0.6], [0.0, 0.8]]
    return deviation * np.asarray(lfilter([np.sqrt(1 - keep**2)], [1, -keep], white, axis=0))


@pytest.mark.long
def test_a_matched_detector_finds_what_its_theory_says() -> None:
    import matched_detector as matched

    noise = [coloured(seed, 60_000, 0.01) for seed in range(2)]
    free = [matched.Quiet(each, np.ones(len(each), dtype=bool)) for each in noise]
    length, before = 20, round(matched.BEFORE / matched.STEP)
    signal = np.zeros((length, 2))
    signal[before:] = [0.012, -0.004]
    unpushed = coloured(9, 200 * length, 0.01).reshape(200, length, 2)
    asked = [matched.Asked(signal, signal, each + signal) for each in unpushed]
    answer = matched.answer(free, asked, after=0.1)
    # excesses of a coloured statistic come in groups, so that the same rate allows a lower limit than the theory's 4.15
    assert 3.2 < answer.limit < 4.3
    distance = 4.1488 - float(np.median(matched.norm.isf(answer.theory)))
    expected = float(matched.norm.sf(answer.limit - distance))
    assert 0.2 < expected < 0.98
    assert abs(answer.torque_known.mean() - expected) < 4 * np.sqrt(expected * (1 - expected) / 200)
    assert np.array_equal(answer.torque_known, answer.effect_known)
    assert not matched.answer(free, [matched.Asked(signal, signal, unpushed[0])], after=0.1).torque_known[0]


@pytest.fixture(scope="module")
def rubbing() -> tuple[Recording, Numbers]:
    """All joints move and rub with 0.3 times their number in % N·m and 1 mN·m·s/rad; the friction torque [N, n]."""
    arms, time = moment_arms(FINGER), np.arange(0, 60, 0.002)
    stiffness = np.array([tendon["stiffness"] for tendon in FINGER["tendons"]])
    phase = np.outer(time, [0.7, 0.9, 1.1, 1.3])
    angle, speed = 0.2 - 0.2 * np.cos(phase), 0.2 * np.array([0.7, 0.9, 1.1, 1.3]) * np.sin(phase)
    friction = 0.003 * np.arange(1, 5) * np.tanh(speed / 0.1) + 0.001 * speed
    force = 10.0 + friction @ np.linalg.pinv(arms)
    force -= (10.0 * arms.sum(axis=0)) @ np.linalg.pinv(arms)
    position = angle @ arms.T + force / stiffness
    return Recording(Path("rubbing"), time, {"tendon_force": force, "tendon_position": position}), friction


def quick() -> dict[str, Any]:
    """The finger with velocities as they are."""
    return FINGER | {"velocity_filter_cutoff": 0.0}


@pytest.mark.parametrize("tensions", [False, True])
def test_a_predictor_finds_and_removes_friction_of_its_kind(rubbing: Any, tensions: bool) -> None:
    from detection_rivals import Detector, fit_predictor, without_friction

    recording, friction = rubbing
    predictor, rms = fit_predictor(quick(), recording, tensions)
    assert np.all(rms < 0.02 * friction.std(axis=0))
    if not tensions:
        assert predictor.scale == 0.1
        assert [each[0] for each in predictor.coefficients] == pytest.approx(0.003 * np.arange(1, 5), rel=0.02)
    rival = Detector("rival", without_friction(quick(), covers=False), predictor)
    left = rival.inputs(recording)["tendon_force"] @ moment_arms(FINGER)
    assert np.abs(left - left.mean(axis=0)).max() < 0.1 * np.abs(friction).max()
    bare = Detector("bare", rival.description)
    assert np.all(
        rival.residual(rival.inputs(recording)).std(axis=0) < 0.2 * bare.residual(bare.inputs(recording)).std(axis=0)
    )


def test_thresholds_are_the_lowest_that_hold_the_rate() -> None:
    """White noise in the forces that grows with the tension, 10 min at each of two pretensions: 2 alarms allowed."""
    from detection_rivals import FINER, Detector, _holds, best_thresholds, without_friction

    random = np.random.default_rng(3)
    time = np.arange(0, 600, 1 / RATE)
    free = [
        [Recording(Path("noise"), time, {
            "tendon_force": tension * (1 + 0.01 * random.standard_normal((len(time), 8))),
            "tendon_position": np.zeros((len(time), 8)),
        })]
        for tension in (10.0, 40.0)
    ]  # fmt: skip
    tuned = best_thresholds(Detector("bare", without_friction(FINGER)), free)
    flat = [(tuned.inputs(group[0]), np.zeros(0)) for group in free]
    assert _holds(tuned, flat, 2)
    contact = {key: np.array(tuned.description["contact"][key]) for key in ("threshold", "threshold_per_force")}
    # noise in proportion to the tension needs thresholds in proportion to it
    assert np.all(contact["threshold"] < 2 * contact["threshold_per_force"])
    lower = tuned.with_thresholds(FINER * contact["threshold"], FINER * contact["threshold_per_force"])
    assert not _holds(lower, flat, 2)
