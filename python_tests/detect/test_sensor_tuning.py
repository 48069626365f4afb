"""What `tune` learns of the sensors: resolutions, and by how much forces and springs differ in free motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.detect.free_motion import FreePart
from tendonfmu.detect.sensor_faults import AMPLE, finds_a_fault, learn_sensors
from tendonfmu.estimate.structure import Choice, build_structure, with_values
from tendonfmu.model import native
from tendonfmu.model.description import Finger

Array = NDArray[np.float64]

R = np.array([[0.008, 0.0], [-0.008, 0.0], [-0.006, 0.007], [0.006, -0.007]])
STIFFNESS = np.array([4000.0, 3000.0, 5000.0, 4500.0])
RATE, SECONDS, NOISE, QUANTUM = 250.0, 60.0, 0.02, 1e-6
FINGER = {
    "format": "tendonfmu-finger-1",
    "name": "pairs",
    "joints": [{}, {}],
    "tendons": [{"stiffness": k, "moment_arms": arms} for k, arms in zip(STIFFNESS.tolist(), R.tolist(), strict=True)],
    "contact": {"threshold": [0.05, 0.05]},
}


def part(seed: int, noise: float = NOISE, softer: float = 1.0, rate: float = RATE) -> FreePart:
    """Free motion of two joints at a pretension that breathes; `softer`: the true springs over the described ones."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, 1.0 / rate)
    q = 0.4 * np.sin(np.outer(time, [1.3, 2.1]) + rng.uniform(0.0, 6.0, 2))
    force = 20.0 + 6.0 * np.sin(np.outer(time, [0.7, 0.9, 1.1, 0.8]) + rng.uniform(0.0, 6.0, 4))
    position = q @ R.T + force / (softer * STIFFNESS)
    arrays = {
        "time": time,
        "tendon_force": force + rng.normal(0.0, noise, force.shape) if noise else force,
        "tendon_position": QUANTUM * np.round(position / QUANTUM),
    }
    return FreePart("made", arrays, force.mean(axis=1), time >= 2.0, np.full(len(time), 1.0 / rate))


def changed(each: FreePart, tendon: int, values: Array | float, name: str = "tendon_force") -> FreePart:
    arrays = {key: value.copy() for key, value in each.arrays.items()}
    half = len(each.time) // 2
    arrays[name][half:, tendon] = values
    return FreePart(each.source, arrays, each.mean_force, each.counted, each.seconds)


def test_resolutions_and_margin() -> None:
    rule = learn_sensors(FINGER, [part(1), part(2)])
    assert rule.keys is not None and not rule.why
    assert rule.keys["force_resolution"] == pytest.approx(0.5 * NOISE, rel=0.1)
    assert rule.keys["position_resolution"] == pytest.approx(QUANTUM)
    assert rule.keys["spring_margin"] == pytest.approx(AMPLE * rule.largest, rel=0.01)
    assert 5.0 * NOISE < rule.keys["jump_margin"] <= rule.keys["spring_margin"]
    assert 0.02 <= rule.keys["longest_stand"] < 0.3
    assert 5.0 * NOISE < rule.largest < 15.0 * NOISE


def test_sound_motion_that_was_not_learned_from_has_no_fault() -> None:
    rule = learn_sensors(FINGER, [part(1)])
    assert rule.keys is not None
    assert not finds_a_fault(FINGER, [part(seed) for seed in range(10, 14)], rule.keys)


@pytest.mark.parametrize("tendon", range(4))
def test_a_failing_sensor_is_found(tendon: int) -> None:
    rule = learn_sensors(FINGER, [part(1)])
    assert rule.keys is not None
    sound = part(3)
    half = len(sound.time) // 2
    for name in ("tendon_force", "tendon_position"):
        assert finds_a_fault(FINGER, [changed(sound, tendon, sound.arrays[name][half, tendon], name)], rule.keys)
    assert finds_a_fault(FINGER, [changed(sound, tendon, 0.0)], rule.keys)


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_a_force_that_stands_is_found_by_its_noise_where_it_has_some(noise: float) -> None:
    rule = learn_sensors(FINGER, [part(1, noise)])
    assert rule.keys is not None
    sound = part(3, noise)
    rest = {key: values.copy() for key, values in sound.arrays.items()}
    first = len(sound.time) // 2
    for name in ("tendon_force", "tendon_position"):
        rest[name][first:] = rest[name][first]
        if name == "tendon_force" and noise:
            rest[name][first:] += np.random.default_rng(0).normal(0.0, noise, rest[name][first:].shape)
    still = FreePart("rest", rest, sound.mean_force, sound.counted, sound.seconds)
    assert ("longest_stand" in rule.keys) == (noise > 0.0)
    assert not finds_a_fault(FINGER, [still], rule.keys)
    frozen = changed(still, 1, rest["tendon_force"][first, 1])
    assert finds_a_fault(FINGER, [frozen], rule.keys) == (noise > 0.0)


def test_a_sensor_that_fails_in_free_motion_leaves_the_key_out() -> None:
    """A margin wide enough for a force that reads 0 would be none."""
    rule = learn_sensors(FINGER, [changed(part(1), 0, 0.0)])
    assert rule.keys is None and rule.why.startswith("a sensor seems to fail in free motion")


def test_springs_that_are_not_as_described_leave_the_key_out() -> None:
    rule = learn_sensors(FINGER, [part(1, softer=0.2)])
    assert rule.keys is None and rule.why.startswith("forces differ from those of their springs by up to")


@pytest.mark.parametrize(
    ("data", "drop", "why"),
    [
        (FINGER, "tendon_position", "there are no tendon positions"),
        (FINGER | {"tendons": FINGER["tendons"][1:3]}, "", "no tendon's length follows from the others"),
    ],
)
def test_why_it_is_left_out(data: dict[str, object], drop: str, why: str) -> None:
    each = part(1)
    arrays = {key: value for key, value in each.arrays.items() if key != drop}
    if not drop:
        arrays |= {key: arrays[key][:, 1:3] for key in ("tendon_force", "tendon_position")}
    rule = learn_sensors(data, [FreePart("made", arrays, each.mean_force, each.counted, each.seconds)])
    assert rule.keys is None and rule.why == why


def test_a_fit_leaves_the_watch_out_and_keeps_its_keys() -> None:
    """The sensors' watch is no part of the friction model."""
    joints = [{"friction": {"static": 0.01, "coulomb": 0.01, "stribeck_velocity": 0.1}}, {}]
    data = json.loads(json.dumps(FINGER | {"joints": joints, "sensor_fault": {"jump_margin": 0.7}}))
    finger = Finger(Path("finger"), data)
    structure = build_structure(finger, Choice())
    assert "sensor_fault" not in structure.start.data
    values = np.array([parameter.start for parameter in native.Instance(structure.start.image).parameters()])
    assert with_values(structure, values).data["sensor_fault"] == {"jump_margin": 0.7}
