"""The agreement rule of docs/reference/semantics/README.md#agreement.

Two implementations agree when, sample by sample and for every output, the difference is at most
1e-9 * (largest value of that output's series) + 1e-12; for `compensated_torque[j]` the largest value is
that of `joint_torque[j]` and `friction_torque[j]`. Booleans must be equal. The rule lets samples within 1e-9 of a
threshold be left out. No test needs that: with the seeds here, all samples are compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

RELATIVE, ABSOLUTE = 1e-9, 1e-12
REAL_OUTPUTS = (
    "compensated_torque",
    "joint_torque",
    "friction_torque",
    "bias_torque",
    "joint_angle",
    "joint_speed",
)
# of docs/reference/semantics/outputs.md; contact_terms are not the FMU's, so what a candidate has of them is compared
DETECTION_OUTPUTS = (
    "compensated_torque_std",
    "residual",
    "contact_level",
    "contact_terms",
)
BOOLEAN_OUTPUTS = ("joint_contact", "contact", "slack")
OPTIONAL_FLAGS = ("contact_observable", "sensor_fault")  # with sensor_fault


@dataclass
class Agreement:
    """What a comparison found. first: (sample, output, column, reference, candidate) of the first disagreement."""

    samples: int
    worst: float  # largest difference in units of the tolerance
    first: tuple[int, str, int, float, float] | None = None

    @property
    def agrees(self) -> bool:
        return self.first is None

    def __str__(self) -> str:
        if self.first is None:
            return f"agrees: {self.samples} samples, worst {self.worst:.3g} of tolerance"
        k, name, column, expected, got = self.first
        return f"{name}[{column + 1}] at sample {k} (from 0): expected {expected!r}, got {got!r}"


def tolerance(reference: Mapping[str, Array], name: str) -> Array:
    """Allowed difference of one output, one number per column."""
    names = ("joint_torque", "friction_torque") if name == "compensated_torque" else (name,)
    largest = np.max([np.abs(reference[each]).max(axis=0) for each in names], axis=0)
    return np.asarray(RELATIVE * largest + ABSOLUTE)


def excess(reference: Mapping[str, Array], candidate: Mapping[str, Array]) -> dict[str, Array]:
    """Per output: |difference| / tolerance, [N, columns]; infinite for NaN and unequal Booleans."""
    ratios = {}
    optional = tuple(name for name in DETECTION_OUTPUTS if name in candidate and name in reference)
    flags = BOOLEAN_OUTPUTS + tuple(name for name in OPTIONAL_FLAGS if name in candidate and name in reference)
    for name in REAL_OUTPUTS + optional + flags:
        expected, got = np.asarray(reference[name]), np.asarray(candidate[name])
        if expected.ndim < 2:
            expected, got = expected.reshape(-1, 1), got.reshape(-1, 1)
        if expected.shape != got.shape:
            raise AssertionError(f"{name}: expected shape {expected.shape}, got {got.shape}")
        expected, got = expected.reshape(len(expected), -1), got.reshape(len(got), -1)
        if name in flags:
            ratios[name] = np.where(expected.astype(bool) == got.astype(bool), 0.0, np.inf)
        else:
            ratio = np.abs(got - expected) / tolerance(reference, name).reshape(-1)
            ratios[name] = np.where(np.isnan(ratio), np.inf, ratio)
    return ratios


def compare(reference: Mapping[str, Array], candidate: Mapping[str, Array]) -> Agreement:
    """Compares all outputs."""
    ratios = excess(reference, candidate)
    disagrees = np.stack([(ratio > 1.0).any(axis=1) for ratio in ratios.values()]).any(axis=0)
    result = Agreement(len(disagrees), max(float(ratio.max(initial=0.0)) for ratio in ratios.values()))
    if disagrees.any():
        k = int(np.argmax(disagrees))
        name = next(name for name, ratio in ratios.items() if (ratio[k] > 1.0).any())
        column = int(np.argmax(ratios[name][k]))
        expected, got = (float(np.ravel(np.asarray(series[name])[k])[column]) for series in (reference, candidate))
        result.first = (k, name, column, expected, got)
    return result
