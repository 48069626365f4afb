"""The run in which the caller says what the bias learns from, against the oracle (semantics.md#guided-runs)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import agreement
from oracle_guided import run_guided
from random_fingers import Recording, intervals, random_case
from repetitions import repeated
from tendonfmu.model import native, without_detection
from tendonfmu.model.description import finger_of
from tendonfmu.recordings import run_parts

FINGERS = range(600, 640)
SOME = FINGERS[::4]
SAMPLES = 130
OUTPUTS = (*agreement.REAL_OUTPUTS, *agreement.BOOLEAN_OUTPUTS, "residual")


def source_of(seed: int) -> int:
    return (1, 2, 1, 3)[seed % 4]


def guidance(seed: int, joints: int, samples: int = SAMPLES) -> tuple[Any, Any]:
    """What may be learned from, often not the beginning and once in a while nothing; known torque."""
    rng = np.random.default_rng([seed, 9])
    learns = intervals(rng, samples, 0.6, samples // 3).astype(bool)
    learns[: int(rng.integers(0, 20)) * int(rng.integers(0, 2))] = False
    learns &= seed % 13 != 0
    return learns, rng.normal(0.0, 0.02, (samples, joints))


def compared(expected: dict[str, Any], got: dict[str, Any]) -> agreement.Agreement:
    """All that the two have in common, and S; before the bias has begun r means nothing."""
    begun = ~np.isnan(expected["residual_variance"])
    np.testing.assert_array_equal(np.isnan(got["residual_variance"]), ~begun)
    S = expected["residual_variance"]
    np.testing.assert_allclose(got["residual_variance"][begun], S[begun], rtol=1e-9, atol=1e-15)
    for outputs in (expected, got):
        outputs["residual"] = np.where(begun, outputs["residual"], 0.0)
    return agreement.compare(expected, {name: values for name, values in got.items() if name in OUTPUTS})


@pytest.mark.parametrize("seeds", repeated([SOME, FINGERS], 0), ids=["some", "all"])
def test_agrees_with_the_oracle(seeds: range) -> None:
    late = 0
    for seed in seeds:
        description, recording = random_case(seed, SAMPLES, detection=True, extensions=seed % 3 > 0)
        free, source = without_detection(description), source_of(seed)
        learns, known = guidance(seed, len(description["joints"]))
        expected = run_guided(free, recording, source, learns, known)
        got = native.Instance.from_description(free, source).run_guided(recording, learns, known)
        found = compared(expected, got)
        assert found.agrees, f"finger {seed}, source {source}: {found}"
        late += bool(np.isnan(expected["residual_variance"][1:]).any() and learns.any())
    assert late


@pytest.mark.parametrize("seed", FINGERS[:4])
def test_contact_has_no_say(seed: int) -> None:
    """Whatever the description detects; with all to learn from it is an ordinary run of one that detects nothing."""
    description, recording = random_case(seed, SAMPLES, detection=True)
    detecting, free = {**description, "sensor_fault": None}, without_detection(description)
    for learns, known in (guidance(seed, len(description["joints"])), (np.ones(SAMPLES, dtype=bool), None)):
        runs = [
            native.Instance.from_description(data, 3).run_guided(recording, learns, known) for data in (detecting, free)
        ]
        assert not runs[0]["contact"].any()
        for name in ("residual", "residual_variance", "bias_torque", "friction_torque"):
            np.testing.assert_array_equal(runs[0][name], runs[1][name], err_msg=name)
    assert not runs[1]["contact_level"].any()
    for name, values in native.Instance.from_description(free, 3).run(recording).items():
        if name != "contact_level":
            np.testing.assert_array_equal(runs[1][name], values, err_msg=name)


@pytest.mark.parametrize("seed", [601, 604])
def test_each_part_begins_anew(seed: int) -> None:
    description, recording = random_case(seed, SAMPLES, detection=True, extensions=True)
    learns, known = guidance(seed, len(description["joints"]))
    parts = [slice(0, 50), slice(55, SAMPLES)]
    whole: Recording = recording | {"external_torque": known}
    made = run_parts(finger_of(description), whole, parts, learns, 3)
    assert np.isnan(made.residual[50:55]).all() and np.isnan(made.torque[50:55]).all()
    for part in parts:
        rows = {name: values[part] for name, values in recording.items()}
        expected = run_guided(without_detection(description), rows, 3, learns[part], known[part])
        begun = ~np.isnan(expected["residual_variance"])
        scale = np.abs(expected["joint_torque"]).max()
        left = np.where(begun, expected["residual"], np.nan)
        np.testing.assert_allclose(made.residual[part], left, rtol=0.0, atol=1e-9 * scale)
        np.testing.assert_array_equal(np.isnan(made.variance[part]), ~begun)


def test_a_guided_run_begins_with_the_first_sample() -> None:
    description, recording = random_case(600, SAMPLES)
    finger = native.Instance.from_description(description, 3)
    finger.run(recording)
    with pytest.raises(native.NativeError, match="the first sample is already taken"):
        finger.run_guided(recording, np.ones(SAMPLES, dtype=bool), None)
    fresh = native.Instance.from_description(description, 3)
    with pytest.raises(native.NativeError, match=f"learns: expected {SAMPLES} flags"):
        fresh.run_guided(recording, np.ones(19, dtype=bool), None)
    fresh.run_guided(recording, np.ones(SAMPLES, dtype=bool), None)
    again = fresh.run({name: values + 100.0 if name == "time" else values for name, values in recording.items()})
    assert np.isfinite(again["residual"]).all()  # the next run is an ordinary one
