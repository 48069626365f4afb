"""The random fingers take every branch of docs/reference/semantics.md; every runner agrees with the oracle."""

from __future__ import annotations

import functools
from collections import Counter
from typing import Any

import numpy as np
import pytest

import agreement
import oracle
from random_fingers import Description, Recording, random_case
from repetitions import repeated
from runners import OTHERS, SLOW, Runner, assert_agreement

FINGERS, FEWER = 50, 15
SOURCES = (1, 2, 3)
DETECTION_FINGERS = range(100, 136)  # with a subset of the optional keys of the detection each
SOME = DETECTION_FINGERS[::2]  # these take every branch, too
DETECTION_SAMPLES = 250

# Every branch of section 5 as the oracle counts them; a new one there must be added here.
BRANCHES = {
    "first_sample_moves",
    "first_sample_stuck",
    "initial_bias",
    "initial_torque",
    "keeps_moving",
    "reversal_between_samples",
    "enter",
    "enter_in_contact",
    "stays_stuck",
    "first_exit",
    "first_exit_in_contact",
    "exit_after_one_sample",
    "exit_with_memory",
    "exit_same_side",
    "exit_other_side",
    "exit_in_contact",
    "moves_above_zero_threshold",
    "symmetric_positive",
    "symmetric_negative",
    "asymmetric_positive",
    "asymmetric_negative",
    "working_points_below",
    "working_points_inside",
    "working_points_above",
    "slack_at_spring",
    "slack_by_loss",
    "bidirectional_pulls",
    "bidirectional_pushes",
    "contact",
    "no_contact",
    "stuck_in_contact",
    "noise_time",
    "gain_zero_of_zero",
}

# The same of the optional keys of the detection.
DETECTION_BRANCHES = {
    "gate_open",
    "gate_held",
    "gate_pushed",
    "hysteresis_keeps_moving",
    "hysteresis_stays_stuck",
    "entry_load_taken_out",
    "exit_with_absorption",
    "exit_unabsorbed",
    "uncertain_joint",
    "certain_joint",
    "innovation_alone",
    "cusum_alone",
    "residual_alone",
    "evidence_without_bound",
    "evidence_emptied",
    "evidence_fastest",
    "evidence_full",
    "release_ratio_holds",
    "held",
    "update_in_contact",
    "start_turned",
    "drift_alone",
    "drift_begins_anew",
    "start_stands",
}


@functools.cache
def case(seed: int) -> tuple[Description, Recording]:
    return random_case(seed)


@functools.cache
def oracle_run(seed: int, source: int) -> oracle.Result:
    return oracle.run(*case(seed), source)


@functools.cache
def detection_case(seed: int) -> tuple[Description, Recording]:
    return random_case(seed, DETECTION_SAMPLES, detection=True)


@functools.cache
def detection_oracle_run(seed: int) -> oracle.Result:
    return oracle.run(*detection_case(seed), 1 + seed % 3)


@pytest.mark.long
@pytest.mark.parametrize("fingers", repeated([FEWER, FINGERS], 0))
def test_random_fingers_take_every_branch(fingers: int) -> None:
    branches: Counter[str] = Counter()
    for seed in range(fingers):
        branches += oracle_run(seed, 1 + seed % 3).branches
    rare = {name: branches[name] for name in BRANCHES if branches[name] < fingers / 5}
    assert not rare
    assert set(branches) == BRANCHES


@pytest.mark.parametrize("sources", repeated([1, 2], 0))
@pytest.mark.parametrize("runner", OTHERS, ids=lambda runner: runner.name)
def test_agrees_with_the_oracle_on_random_fingers(runner: Runner, sources: int) -> None:
    """sources: how many of the kinematics each finger has; with one, it is the fewer fingers, of them some if slow."""
    seeds = range(FINGERS) if sources > 1 else range(0, FEWER, 6 if runner in SLOW else 1)
    chosen = ((seed, (seed + k) % 3 + 1) for seed in seeds for k in range(sources))
    assert_agreement(runner, ((seed, *case(seed), source, oracle_run(seed, source)) for seed, source in chosen))


# --- the optional keys of the detection


@pytest.mark.long
def test_detection_fingers_take_every_branch() -> None:
    branches: Counter[str] = Counter()
    for seed in DETECTION_FINGERS:
        branches += detection_oracle_run(seed).branches
    rare = {name: branches[name] for name in DETECTION_BRANCHES if branches[name] < 10}
    assert not rare
    assert set(branches) - BRANCHES == DETECTION_BRANCHES
    assert set().union(*(detection_oracle_run(seed).branches for seed in SOME)) >= DETECTION_BRANCHES


@pytest.mark.parametrize("seeds", repeated([SOME, DETECTION_FINGERS], 0), ids=["some", "all"])
@pytest.mark.parametrize("runner", OTHERS, ids=lambda runner: runner.name)
def test_agrees_with_the_oracle_on_detection(runner: Runner, seeds: range) -> None:
    chosen = seeds[:: 6 if runner in SLOW else 1]
    cases = ((seed, *detection_case(seed), 1 + seed % 3, detection_oracle_run(seed)) for seed in chosen)
    given = agreement.DETECTION_OUTPUTS[:1] if runner.name == "fmu" else agreement.DETECTION_OUTPUTS
    assert_agreement(runner, cases, *given)


# --- the agreement rule itself


def changed(outputs: dict[str, Any], name: str, k: int, by: float) -> dict[str, Any]:
    copy = {key: np.array(series) for key, series in outputs.items()}
    copy[name][k, 0] = not copy[name][k, 0] if copy[name].dtype == bool else copy[name][k, 0] + by
    return copy


def test_tolerance_is_that_of_the_contract() -> None:
    outputs = oracle_run(0, 1).outputs
    for name in agreement.REAL_OUTPUTS:
        source = ("joint_torque", "friction_torque") if name == "compensated_torque" else (name,)
        allowed = 1e-9 * max(np.abs(outputs[each][:, 0]).max() for each in source) + 1e-12
        assert agreement.compare(outputs, changed(outputs, name, 7, 0.99 * allowed)).agrees
        found = agreement.compare(outputs, changed(outputs, name, 7, 1.01 * allowed))
        assert found.first is not None
        assert found.first[:3] == (7, name, 0)


def test_booleans_and_nan_never_agree_by_tolerance() -> None:
    outputs = oracle_run(0, 1).outputs
    for name in ("joint_contact", "slack"):
        assert not agreement.compare(outputs, changed(outputs, name, 9, 0.0)).agrees
    assert not agreement.compare(outputs, changed(outputs, "bias_torque", 9, np.nan)).agrees


@pytest.mark.parametrize("source", SOURCES)
def test_a_zero_shifts_the_readings_of_its_tendon(source: int) -> None:
    """Angles and contact at rest take the readings less their zeros; with measured angles nothing else changes."""
    description, recording = random_case(3)
    zeros = 1e-3 * np.arange(1, len(description["tendons"]) + 1)
    bare = [{key: value for key, value in tendon.items() if key != "zero"} for tendon in description["tendons"]]
    moved = [tendon | {"zero": zero} for tendon, zero in zip(bare, zeros, strict=True)]
    shifted = recording | {"tendon_position": recording["tendon_position"] + zeros}
    for other in OTHERS[:1]:
        as_is = other(description | {"tendons": bare}, recording, source)
        out = other(description | {"tendons": moved}, shifted, source)
        for name, values in as_is.items():
            np.testing.assert_allclose(out[name], values, rtol=0.0, atol=1e-7 * max(1.0, np.abs(values).max()))
