"""A previous calibration as the prior of a fit: its numbers, their errors, and their expected change.

The prior of unknown k is a Gaussian about its previous value with covariance C + D. C is that of the previous fit, if
its report has it. D is diagonal, (change · size)², for the change by wear, temperature or another instrument of the
type since then. A previous description without a report has no C: its numbers count as known to within D.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.fit_report import FORMAT
from tendonfmu.estimate.structure import described, estimable_numbers, own_copy, set_number
from tendonfmu.files import read_json
from tendonfmu.model import Finger, read_finger

CHANGE = 0.02  # relative; docs/evidence/recalibration.md shows the effect of larger and smaller values
_LEAST = 1e-3  # of an unknown's expected magnitude: lets an unknown that ended at 0 leave it


@dataclass(frozen=True)
class PreviousFit:
    """Numbers of a previous fit."""

    path: Path  # file of the report or of the description
    values: Mapping[str, float]  # numbers of the description by path (SI)
    names: Sequence[str]  # [k] unknowns with a known covariance; empty if the previous fit did not state it
    covariance: Numbers  # [k, k] of these unknowns
    share: float  # effective samples per sample of its residuals, the least of all joints; 1 if unknown


def read_previous_fit(path: Path) -> PreviousFit:
    """Read the report of a fit ("tendonfmu-fit-1"), or the description that a fit wrote."""
    content = read_json(path, "a previous fit: its report, or the description that it wrote")
    if isinstance(content, dict) and content.get("format") == FORMAT:
        return _of_report(path, content)
    finger = read_finger(path)
    values = {number.path: number.value for number in estimable_numbers(finger.data)}
    return PreviousFit(path, values, (), np.zeros((0, 0)), 1.0)


def _of_report(path: Path, report: Mapping[str, Any]) -> PreviousFit:
    try:
        values = {entry["path"]: float(entry["value"]) for entry in report["parameters"]}
        correlation = report["correlation"]
        errors = correlation.get("standard_errors")
        names = correlation["paths"] if errors is not None else []
        error = np.array(errors if errors is not None else [], dtype=np.float64)
        matrix = np.array(correlation["matrix"], dtype=np.float64) if len(names) else np.zeros((0, 0))
        worth = report["innovations"].get("effective") or {"samples": [1.0], "worth": [1.0]}
        share = float(np.min(np.array(worth["worth"], dtype=float) / np.array(worth["samples"], dtype=float)))
        covariance = matrix * np.outer(error, error)
        sound = covariance.shape == (len(names), len(names)) and bool(np.isfinite(covariance).all())
    except (KeyError, TypeError, ValueError, AttributeError) as wrong:
        raise InputError(
            f"{path}: {wrong}: expected a whole report of tendonfmu fit, with parameters, correlation and innovations"
        ) from None
    if not (sound and 0 < share <= 1):
        raise InputError(f"{path}: correlation, innovations.effective: expected a finite number for each unknown")
    return PreviousFit(path, values, list(names), covariance, share)


def with_previous_values(finger: Finger, previous: PreviousFit) -> Finger:
    """Return the finger with the previous values of all numbers that both have."""
    numbers = [number for number in estimable_numbers(finger.data) if number.path in previous.values]
    if not numbers:
        raise InputError(
            f"{previous.path}: none of its {len(previous.values)} numbers is one of {finger.path}; expected the report "
            "or the description of an earlier fit of the same finger"
        )
    data = own_copy(finger.data)
    for number in numbers:
        for path in (number.path, number.with_path):
            if path is not None:
                set_number(data, path, previous.values[number.path])
    return described(finger, data)


def known_information(
    estimator: Estimator, names: Sequence[str], previous: PreviousFit, change: float, prior: float, noise: float
) -> Numbers:
    """Compute [u, u] the information of the prior about the previous values, which are the estimator's start."""
    # `names` are those of the u unknowns, `change` the relative standard deviation of what may have changed since.
    start, scale = estimator.start, estimator.scale
    size = np.maximum(np.abs(start), _LEAST * scale)
    is_bias = np.array([name.startswith("bias.") for name in names], dtype=bool)
    size[is_bias] = np.maximum(size[is_bias], noise)
    has = np.array([_has(previous, unknown) for unknown in estimator.unknowns], dtype=bool)
    variance = np.where(has, change * size, prior * scale) ** 2
    place = {name: k for k, name in enumerate(previous.names)}
    both = [k for k, name in enumerate(names) if name in place and has[k]]
    before = [place[names[k]] for k in both]
    covariance = np.diag(variance)
    covariance[np.ix_(both, both)] += previous.covariance[np.ix_(before, before)]
    return _inverse(covariance)


def _has(previous: PreviousFit, unknown: Any) -> bool:
    return unknown.path in previous.values


def _inverse(covariance: Numbers) -> Numbers:
    """Invert a covariance with rounded correlations; no direction counts as known better than by a relative 1e-6."""
    root = np.sqrt(np.diag(covariance))
    value, turn = np.linalg.eigh(covariance / np.outer(root, root))
    turned = turn / root[:, None]
    return np.asarray((turned / np.maximum(value, 1e-6)) @ turned.T)
