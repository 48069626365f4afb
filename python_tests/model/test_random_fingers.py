"""Random fingers take every branch of docs/reference/semantics; every implementation agrees with the oracle."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import agreement
import oracle
import oracle_derivatives
from random_extensions import MAKE
from random_fingers import Description, Recording, failing_case, random_case
from runners import NATIVE, OTHERS, SLOW, Runner, assert_agreement, assert_state_continues, product


@dataclass(frozen=True)
class Campaign:
    """Random fingers of one kind."""

    case: Callable[[int], tuple[Description, Recording]]  # by seed
    seeds: Sequence[int]
    some: Sequence[int]  # of them, in `./test`; these take every branch, too
    branches: set[str]  # that the oracle counts, beyond those of the plain model
    outputs: tuple[str, ...] = ()  # that every implementation gives
    sources: tuple[int, ...] = (1, 2, 3)  # kinematics, by the seed

    def source(self, seed: int) -> int:
        return self.sources[seed % len(self.sources)]


def with_detection(seed: int) -> tuple[Description, Recording]:
    """A subset of the optional keys of the detection."""
    return random_case(seed, 250, detection=True)


def with_extensions(seed: int) -> tuple[Description, Recording]:
    """Every other finger has optional keys of the detection too."""
    return random_case(seed, 130, detection=seed % 2 == 0, extensions=True)


CAMPAIGNS = {
    "plain": Campaign(
        random_case,
        range(50),
        range(15),
        {
            "first_sample_moves", "first_sample_stuck", "initial_bias", "initial_torque", "keeps_moving",
            "reversal_between_samples", "enter", "enter_in_contact", "stays_stuck", "first_exit",
            "first_exit_in_contact", "exit_after_one_sample", "exit_with_memory", "exit_same_side", "exit_other_side",
            "exit_in_contact", "moves_above_zero_threshold", "symmetric_positive", "symmetric_negative",
            "asymmetric_positive", "asymmetric_negative", "working_points_below", "working_points_inside",
            "working_points_above", "slack_at_spring", "slack_by_loss", "bidirectional_pulls", "bidirectional_pushes",
            "contact", "no_contact", "stuck_in_contact", "noise_time", "gain_zero_of_zero",
        },
    ),
    "detection": Campaign(
        with_detection,
        (*range(100, 136), 149, 179),  # the last two are blocked at home
        (*range(100, 136, 2), 149),
        {
            "exit_with_absorption", "exit_unabsorbed", "begins_in_band_1", "begins_in_band_2", "begins_in_band_3",
            "begins_in_band_4", "contact_ends", "too_early_to_end", "home_blocks", "change_limited", "reserve_limited",
            "held_by_another", "own_pace", "from_home", "moves_first",
        },
        agreement.DETECTION_OUTPUTS,
    ),
    "extensions": Campaign(
        with_extensions,
        range(600, 640),
        range(602, 640, 3),
        {
            "friction_drift", "stribeck", "element_slips", "element_holds", "one_element_slips",
            "progressive_pull", "progressive_push", "inside_the_play",
            "play_carried_along", "before_the_oldest", "delayed_forces", "delayed_tendon_position",
            "delayed_joint_position",
        },
        sources=(1, 2, 1, 3),  # tendon positions see most
    ),
    "sensor faults": Campaign(
        failing_case,
        range(512, 524),
        range(512, 524, 2),
        {
            "jump", "force stands", "position stands", "recovers", "agrees_for_a_while", "joint_begins_anew",
            "row_leaves", "row_cannot_leave",
        },
        ("sensor_fault", "contact_observable"),
    ),
}  # fmt: skip


@functools.cache
def reference(name: str, seed: int) -> oracle.Result:
    """The oracle's run."""
    return oracle.run(*CAMPAIGNS[name].case(seed), CAMPAIGNS[name].source(seed))


every_campaign = pytest.mark.parametrize("name", CAMPAIGNS)


def of_kernel(kernel: str) -> Callable[..., dict[str, Any]]:
    def run(description: Description, recording: Recording, source: int) -> dict[str, Any]:
        native = product("model.native")
        finger = native.Instance.from_description(description, source)
        try:
            finger.kernel = kernel
        except native.NativeError as refused:
            pytest.skip(f"SKIPPED: no such kernel on this machine ({refused})")
        outputs: dict[str, Any] = finger.run(recording, terms=True)
        return outputs

    return run


@every_campaign
@pytest.mark.parametrize("all_seeds", [False, pytest.param(True, marks=pytest.mark.long)], ids=["some", "all"])
@pytest.mark.parametrize("runner", [*OTHERS, Runner("sse2_kernel", of_kernel("sse2"))], ids=lambda runner: runner.name)
def test_agrees_with_the_oracle(runner: Runner, all_seeds: bool, name: str) -> None:
    campaign = CAMPAIGNS[name]
    seeds = list(campaign.seeds if all_seeds else campaign.some)
    chosen = seeds[:: 5 if runner in SLOW else 1]
    outputs = campaign.outputs[:3] if runner.name == "fmu" else campaign.outputs
    cases = ((seed, *campaign.case(seed), campaign.source(seed), reference(name, seed)) for seed in chosen)
    assert_agreement(runner, cases, *outputs)


