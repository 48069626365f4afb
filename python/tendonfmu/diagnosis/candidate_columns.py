"""What every candidate would add to the model's torque, at every place and every point of its grid.

A column is the difference that a candidate's term of ordinary size makes between two runs of the core, around the
fitted description: where friction has a memory, a change of its limit changes all that follows. The columns of the
description's own numbers are differences, too. All are averaged over blocks of time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place, Variant
from tendonfmu.diagnosis.samples import Samples, with_late_forces
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.errors import TooLargeError

Single = NDArray[np.float32]
Worth = Callable[[Candidate, Place, Mapping[str, float]], bool]

_LARGEST = 1e9  # largest non-linear number in any unit: docs/reference/semantics/effects.md
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
    """Block means of all columns."""

    values: Single  # columns of the candidates, per unit of their magnitudes [B, n, c]
    proposals: tuple[Proposal, ...]  # which columns belong to which candidate, place and shape


def candidate_columns(
    data: Data,
    samples: Samples,
    *,
    candidates: Sequence[Candidate] = CANDIDATES,
    span: Span | None = None,
    worth: Worth | None = None,
) -> CandidateColumns:
    """Compute the columns of all candidates that a description lacks."""
    span = span or span_of(data, samples.recordings)
    proposals = tuple(_proposed(data, samples.recordings[0].kinematics, span, candidates, worth))
    count = proposals[-1].columns.stop if proposals else 0
    joints, blocks = len(data["joints"]), samples.grid.blocks
    _refuse_too_many(blocks * joints * count * 4 / 1e9, count)
    values = np.zeros((blocks, joints, count), dtype=np.float32)
    base = samples.left(data)
    for proposal in proposals:
        for k, column in enumerate(_columns(proposal.variant, data, samples, base), start=proposal.columns.start):
            values[:, :, k] = column
    return CandidateColumns(values, proposals)


def _columns(variant: Variant, data: Data, samples: Samples, base: Numbers) -> Iterator[Numbers]:
    """Yield the columns of a variant [B, n]; `base` is what the description leaves [B, n], N·m."""
    if variant.late:
        late = samples.of_recordings(data, with_late_forces(samples.recordings, variant.late))
        yield late.left(data) - base
    elif variant.secant is not None:
        yield base - samples.left(variant.secant)
    else:
        for k, size in enumerate(variant.expected):
            magnitudes = [0.0] * variant.count
            magnitudes[k] = size
            yield (base - samples.left(variant.at(magnitudes))) / size


def _refuse_too_many(size: float, columns: int) -> None:
    if size > _MOST_MEMORY:
        raise TooLargeError(
            f"{columns} columns of candidate causes need {size:.0f} GB; expected at most {_MOST_MEMORY:g} GB: use "
            "a finger of fewer joints and tendons at a time, or shorter recordings"
        )


def _proposed(
    data: Data, kinematics: int, span: Span, candidates: Sequence[Candidate], worth: Worth | None
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
