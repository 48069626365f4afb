"""The numbers of a description fitted for a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tendonfmu.diagnose.extension_fit import FitSettings, FittedModel, fit_numbers
from tendonfmu.estimate import unknowns
from tendonfmu.recordings import FitRecording


def fitted(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    settings: FitSettings,
    *,
    given: Mapping[str, Any] | None = None,
) -> FittedModel:
    """As `extension_fit.fit_numbers`; a description without a number to estimate stays as it is."""
    if not unknowns(data):
        return FittedModel(data=data, given=data, values={}, errors={}, cost=float("nan"))
    return fit_numbers(data, recordings, settings, given=given)
