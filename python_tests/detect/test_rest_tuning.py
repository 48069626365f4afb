"""What `tune` learns of rests (tendonfmu.detect.contact_at_rest), on made recordings of one joint between two tendons.

The finger moves for 1 s and rests for 4 s, in turn. At rest its torque creeps towards another one, and positions and
forces are noisy. Nothing of the product makes these recordings.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from runners import product

Array = NDArray[np.float64]

ARM, STIFFNESS, RATE = 0.008, 4000.0, 200.0  # m, N/m, Hz
ARMS = np.array([[ARM], [-ARM]])
MOVE, REST = 1.0, 4.0  # s
FORCE_NOISE, RESOLUTION = 0.01, 2e-6  # N, m
FRICTION = 0.02  # N·m
CREEP, CREEP_TIME = 0.002, 3.0  # N·m of one rest, s
FINGER = {
    "format": "tendonfmu-finger-1",
    "name": "made",
    "joints": [{"name": "j"}],
    "tendons": [{"stiffness": STIFFNESS, "moment_arms": [float(arm)]} for arm in ARMS[:, 0]],
    "contact": {"threshold": [0.05]},
}


def made(minutes: float, seed: int, load: float = 0.0) -> dict[str, Array]:
    """A recording; load: N·m on the joint from 2 s after the begin of every rest on, until the next move."""
    random = np.random.default_rng(seed)
    time = np.arange(round(60.0 * minutes * RATE)) / RATE
    cycle, phase = np.divmod(time, MOVE + REST)
    posture = random.uniform(-0.5, 0.5, int(cycle[-1]) + 2)
    creeping = random.uniform(-CREEP, CREEP, len(posture))
    share = np.clip(phase / MOVE, 0.0, 1.0)
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    at = cycle.astype(int)
    angle = posture[at] + smooth * (posture[at + 1] - posture[at])
    resting = np.maximum(phase - MOVE, 0.0)
    torque = dry(angle) + creeping[at] * (1.0 - np.exp(-resting / CREEP_TIME)) + load * (resting > 2.0)
    force = 10.0 + torque[:, None] * ARMS[:, 0] / (ARMS**2).sum()
    position = angle[:, None] * ARMS[:, 0] + 10.0 / STIFFNESS
    return {
        "time": time,
        "tendon_force": force + FORCE_NOISE * random.standard_normal(force.shape),
        "tendon_position": np.round(position / RESOLUTION) * RESOLUTION,
    }


def dry(angle: Array) -> Array:
    """[N] N·m: friction of FRICTION that turns over within 0.02 rad and stays as it is at rest."""
    torque, held = np.zeros_like(angle), 0.0
    for k, step in enumerate(np.diff(angle), start=1):
        held = min(max(held + FRICTION / 0.02 * step, -FRICTION), FRICTION)
        torque[k] = held
    return torque


def learned(*recordings: dict[str, Array]) -> tuple[Any, list[str]]:
    free_motion, tuning = product("detect.free_motion"), product("detect.contact_at_rest")
    parts = [
        free_motion.FreePart("made", arrays, np.full(len(arrays["time"]), 10.0), arrays["time"] >= 2.0,
                             np.full(len(arrays["time"]), 1.0 / RATE))
        for arrays in recordings
    ]  # fmt: skip
    rule, sentences = tuning.learn_rest(FINGER, parts, 6.0, 0.9)
    return rule, sentences


def at_rest(rule: Any, arrays: dict[str, Array]) -> NDArray[np.bool_]:
    data = FINGER | {"contact": {"threshold": [1e6], "rest": dict(rule.keys)}}
    return np.ravel(product("model.native").Instance.from_description(data).run(arrays)["contact_at_rest"])


@pytest.fixture(scope="module")
def rule() -> Any:
    found, sentences = learned(made(12.0, 1), made(12.0, 2))
    assert found is not None, sentences
    return found


def test_bounds_follow_from_noise_and_creep(rule: Any) -> None:
    """Positions stand to their resolution; the noise of c is √2·ARM·√2·10 mN over the root of 12 samples, 50 µN·m."""
    assert rule.keys["travel"] == pytest.approx(2.0 * RESOLUTION)
    assert rule.rests > 200 and 0.2 < rule.hours < 0.4
    (threshold,), (creep,), (sudden,) = (
        rule.keys["threshold"], rule.keys["creep"], rule.keys["innovation"]["threshold"]
    )  # fmt: skip
    # least: four σ; most: all of the creep of a rest, and half as much again
    assert 2e-4 < threshold < 1.5 * CREEP
    assert 2e-4 < sudden < 1.5 * CREEP
    assert threshold + creep * np.sqrt(REST) < 2.0 * CREEP


def test_other_rests_make_no_alarm_and_pushes_are_found(rule: Any) -> None:
    fresh = made(10.0, 3)
    assert np.sum(np.diff(at_rest(rule, fresh).astype(int)) > 0) <= 1
    for load in (0.005, -0.005):
        arrays = made(5.0, 4, load)
        alarm = at_rest(rule, arrays)
        phase = arrays["time"] % (MOVE + REST)
        pushed = phase > MOVE + 2.2
        assert alarm[pushed].mean() > 0.97
        assert alarm[(phase < MOVE + 1.99) & (arrays["time"] > 5.0)].mean() < 0.01


def test_what_cannot_be_learned_is_left_out_and_said() -> None:
    few, sentences = learned(made(1.0, 1))
    assert few is None and "rests of" in sentences[0] and sentences[0].startswith("contact.rest is left out: ")
    moving = made(5.0, 1)
    swing = 0.5 * np.sin(3.0 * moving["time"])
    none, sentences = learned(moving | {"tendon_position": swing[:, None] * ARMS[:, 0]})
    assert none is None and sentences == ["contact.rest is left out: the motors never stand for 0.3 s"]
    arrays = made(5.0, 1)
    blind = {name: values for name, values in arrays.items() if name != "tendon_position"}
    without, sentences = learned(blind)
    assert without is None and sentences == ["contact.rest is left out: there are no tendon positions"]


def test_tune_writes_the_rule_and_keeps_its_rate() -> None:
    tuning, recording = product("detect.tuning"), product("recordings.recording")
    sources = []
    for seed in (1, 2):
        groups = made(13.0, seed)
        sources.append(recording.Recording(Path(f"free_{seed}"), groups.pop("time"), groups))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        tuned = tuning.ContactTuning(FINGER, false_alarms_per_hour=10.0).tune(sources)
    contact = tuned.description_.data["contact"]
    assert contact["rest"] == tuned.rest_.keys and contact["rest"]["travel"] == pytest.approx(2.0 * RESOLUTION)
    assert sum(each.alarms for each in tuned.loop_) <= tuned.allowed_
    assert not any("left out" in str(each.message) for each in said)
