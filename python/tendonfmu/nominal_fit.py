"""The numbers of a description fitted for a diagnosis: without noise in the forces, and with what rest keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.diagnosis_series import exact_model
from tendonfmu.extension_fit import FitSettings, FittedModel, fit_numbers
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.identifiability import unknowns

ROUNDS = 2  # of fits where what the estimation leaves out is taken into the target


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
    model = fit_numbers(data, rest_corrected(data, recordings), settings, given=given)
    if keeps_entry_load(data):
        for _ in range(ROUNDS - 1):
            model = fit_numbers(model.data, rest_corrected(model.data, recordings), settings, given=given or data)
    return model


def keeps_entry_load(data: Mapping[str, Any]) -> bool:
    """Whether leaving stiction takes out what entering it put in, which the estimation does not know."""
    return bool((data.get("bias") or {}).get("entry_load"))


def rest_corrected(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> list[FitRecording]:
    """The recordings with targets that a model without `bias.entry_load` explains as the one with it does theirs."""
    if not keeps_entry_load(data):
        return list(recordings)
    found = []
    for recording in recordings:
        change = exact_model(data, recording, entry_load=False) - exact_model(data, recording)
        found.append(replace(recording, target=recording.target + np.nan_to_num(change)))
    return found
