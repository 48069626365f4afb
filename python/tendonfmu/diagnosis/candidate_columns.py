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

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.block_runs import block_late_forces, block_prediction
from tendonfmu.diagnosis.derivative_passes import Direction, nominal_directions, plan_passes, run_pass
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place, Variant
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.errors import InputError
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import SampleBlocks

Single = NDArray[np.float32]
Progress = Callable[[int, int], None]
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
    nominal_names: list[str]  # names [u]; a law's numbers are coulomb, drop, rate (1/Stribeck velocity) and viscous
    values: Single  # columns of the candidates [B, n, c]
    names: list[str]  # names [c]
    proposals: tuple[Proposal, ...]  # which columns belong to which candidate, place and shape


def candidate_columns(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    blocks: SampleBlocks,
    *,
    candidates: Sequence[Candidate] = CANDIDATES,
    span: Span | None = None,
    worth: Worth | None = None,
    progress: Progress | None = None,
) -> CandidateColumns:
    """Compute the columns of the description and of all candidates that it lacks."""
    plain = without_uncertainty(data)
    names, nominal = nominal_directions(plain)
    joints, u = len(data["joints"]), len(names)
    proposals = list(
        _proposed(
            plain, recordings[0].kinematics, span_of(plain, recordings) if span is None else span, candidates, worth
        )
    )
    count = u + (proposals[-1].columns.stop if proposals else 0)
    _refuse_too_many(blocks.count * joints * count * 4 / 1e9, count)
    work = _Work(plain, recordings, blocks, np.zeros((blocks.count, joints, count), dtype=np.float32), progress)
    work.plan(nominal, [(proposal.variant, u + proposal.columns.start) for proposal in proposals])
    prediction = work.run()
    labels = [label for proposal in proposals for label in _labels(proposal)]
    return CandidateColumns(prediction, work.values[:, :, :u], names, work.values[:, :, u:], labels, tuple(proposals))


class _Work:
    """All runs of the core: passes of derivatives, and terms at full strength; `values` [B, n, u + c] is filled."""

    def __init__(
        self,
        data: Mapping[str, Any],
        recordings: Sequence[FitRecording],
        blocks: SampleBlocks,
        values: Single,
        progress: Progress | None,
    ) -> None:
        self._data, self._recordings, self._blocks = data, recordings, blocks
        self.values, self._progress = values, progress
        self._samples = sum(part.stop - part.start for recording in recordings for part in recording.parts)
        self._done = 0

    def plan(self, nominal: Sequence[Direction], variants: Sequence[tuple[Variant, int]]) -> None:
        """Plan the runs for the nominal directions, which are the first columns, and for the variants."""
        exact = []
        for variant, at in variants:
            if not variant.secant_rows:
                exact.append((variant, at))
        self._passes = plan_passes(self._data, exact)
        for at, direction in reversed(list(enumerate(nominal))):
            self._passes[0].columns.insert(0, (at, direction))
        self._passes = [pass_ for pass_ in self._passes if pass_.columns]
        self._bundles = _bundles([(variant, at) for variant, at in variants if variant.secant_rows])
        self._total = self._samples * (len(self._passes) + len(self._bundles) + 1)

    def run(self) -> Numbers:
        """Fill the values; return G of the description."""
        for pass_ in self._passes:
            run_pass(pass_.data(), pass_.columns, self._recordings, self._blocks, self.values, self._watch)
        self.values /= np.maximum(self._blocks.sizes(), 1)[:, None, None].astype(np.float32)
        prediction = self._prediction(self._data)
        for bundle in self._bundles:
            if bundle[0][0].late:
                variant, at = bundle[0]
                self.values[:, :, at] = block_late_forces(
                    self._data, self._recordings, self._blocks, variant.late, prediction
                )
                self._watch(self._samples)
                continue
            together = bundle[0][0].with_secants([variant for variant, _ in bundle])
            change = self._prediction(together) - prediction
            for variant, at in bundle:
                own = slice(None) if variant.only_joint is None else variant.only_joint - 1
                self.values[:, own, at] = change[:, own]
        return prediction

    def _prediction(self, data: Mapping[str, Any]) -> Numbers:
        prediction = block_prediction(data, self._recordings, self._blocks)
        self._watch(self._samples)
        return prediction

    def _watch(self, samples: int) -> None:
        self._done += samples
        if self._progress is not None:
            self._progress(min(self._done, self._total), self._total)


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


def _labels(proposal: Proposal) -> Iterator[str]:
    """Yield a name for each column of a proposal."""
    parts = (("joint", proposal.place.joint), ("tendon", proposal.place.tendon))
    where = [f"{word} {number}" for word, number in parts if number is not None]
    numbers = [f"{key} {value:.4g}" for key, value in proposal.variant.shape.items()]
    for path in proposal.variant.paths:
        yield ", ".join([proposal.candidate.name, *where, *numbers, *([path] if path else [])])
