"""What every candidate would add to the model's torque, at every place and every point of its grid.

The signal is G_k = T_k + Σ Δb up to k: T of eq. (10) with all jumps of fig. 5 so far, averaged over blocks of time. A
candidate's column is the derivative of G by its number at a strength of zero, or the difference that its term makes to
G. The C core computes all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.derivative_passes import nominal_directions, plan_passes, run_pass
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place, Variant
from tendonfmu.diagnosis.series import block_late_forces, block_prediction
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.errors import InputError
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import SampleBlocks

Single = NDArray[np.float32]
Worth = Callable[[Candidate, Place, Mapping[str, float]], bool]

_LARGEST = 1e9  # largest non-linear number in any unit: docs/reference/semantics.md#extensions
_MOST_MEMORY = 8.0  # GB, for all columns


@dataclass(frozen=True)
class Proposal:
    """A candidate at a place and one point of its grid."""

    candidate: Candidate
    place: Place
    variant: Variant
    columns: slice  # where its columns are in `CandidateColumns.values`


@dataclass(frozen=True)
class CandidateColumns:
    """Block means of the prediction and of all columns."""

    prediction: Numbers  # G of the description, N·m [B, n]
    nominal: Single  # derivatives of G by the numbers that a fit of the description estimates [B, n, u]
    values: Single  # columns of the candidates [B, n, c]
    proposals: tuple[Proposal, ...]  # which columns belong to which candidate, place and shape


def candidate_columns(
    data: Data,
    recordings: Sequence[FitRecording],
    blocks: SampleBlocks,
    *,
    candidates: Sequence[Candidate] = CANDIDATES,
    span: Span | None = None,
    worth: Worth | None = None,
) -> CandidateColumns:
    """Compute the columns of the description and of all candidates that it lacks."""
    plain, span = without_uncertainty(data), span or span_of(data, recordings)
    _, nominal = nominal_directions(plain)
    joints, u = len(data["joints"]), len(nominal)
    proposals = tuple(_proposed(plain, recordings[0].kinematics, span, candidates, worth))
    count = u + (proposals[-1].columns.stop if proposals else 0)
    _refuse_too_many(blocks.count * joints * count * 4 / 1e9, count)
    values = np.zeros((blocks.count, joints, count), dtype=np.float32)
    placed = [(proposal.variant, u + proposal.columns.start) for proposal in proposals]
    passes = plan_passes(plain, [entry for entry in placed if not entry[0].secant_rows])
    passes[0].columns[:0] = enumerate(nominal)
    for terms in passes:
        if terms.columns:
            run_pass(terms.data(), terms.columns, recordings, blocks, values)
    values /= np.maximum(blocks.sizes(), 1)[:, None, None].astype(np.float32)
    prediction = block_prediction(plain, recordings, blocks)
    for bundle in _bundles([entry for entry in placed if entry[0].secant_rows]):
        first = bundle[0][0]
        if first.late:
            change = block_late_forces(plain, recordings, blocks, first.late, prediction)
        else:
            together = first.with_secants([variant for variant, _ in bundle])
            change = block_prediction(together, recordings, blocks) - prediction
        for variant, at in bundle:
            own = slice(None) if variant.only_joint is None else variant.only_joint - 1
            values[:, own, at] = change[:, own]
    return CandidateColumns(prediction, values[:, :, :u], values[:, :, u:], proposals)


def _refuse_too_many(size: float, columns: int) -> None:
    if size > _MOST_MEMORY:
        raise InputError(
            f"{columns} columns of candidate causes need {size:.0f} GB; expected at most {_MOST_MEMORY:g} GB: use "
            "a finger of fewer joints and tendons at a time, or shorter recordings"
        )


def without_uncertainty(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description without directions of uncertainty and without sensor monitoring."""
    contact = {key: value for key, value in data["contact"].items() if not key.startswith("uncertainty")}
    return {**data, "contact": contact, "sensor_fault": None}


def _proposed(
    data: Mapping[str, Any], kinematics: int, span: Span, candidates: Sequence[Candidate], worth: Worth | None
) -> Iterator[Proposal]:
    first = 0
    for candidate in candidates:
        for place in candidate.places(data, kinematics):
            for variant in candidate.variants(data, place, span):
                if _is_sane(variant) and (worth is None or worth(candidate, place, variant.shape)):
                    yield Proposal(candidate, place, variant, slice(first, first + variant.count))
                    first += variant.count


def _is_sane(variant: Variant) -> bool:
    """Return whether a description accepts the variant's numbers; recordings of another scale can lead to any value."""
    return all(abs(value) <= _LARGEST for value in variant.shape.values())


def _bundles(secants: Sequence[tuple[Variant, int]]) -> list[list[tuple[Variant, int]]]:
    """Group the variants that share a run: each of their terms changes the torque of a different joint alone."""
    bundles: list[list[tuple[Variant, int]]] = []
    for variant, at in secants:
        own = variant.only_joint
        for bundle in bundles if own is not None else []:
            joints = {other.only_joint for other, _ in bundle}
            if None not in joints and own not in joints:
                bundle.append((variant, at))
                break
        else:
            bundles.append([(variant, at)])
    return bundles