@pytest.mark.long
@every_campaign
def test_random_fingers_take_every_branch(name: str) -> None:
    campaign = CAMPAIGNS[name]
    taken: Counter[str] = Counter()
    for seed in campaign.seeds:
        taken += reference(name, seed).branches
    assert not {branch for branch in campaign.branches if taken[branch] < 3}
    assert set().union(*(reference(name, seed).branches for seed in campaign.some)) >= campaign.branches
    if name in ("plain", "detection"):  # a new branch of the oracle must be added here
        assert set(taken) <= campaign.branches | CAMPAIGNS["plain"].branches
    if name == "extensions":
        effects = {row["effect"] for seed in campaign.seeds for row in campaign.case(seed)[0]["extensions"]}
        assert effects == set(MAKE)


@every_campaign
def test_a_restored_state_gives_the_same_bits(name: str) -> None:
    """Saved at any sample, continued elsewhere and again."""
    campaign = CAMPAIGNS[name]
    for seed in campaign.some:
        description, recording = campaign.case(seed)
        samples = len(recording["time"])
        assert_state_continues(description, recording, campaign.source(seed), [1 + (37 * seed) % (samples - 1)])


@every_campaign
def test_kernels_give_the_same_bits(name: str) -> None:
    campaign, native = CAMPAIGNS[name], product("model.native")
    for seed in campaign.some[:5]:
        description, recording = campaign.case(seed)
        found = []
        for kernel in ("plain", "sse2", "avx2"):
            finger = native.Instance.from_description(description, campaign.source(seed))
            try:
                finger.kernel = kernel
            except native.NativeError:  # not on this machine
                continue
            found.append((finger.run(recording, terms=True), finger.save_state()))
        for outputs, state in found[1:]:
            assert state == found[0][1], seed
            for output, series in outputs.items():
                np.testing.assert_array_equal(series, found[0][0][output], err_msg=f"finger {seed}, {output}")


@every_campaign
def test_a_refused_sample_changes_nothing(name: str) -> None:
    campaign, native = CAMPAIGNS[name], product("model.native")
    for seed in campaign.some:
        (description, recording), source = campaign.case(seed), campaign.source(seed)
        whole = native.Instance.from_description(description, source).run(recording)
        at = 1 + (53 * seed) % (len(recording["time"]) - 1)
        head, tail = ({key: x[part] for key, x in recording.items()} for part in (slice(at), slice(at, None)))
        finger = native.Instance.from_description(description, source)
        finger.run(head)
        for broken in ("tendon_force", {1: "tendon_position", 2: "joint_position", 3: "joint_velocity"}[source]):
            wrong = {key: series[:1].copy() for key, series in tail.items()}
            wrong[broken][0, -1] = np.nan
            with pytest.raises(native.NativeError, match=broken):
                finger.run(wrong)
        for output, series in finger.run(tail).items():
            np.testing.assert_array_equal(series, whole[output][at:], err_msg=f"finger {seed}, {output}")


@pytest.mark.parametrize("name", ["detection", "extensions"])
@pytest.mark.parametrize("every", [12, pytest.param(4, marks=pytest.mark.long)])
def test_derivatives_are_those_of_the_oracle(name: str, every: int) -> None:
    """At one sample of a finger: while it rests, stops and leaves, in and out of contact; what is remembered stays."""
    campaign, compared = CAMPAIGNS[name], Counter[str]()
    for seed in campaign.seeds[::every]:
        (description, inputs), source, k = campaign.case(seed), campaign.source(seed), 20 + seed % 7 * 10
        recording = {key: series[: k + 1] for key, series in inputs.items()}
        found, errors = oracle_derivatives.derivatives(description, recording, source, k)
        finger = product("model.native").Instance.from_description(description, source)
        finger.run(recording)
        for given in oracle_derivatives.STEPS:
            for column, unit in enumerate(np.eye(inputs[given].shape[1])):
                slopes = finger.directional_derivative({given: unit})
                for output in oracle_derivatives.OUTPUTS:
                    scale = np.abs(found[output, given]).max() + 1e-6
                    error = errors[output, given][:, column]
                    known = error < 1e-5 * scale  # else there is a kink within the step
                    difference = np.abs(slopes[output] - found[output, given][:, column])
                    assert (difference < 10.0 * error + 1e-6 * scale)[known].all(), (seed, k, output, given, column)
                    compared.update(known=int(known.sum()), all=known.size, not_0=int((slopes[output] != 0.0).sum()))
    assert compared["known"] > 0.95 * compared["all"] and compared["not_0"] > 0.1 * compared["all"], compared


@pytest.mark.parametrize("source", [1, 2, 3])
def test_a_zero_shifts_the_readings_of_its_tendon(source: int) -> None:
    """Angles take the readings less their zeros; with measured angles nothing changes."""
    description, recording = random_case(3)
    zeros = 1e-3 * np.arange(1, len(description["tendons"]) + 1)
    bare = [{key: value for key, value in tendon.items() if key != "zero"} for tendon in description["tendons"]]
    moved = [tendon | {"zero": zero} for tendon, zero in zip(bare, zeros, strict=True)]
    shifted = recording | {"tendon_position": recording["tendon_position"] + zeros}
    as_is = NATIVE(description | {"tendons": bare}, recording, source)
    out = NATIVE(description | {"tendons": moved}, shifted, source)
    for output, values in as_is.items():
        np.testing.assert_allclose(out[output], values, rtol=0.0, atol=1e-7 * max(1.0, np.abs(values).max()))
