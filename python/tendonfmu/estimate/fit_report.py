"""The report of a fit, "tendonfmu-fit-1": all results as JSON, with null for what is not a number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.evaluation import Evaluation, residual_entry
from tendonfmu.estimate.files import FIT_REPORT
from tendonfmu.estimate.learning import Learned, unknown_names
from tendonfmu.estimate.verdicts import Fitted
from tendonfmu.files import counted, finite
from tendonfmu.model import Finger, native
from tendonfmu.recordings import consistency, whiteness
from tendonfmu.statistics import effective_samples

LEAST_NIS, MOST_NIS, MOST_LAG_ONE = 0.5, 2.0, 0.3  # values outside give a warning
_MORE_PASSES = ": allow more (--passes), or estimate fewer numbers (--only, --fix, --share)"


def build_report(
    *,
    fitted: Finger,
    learned: Learned,
    seconds: float,  # time of the estimation (s)
    options: Mapping[str, Any],  # options that shape the result, and `method`
    warnings: Sequence[str],
    numbers: Sequence[Fitted],
    routing: Mapping[str, Any] | None,  # what was learned of it; None if not asked for
    movement: Mapping[str, Any],  # what became of the given numbers
    innovations: Sequence[Numbers],  # by recording, [N, n] standardised; NaN where not trained on
    training: Sequence[Evaluation],
    comparisons: Sequence[Evaluation],
    memory: Mapping[str, Any] | None,  # how friction that remembers was fitted; None if there is none
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
        "routing": routing,
        "given_numbers": dict(movement),
        "identified": {"count": sum(number.identified for number in numbers), "of": len(numbers)},
        "residual": {
            "train": residual_entry(training, "train"),
            "held_out": residual_entry(training, "held_out"),
            "comparisons": [_comparison(evaluation) for evaluation in comparisons],
        },
        "innovations": _innovations(innovations, learned.weights),
        "memory": memory,
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
    return {"label": recording.path.stem, **recording.entry(), **(residual_entry([evaluation], "train") or {})}


def _correlation(covariance: Numbers) -> list[list[float]]:
    error = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    matrix = covariance / np.outer(error, error)
    return [[float(f"{value:.4g}") for value in row] for row in matrix.tolist()]


# --- in words --------------------------------------------------------------------------------------------------------


def fit_sentences(learned: Learned, numbers: Sequence[Fitted]) -> list[str]:
    """Return the warnings of the estimation, and the numbers that ended at a bound."""
    more = "" if learned.converged else _MORE_PASSES
    sentences = [f"{sentence}{more}" for sentence in learned.warnings]
    at_bound = [number for number in numbers if number.at_bound]
    if at_bound:
        some = ", ".join(number.number.path for number in at_bound[:3])
        more = f" and {len(at_bound) - 3} more" if len(at_bound) > 3 else ""
        sentences.append(f"{counted(len(at_bound), 'number')} ended at a bound: {some}{more}")
    return sentences


def noise_sentences(innovations: Mapping[str, Any]) -> list[str]:
    """Warn if the residuals contradict the noise settings, since the standard errors depend on these."""
    nis, lag_one = innovations["nis"]["mean"], innovations["whiteness"]["lag_one"]
    sentences = []
    times = "-" if nis is None else f"{nis:.2g}" if nis < 100 else f"{nis:.0f}"
    if nis is not None and not LEAST_NIS <= nis <= MOST_NIS:
        sentences.append(
            f"the residuals' variance is {times} times that of bias.noise_std, noise_std_per_force, noise_time and "
            "drift_variance: standard errors follow these settings, not the data"
        )
    far = max((abs(value) for value in lag_one if value is not None), default=0.0)
    if far > MOST_LAG_ONE:
        samples, worth = (sum(innovations["effective"][key]) for key in ("samples", "worth"))
        count = f"{samples:.0f} samples count as {worth:.0f}" if worth < samples else "each sample counts as new"
        sentences.append(
            f"residuals are not white (autocorrelation {far:.2f} from one sample to the next): the model lacks an "
            f"effect, or the noise is correlated; {count}, treat the standard errors with caution"
        )
    return sentences
