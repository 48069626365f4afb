"""The report of a fit, "tendonfmu-fit-1": all results as JSON, with null for what is not a number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.evaluation import Evaluation, residual_entry
from tendonfmu.estimate.files import FIT_REPORT
from tendonfmu.estimate.methods import Learned, unknown_names
from tendonfmu.estimate.verdicts import Fitted
from tendonfmu.files import finite
from tendonfmu.model import Finger, native
from tendonfmu.recordings import consistency, whiteness
from tendonfmu.statistics import effective_samples


def build_report(
    *,
    fitted: Finger,
    learned: Learned,
    seconds: float,  # time of the estimation (s)
    options: Mapping[str, Any],  # options that shape the result, and `method`
    warnings: Sequence[str],
    numbers: Sequence[Fitted],
    innovations: Sequence[Numbers],  # by recording, [N, n] standardised; NaN where not trained on
    training: Sequence[Evaluation],
    comparisons: Sequence[Evaluation],
    uncertainty: Mapping[str, Any] | None,  # of the modelled friction torque; None if not asked for
) -> dict[str, Any]:
    """Build the report of a finished fit; numbers that are not finite become None."""
    units = {parameter.path: parameter.unit for parameter in native.Instance(fitted.image).parameters()}
    report = {
        "format": FIT_REPORT,
        "finger": fitted.name,
        "method": options["method"],
        "converged": learned.converged,
        "finished": True,
        "iterations": learned.iterations,
        "passes": learned.passes,
        "seconds": seconds,
        "cost": learned.cost,
        "options": dict(options),
        "warnings": list(warnings),
        "recordings": [evaluation.recording.entry() for evaluation in training],
        "parameters": [_parameter(number, units) for number in numbers],
        "correlation": {
            "paths": unknown_names(learned.estimator),
            "standard_errors": np.sqrt(np.maximum(np.diag(learned.covariance), 0.0)).tolist(),
            "matrix": _correlation(learned.covariance),
        },
        "identified": {"count": sum(number.identified for number in numbers), "of": len(numbers)},
        "residual": {
            "train": residual_entry(training, "train"),
            "held_out": residual_entry(training, "held_out"),
            "comparisons": [_comparison(evaluation) for evaluation in comparisons],
        },
        "innovations": _innovations(innovations, learned.weights),
        "uncertainty": uncertainty,
    }
    return {key: finite(value) for key, value in report.items()}


def _parameter(number: Fitted, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "path": number.number.path,
        "unit": units[number.number.path],
        "start": number.start,
        "value": number.value,
        "standard_error": number.standard_error,
        "identified": number.identified,
        "at_bound": number.at_bound,
        "reason": number.cause or None,
        "explanation": number.reason or None,
        "advice": number.advice or None,
    }


def _innovations(innovations: Sequence[Numbers], weights: Sequence[Numbers]) -> dict[str, Any]:
    """Describe the residuals of the samples trained on, and how many independent samples they are worth."""
    samples, worth = effective_samples(innovations, weights)
    share = float(worth.sum() / samples.sum()) if samples.sum() else 1.0
    return {
        "nis": consistency(innovations, share),
        "whiteness": whiteness(innovations),
        "effective": {"samples": samples.tolist(), "worth": worth.tolist()},
    }


def _comparison(evaluation: Evaluation) -> dict[str, Any]:
    recording = evaluation.recording
    return {"label": recording.path.stem, **recording.entry(), **(residual_entry([evaluation], "tracked") or {})}


def _correlation(covariance: Numbers) -> list[list[float]]:
    error = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    matrix = covariance / np.outer(error, error)
    return [[float(f"{value:.4g}") for value in row] for row in matrix.tolist()]
