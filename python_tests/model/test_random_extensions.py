"""Random fingers with random `extensions` (docs/reference/semantics.md#extensions): all implementations agree."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import oracle
import oracle_derivatives
from random_extensions import MAGNITUDES, MAKE
from random_fingers import Description, Recording, random_case
from repetitions import repeated
from runners import OTHERS, SLOW, Runner, assert_agreement, assert_state_continues, product

FINGERS = range(600, 640)
SOME = FINGERS[2::3]  # these take every branch, too
SAMPLES = 130
FMU_STRIDE = 4  # packing takes its time
CLOSED = ("presliding", "friction_drift", "stribeck", "backlash")  # at a joint or at a tendon

# What the oracle counts of the extensions beyond the branches of the model.
BRANCHES = {
    "friction_drift",
    "stribeck",
    "presliding",
    "presliding_from_rest",
    "presliding_turns",
    "gate_open",
    "gate_held",
    "gate_pushed",
    "progressive_pull",
    "progressive_push",
    "inside_the_play",
    "play_carried_along",
    "before_the_oldest",
    "delayed_forces",
    "delayed_tendon_position",
    "delayed_joint_position",
}


def source_of(seed: int) -> int:
    """Half of the fingers by tendon positions: that source sees most."""
    return (1, 2, 1, 3)[seed % 4]


@functools.cache
def case(seed: int) -> tuple[Description, Recording]:
    """Every other finger has optional keys of the detection too, entry_load and hysteresis among them."""
    return random_case(seed, SAMPLES, detection=seed % 2 == 0, extensions=True)


@functools.cache
def oracle_run(seed: int) -> oracle.Result:
    return oracle.run(*case(seed), source_of(seed))


def run_sse2(description: Description, recording: Recording, source: int) -> dict[str, Any]:
    finger = product("model.native").Instance.from_description(description, source)
    try:
        finger.kernel = "sse2"
    except product("model.native").NativeError as refused:
        pytest.skip(f"SKIPPED: no such kernel on this machine ({refused})")
    outputs: dict[str, Any] = finger.run(recording, parts=True)
    return outputs


@pytest.mark.long
def test_fingers_have_every_effect_at_every_place_and_take_every_branch() -> None:
    branches: Counter[str] = Counter()
    seen: Counter[str] = Counter()
    for seed in FINGERS:
        description = case(seed)[0]
        branches += oracle_run(seed).branches
        rows = description["extensions"]
        for row in rows:
            place = [key for key in ("joint", "tendon") if row.get(key)]
            seen["-".join([row["effect"], *place])] += 1
            seen["magnitude 0"] += all(row[key] == 0.0 for key in MAGNITUDES if key in row)
            seen["null place"] += None in row.values()
        seen["several of one effect"] += len({row["effect"] for row in rows}) < len(rows)
        seen["entry_load"] += bool(description.get("bias", {}).get("entry_load"))
        seen["friction bound"] += "friction_bound" in description["contact"]
        seen["hysteresis"] += bool(description.get("velocity_threshold", {}).get("hysteresis"))
        seen["links"] += "links" in description
        seen["position_filter"] += "position_filter" in description
        seen["initial_torque"] += "initial_torque" in description.get("bias", {})
    assert not {name for name in BRANCHES if branches[name] < 10}
    assert set().union(*(oracle_run(seed).branches for seed in SOME)) >= BRANCHES
    wanted = {f"{effect}-{place}" for effect in CLOSED for place in ("joint", "tendon")}
    wanted |= {"preload_friction-tendon", "preload_friction-joint-tendon", "friction_drift", "time_delay", "presliding"}
    assert not {name for name in wanted if not seen[name]}
    assert not {effect for effect in MAKE if not any(name.split("-")[0] == effect for name in seen)}
    assert not {name for name, count in seen.items() if not count}


def test_each_row_matters() -> None:
    """Without its rows of one effect a finger gives other numbers: agreement below is not that of two zeros."""
    without: Counter[str] = Counter()
    for seed in FINGERS:
        description, recording = case(seed)
        rows = description["extensions"]
        finger = product("model.native").Instance
        whole = finger.from_description(description, source_of(seed)).run(recording)["compensated_torque"]
        for effect in {row["effect"] for row in rows}:
            others = description | {"extensions": [row for row in rows if row["effect"] != effect]}
            less = finger.from_description(others, source_of(seed)).run(recording)["compensated_torque"]
            without[effect] += bool(np.abs(whole - less).max() > 1e-5)
    assert set(MAKE) == {effect for effect, count in without.items() if count >= 3}, without


@pytest.mark.parametrize("seeds", repeated([SOME, FINGERS], 0), ids=["some", "all"])
@pytest.mark.parametrize("runner", [*OTHERS, Runner("sse2_kernel", run_sse2)], ids=lambda runner: runner.name)
def test_agrees_with_the_oracle(runner: Runner, seeds: range) -> None:
    chosen: Sequence[int] = seeds[:: FMU_STRIDE if runner in SLOW else 1]
    if runner.name == "fmu":  # of every source, whatever the stride
        chosen = [seed + seed // FMU_STRIDE % FMU_STRIDE for seed in chosen]
    assert_agreement(runner, ((seed, *case(seed), source_of(seed), oracle_run(seed)) for seed in chosen))


def test_a_restored_state_gives_the_same_bits() -> None:
    """Saved at any sample, continued elsewhere and again: what every effect remembers is in it."""
    for seed in FINGERS:
        assert_state_continues(*case(seed), source_of(seed), [1 + (37 * seed) % (SAMPLES - 1)])


def test_kernels_give_the_same_bits() -> None:
    native = product("model.native")
    for seed in FINGERS[::2]:
        description, recording = case(seed)
        found = []
        for kernel in ("plain", "sse2", "avx2"):
            finger = native.Instance.from_description(description, source_of(seed))
            try:
                finger.kernel = kernel
            except native.NativeError:  # not on this machine
                continue
            found.append((finger.run(recording, parts=True), finger.save_state()))
        assert found
        for outputs, state in found[1:]:
            assert state == found[0][1], seed
            for name, series in outputs.items():
                np.testing.assert_array_equal(series, found[0][0][name], err_msg=f"finger {seed}, {name}")


def test_a_refused_sample_changes_nothing_that_effects_remember() -> None:
    native = product("model.native")
    for seed in FINGERS:
        description, recording = case(seed)
        source = source_of(seed)
        whole = native.Instance.from_description(description, source).run(recording)
        at = 1 + (53 * seed) % (SAMPLES - 1)
        parts = [{name: series[part] for name, series in recording.items()} for part in (slice(at), slice(at, None))]
        finger = native.Instance.from_description(description, source)
        finger.run(parts[0])
        name = {1: "tendon_position", 2: "joint_position", 3: "joint_velocity"}[source]
        for broken in ("tendon_force", name):
            wrong = {key: series[:1].copy() for key, series in parts[1].items()}
            wrong[broken][0, -1] = np.nan
            with pytest.raises(native.NativeError, match=broken):
                finger.run(wrong)
        for name, series in finger.run(parts[1]).items():
            np.testing.assert_array_equal(series, whole[name][at:], err_msg=f"finger {seed}, {name}")


def test_derivatives_are_those_of_the_oracle() -> None:
    """Step 7: what effects remember is held; at one sample of every fourth finger, at rest or in motion."""
    compared: Counter[str] = Counter()
    for seed in FINGERS[::4]:
        seed += seed // 4 % 4
        description, inputs = case(seed)
        source = source_of(seed)
        k = 20 + seed % 7 * 10
        recording = {name: series[: k + 1] for name, series in inputs.items()}
        found, errors = oracle_derivatives.derivatives(description, recording, source, k)
        finger = product("model.native").Instance.from_description(description, source)
        finger.run(recording)
        for name in oracle_derivatives.STEPS:
            for column, unit in enumerate(np.eye(inputs[name].shape[1])):
                slopes = finger.directional_derivative({name: unit})
                for output in oracle_derivatives.OUTPUTS:
                    scale = np.abs(found[output, name]).max() + 1e-6
                    error = errors[output, name][:, column]
                    known = error < 1e-5 * scale  # else there is a kink within the step
                    difference = np.abs(slopes[output] - found[output, name][:, column])
                    assert (difference < 10.0 * error + 1e-6 * scale)[known].all(), (seed, k, output, name, column)
                    compared["known"] += int(known.sum())
                    compared["all"] += known.size
                    compared["not 0"] += int((slopes[output] != 0.0).sum())
    assert compared["known"] > 0.95 * compared["all"], compared
    assert compared["not 0"] > 0.3 * compared["all"], compared
