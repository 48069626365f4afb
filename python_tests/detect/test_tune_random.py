"""`tune` on anything that moves: a valid description that keeps its rate, or an error that says why not."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from random_fingers import Array, Description, random_detection, random_finger
from tendonfmu.detect.free_motion import closed_loop, free_parts
from tendonfmu.detect.tune_report import build_report
from tendonfmu.detect.tuning import ContactTuning, TuneWarning
from tendonfmu.errors import InputError
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import Recording

# 13, 23, 36 and 59: negative thresholds, or of 4e10, before bounds had a least; 1 is refused
FEW, MANY = (0, 59), (*range(20), 23, 36, 59)
# one line each: the file or the key, and what was expected
PRECISE = re.compile(r"^(free_\d\.parquet: |bias\.|finger: |no free motion ).*(expected |; probably )", re.DOTALL)
REFUSED_AT_MOST = 0.4  # of the random cases; frozen forces and fingers whose bias has no time constant are refused


# --- free motion as good and as bad as people record it: sines with rests, a pretension with crude friction, noise,
# quantisation, frozen channels, slack tendons, forces of almost nothing


def random_free_case(seed: int, longest: float = 300.0) -> tuple[Description, list[Recording]]:
    """A finger of 1 to 4 joints, and 1 to 3 recordings of 10 s to `longest` s in all, at 50 to 1000 Hz."""
    rng = np.random.default_rng([seed, 11])
    finger = random_finger(seed)
    if rng.random() < 0.5:
        finger = random_detection(seed, finger)
    count = int(rng.integers(1, 4))
    seconds = float(np.exp(rng.uniform(np.log(10.0), np.log(longest))))
    rate = float(np.exp(rng.uniform(np.log(50.0), np.log(1000.0))))
    pretensions = np.sort(np.exp(rng.uniform(np.log(0.5), np.log(60.0), count)))
    return finger, [
        random_free_recording(finger, rng, max(seconds / count, 4.0), rate, float(each), k)
        for k, each in enumerate(pretensions)
    ]


def random_free_recording(
    finger: Description, rng: np.random.Generator, seconds: float, rate: float, pretension: float, number: int
) -> Recording:
    """One recording; `pretension` in N."""
    arms = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
    time = np.arange(round(seconds * rate)) / rate
    angle, speed = _motion(rng, time, arms.shape[1])
    force = _forces(rng, arms, time, speed, pretension)
    position = angle @ arms.T + force / stiffness
    force, position = _sensed(rng, force, position)
    groups = {"tendon_force": np.ascontiguousarray(force), "tendon_position": np.ascontiguousarray(position)}
    return Recording(Path(f"free_{number + 1}.parquet"), time, groups)


def _motion(rng: np.random.Generator, time: Array, joints: int) -> tuple[Array, Array]:
    """Angles [N, n] rad and their speeds: three sines a joint that stand still at times."""
    moving = np.ones_like(time)
    if rng.random() < 0.7:
        period, share = rng.uniform(3.0, 12.0), rng.uniform(0.05, 0.6)
        moving = (np.mod(time, period) > share * period).astype(float)
    own = np.cumsum(moving) * (time[1] - time[0])
    frequency = rng.uniform(0.05, 2.0, (joints, 3))
    amplitude = rng.uniform(0.05, 0.5, (joints, 3))
    amplitude[rng.random(joints) < 0.2] *= 1e-3  # a joint that hardly moves
    phase = 2 * np.pi * frequency * own[:, None, None] + rng.uniform(0, 6.3, (joints, 3))
    speed = (amplitude * 2 * np.pi * frequency * np.cos(phase)).sum(axis=2) * moving[:, None]
    return (amplitude * np.sin(phase)).sum(axis=2), speed


def _forces(rng: np.random.Generator, arms: Array, time: Array, speed: Array, pretension: float) -> Array:
    """[N, m] N: a pretension that breathes, friction of some size, creep, slack at times."""
    tendons = len(arms)
    breath = 1.0 + rng.uniform(0.0, 0.9) * np.sin(2 * np.pi * rng.uniform(0.01, 0.3) * time + rng.uniform(0, 6.3))
    force = pretension * rng.uniform(0.3, 1.5, tendons) * breath[:, None]
    rubbed = rng.uniform(0.0, 0.3) * np.abs(arms).sum(axis=0) * pretension * np.tanh(speed / 0.03)
    force = force + rubbed @ np.linalg.pinv(arms)
    if rng.random() < 0.3:
        force = force + rng.uniform(0.0, 0.3) * pretension * np.exp(-time / rng.uniform(1.0, 60.0))[:, None]
    if rng.random() < 0.4:  # slack tendons read 0 or their offset
        force = np.maximum(force, rng.choice([0.0, -0.3, 0.2]))
    return np.asarray(force)


def _sensed(rng: np.random.Generator, force: Array, position: Array) -> tuple[Array, Array]:
    """What the sensors make of them."""
    force = force + 10.0 ** rng.uniform(-4.0, 0.3) * rng.standard_normal(force.shape)
    position = position + 10.0 ** rng.uniform(-8.0, -4.5) * rng.standard_normal(position.shape)
    if rng.random() < 0.3:
        step = 10.0 ** rng.uniform(-2.0, 0.5)
        force = np.round(force / step) * step
    if rng.random() < 0.3:
        step = 10.0 ** rng.uniform(-6.0, -4.0)
        position = np.round(position / step) * step
    tendons = force.shape[1]
    if rng.random() < 0.05:
        force[:, int(rng.integers(tendons))] = rng.choice([0.0, 5.0])
    if rng.random() < 0.04:
        position[:, int(rng.integers(tendons))] = 0.0
    if rng.random() < 0.02:
        force[:] = force[0]
    if rng.random() < 0.04:  # a channel that freezes in the middle
        k = len(force) // 2
        force[k:, int(rng.integers(tendons))] = force[k, 0]
    return force, position


# --- tuned, or refused


@lru_cache(maxsize=1)
def report_validator() -> Any:
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "tune_report.schema.json").read_text())
    return jsonschema.Draft202012Validator(schema)


def tuned_or_refused(seed: int, method: str, longest: float) -> ContactTuning | None:
    """The tuning, or None where a precise error refuses it."""
    finger, recordings = random_free_case(seed, longest)
    tuning = ContactTuning(finger, method=method, bias_time=0.4 if seed % 2 else None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)
            return tuning.tune(recordings)
    except InputError as refused:
        sentence = str(refused)
    assert PRECISE.match(sentence) and "\n" not in sentence, sentence
    return None


def check(seed: int, method: str, longest: float) -> bool:
    """Whether it could be tuned; what it says of itself is counted again."""
    tuning = tuned_or_refused(seed, method, longest)
    if tuning is None:
        return False
    data = json.loads(tuning.description_text())
    Instance.from_description(data)  # the core takes it
    contact = data["contact"]
    assert contact["method"] == method
    for numbers in numbers_of(contact):
        assert np.isfinite(numbers).all() and (np.asarray(numbers) >= 0).all(), contact
    report_validator().validate(build_report(tuning))
    assert tuning.rate_ >= tuning.options.false_alarms_per_hour and (tuning.more_minutes_ > 0) == (tuning.rate_ > 6.0)
    # the own part of each bound is above 0 wherever the finger was, and no alarm lasts beyond those allowed
    _, recordings = random_free_case(seed, longest)
    parts = [part for each in recordings for part in free_parts(tuning.start_, each, 1)[0]]
    for part, flags, counted in zip(parts, closed_loop(data, parts), tuning.loop_, strict=True):
        force = part.mean_force[part.counted]
        for key in (contact, contact.get("innovation", contact)):
            own = np.outer(force, key.get("threshold_per_force", 0.0)) + key["threshold"]
            assert not len(own) or own.min() > 0
        begins = int((np.diff(flags[part.counted].astype(int), prepend=0) > 0).sum())
        assert begins >= counted.alarms
    alarms = sum(each.alarms for each in tuning.loop_)
    assert alarms <= tuning.allowed_ or any("even with bounds" in sentence for sentence in tuning.warnings_)
    return True


def numbers_of(contact: Mapping[str, Any]) -> list[Any]:
    """All numbers of `contact` but the directions of the uncertainty, which have signs."""
    found: list[Any] = []
    for key, value in contact.items():
        if isinstance(value, Mapping):
            found += numbers_of(value)
        elif key not in ("uncertainty", "method") and value is not None:
            found.append(value)
    return found


@pytest.mark.long
@pytest.mark.parametrize("method", ["innovation", "cusum", "threshold"])
def test_random_free_motion_is_tuned_or_refused(method: str) -> None:
    assert sum(check(seed, method, 40.0) for seed in FEW) >= (1 - REFUSED_AT_MOST) * len(FEW)


@pytest.mark.long
@pytest.mark.parametrize("method", ["innovation", "cusum", "threshold"])
def test_all_random_free_motion_is_tuned_or_refused(method: str) -> None:
    """10 s to 5 min."""
    assert sum(check(seed, method, 300.0) for seed in MANY) >= (1 - REFUSED_AT_MOST) * len(MANY)
