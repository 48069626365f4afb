"""Which values the numbers of a description take when a diagnosis fits them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tendonfmu.diagnosis.extension_fit import FitSettings, FittedModel, fit_numbers
from tendonfmu.estimate import unknowns
from tendonfmu.recordings import FitRecording


def fitted(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    settings: FitSettings,
    *,
    given: Mapping[str, Any] | None = None,
) -> FittedModel:
    """Fit a description as `extension_fit.fit_numbers` does; return it unchanged if it has no number to estimate."""
    if not unknowns(data):
        return FittedModel(data=data, given=data, values={}, errors={}, cost=float("nan"))
    return fit_numbers(data, recordings, settings, given=given)
