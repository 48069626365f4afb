"""The agreement rule of docs/reference/semantics.md#agreement, taken literally.

Two implementations agree when, sample by sample and for every output, the difference is at most
1e-9 * (largest value of that output's series) + 1e-12; for `compensated_torque[j]` the largest value is
that of `joint_torque[j]` and `friction_torque[j]`. Booleans must be equal. Samples within 1e-9 of a
threshold may be left out, at most 1 in 10,000, and are counted.

A decision taken the other way at such a sample changes what is remembered, so later samples would differ
although nothing is wrong. `agree_with_oracle` therefore runs the oracle again with exactly that decision
taken as the candidate took it, leaves the sample itself out (and counts it), and goes on comparing every
later sample against the new series. Leaving out is a permission: a near sample that agrees is compared.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import oracle

Array = NDArray[Any]

RELATIVE, ABSOLUTE = 1e-9, 1e-12
LEFT_OUT_SHARE = 1e-4
REAL_OUTPUTS = (
    "compensated_torque",
    "joint_torque",
    "friction_torque",
    "bias_torque",
    "joint_angle",
    "joint_speed",
)
# of docs/reference/semantics.md#outputs; the FMU gives the first alone, so what a candidate has of them is compared
DETECTION_OUTPUTS = (
    "compensated_torque_std",
    "residual",
    "innovation",
    "stuck_friction",
    "friction_jump",
    "drift",
    "friction_parts",
)
REST_OUTPUTS = ("contact_change",)  # with contact.rest, also of the FMU
BOOLEAN_OUTPUTS = ("joint_contact", "contact", "slack")
OPTIONAL_FLAGS = ("contact_at_rest", "contact_observable", "sensor_fault")  # with contact.rest, sensor_fault
FLIPS_TRIED_TOGETHER = 6  # more near decisions in one sample are tried one by one
MOST_FOLLOWED = 10  # more near decisions in one recording than any rule allows: give up
NEAR_SAMPLES_TRIED = 3  # how many near samples before a difference may explain it


@dataclass
class Agreement:
    """What a comparison found.

    first: (sample, output, column, reference, candidate) of the first disagreement, or None.
    left_out: samples left out; samples: how many there were. worst: largest difference among compared
    samples in units of the tolerance.
    """

    samples: int
    first: tuple[int, str, int, float, float] | None = None
    left_out: list[int] = field(default_factory=list)
    worst: float = 0.0

    @property
    def agrees(self) -> bool:
        return self.first is None

    def __str__(self) -> str:
        if self.first is None:
            return f"agrees: {self.samples} samples, {len(self.left_out)} left out, worst {self.worst:.3g} of tolerance"
        k, name, column, expected, got = self.first
        return f"{name}[{column + 1}] at sample {k} (from 0): expected {expected!r}, got {got!r}"


def tolerance(reference: Mapping[str, Array], name: str) -> Array:
    """Allowed difference of one output, one number per column."""
    names = ("joint_torque", "friction_torque") if name == "compensated_torque" else (name,)
    largest = np.max([np.abs(reference[each]).max(axis=0) for each in names], axis=0)
    return np.asarray(RELATIVE * largest + ABSOLUTE)


def excess(reference: Mapping[str, Array], candidate: Mapping[str, Array]) -> dict[str, Array]:
    """Per output: |difference| / tolerance, [N, columns]; infinite for NaN and unequal Booleans."""
    found = {}
    optional = tuple(name for name in DETECTION_OUTPUTS + REST_OUTPUTS if name in candidate and name in reference)
    flags = BOOLEAN_OUTPUTS + tuple(name for name in OPTIONAL_FLAGS if name in candidate and name in reference)
    for name in REAL_OUTPUTS + optional + flags:
        expected, got = np.asarray(reference[name]), np.asarray(candidate[name])
        if expected.ndim < 2:
            expected, got = expected.reshape(-1, 1), got.reshape(-1, 1)
        if expected.shape != got.shape:
            raise AssertionError(f"{name}: expected shape {expected.shape}, got {got.shape}")
        expected, got = expected.reshape(len(expected), -1), got.reshape(len(got), -1)
        if name in flags:
            found[name] = np.where(expected.astype(bool) == got.astype(bool), 0.0, np.inf)
        else:
            ratio = np.abs(got - expected) / tolerance(reference, name).reshape(-1)
            found[name] = np.where(np.isnan(ratio), np.inf, ratio)
    return found


def compare(
    reference: Mapping[str, Array], candidate: Mapping[str, Array], may_leave_out: Array | None = None
) -> Agreement:
    """Compares all outputs. may_leave_out: [N] bool, samples that need not agree (counted if they do not)."""
    ratios = excess(reference, candidate)
    samples = len(next(iter(ratios.values())))
    result = Agreement(samples)
    allowed = np.zeros(samples, dtype=bool) if may_leave_out is None else np.asarray(may_leave_out)
    disagrees = np.zeros(samples, dtype=bool)
    for ratio in ratios.values():
        disagrees |= (ratio > 1.0).any(axis=1)
    result.left_out = np.flatnonzero(disagrees & allowed).tolist()
    compared = ~(disagrees & allowed)
    result.worst = max(float(ratio[compared].max(initial=0.0)) for ratio in ratios.values())
    wrong = np.flatnonzero(disagrees & ~allowed)
    if wrong.size:
        k = int(wrong[0])
        name = next(name for name, ratio in ratios.items() if (ratio[k] > 1.0).any())
        column = int(np.argmax(ratios[name][k]))
        values = [np.ravel(np.asarray(series[name])[k])[column] for series in (reference, candidate)]
        result.first = (k, name, column, float(values[0]), float(values[1]))
    return result


def flips_of(alternatives: Mapping[tuple[Any, ...], list[Any]], k: int) -> list[dict[tuple[Any, ...], Any]]:
    """Ways to take the near decisions of sample k differently, fewest changes first."""
    keys = list(alternatives)
    most = len(keys) if len(keys) <= FLIPS_TRIED_TOGETHER else 1
    flips = []
    for count in range(1, most + 1):
        for chosen in itertools.combinations(keys, count):
            for values in itertools.product(*(alternatives[key] for key in chosen)):
                flips.append({(k, *key): value for key, value in zip(chosen, values, strict=True)})
    return flips


def agree_with_oracle(
    description: Mapping[str, Any],
    recording: Mapping[str, Array],
    kinematics_source: int,
    candidate: Mapping[str, Array],
    reference: oracle.Result | None = None,
) -> Agreement:
    """Compares a run of another implementation with the oracle, following it through near decisions."""
    result = oracle.run(description, recording, kinematics_source) if reference is None else reference
    forced: dict[tuple[Any, ...], Any] = {}
    left_out = np.zeros(len(recording["time"]), dtype=bool)
    while True:
        found = compare(result.outputs, candidate, left_out)
        if found.first is None:
            found.left_out = np.flatnonzero(left_out).tolist()
            return found
        if left_out.sum() == MOST_FOLLOWED:
            return found
        followed = _follow(description, recording, kinematics_source, candidate, result, forced, left_out, found)
        if followed is None:
            return found
        result, forced, left_out = followed


def _follow(
    description: Mapping[str, Any],
    recording: Mapping[str, Array],
    kinematics_source: int,
    candidate: Mapping[str, Array],
    result: oracle.Result,
    forced: dict[tuple[Any, ...], Any],
    left_out: Array,
    found: Agreement,
) -> tuple[oracle.Result, dict[tuple[Any, ...], Any], Array] | None:
    """Looks for near decisions at or shortly before the disagreement that explain it."""
    assert found.first is not None
    at = found.first[0]
    near = [k for k in sorted(result.alternatives) if k <= at and not left_out[k]]
    for k in reversed(near[-NEAR_SAMPLES_TRIED:]):
        without_k = left_out.copy()
        without_k[k] = True
        for flip in flips_of(result.alternatives[k], k):
            trial = oracle.run(description, recording, kinematics_source, forced | flip)
            after = compare(trial.outputs, candidate, without_k)
            if after.first is None or after.first[0] > at:
                return trial, forced | flip, without_k
    return None


def few_left_out(results: list[Agreement]) -> bool:
    """At most 1 sample in 10,000 left out over all comparisons."""
    left_out = sum(len(each.left_out) for each in results)
    return left_out <= LEFT_OUT_SHARE * sum(each.samples for each in results)
