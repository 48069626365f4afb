"""What every candidate would add to the model's torque, at every place and every point of its grid.

The signal is G_k = T_k + Σ Δb up to k: T of eq. (10) with all jumps of fig. 5 so far, averaged over blocks of time. A
candidate's column is the derivative of G by its number at a strength of zero, or the difference that its term makes to
G. The C core computes all of them.

Terms at a strength of zero do not affect each other. So as many as fit go into one description and one pass over the
recordings. Each column is put together from the core's derivatives by the finest numbers there are.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place, Variant
from tendonfmu.diagnosis.effects.description_edit import Edit, apply_edits, data_number, finer_paths, is_law_number
from tendonfmu.diagnosis.series import block_late_forces, block_prediction
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.errors import TooLargeError
from tendonfmu.estimate import Estimator, unknown_names
from tendonfmu.model import LIMITS, native
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import BlockSums, SampleBlocks

Single = NDArray[np.float32]
Worth = Callable[[Candidate, Place, Mapping[str, float]], bool]

_LARGEST = 1e9  # largest non-linear number in any unit: docs/reference/semantics/effects.md
_MOST_MEMORY = 8.0  # GB, for all columns
Stretch = tuple[int, Numbers, Numbers]  # first sample; derivatives of T and of the jumps there, [K, n, u]
Direction = Mapping[str, float]  # path -> share; the description may be coarser than the merged one
MOST_ROWS = LIMITS["extensions"]
_MOST_NUMBERS = 1500  # in a pass: keeps the derivatives of a stretch within tens of megabytes
_BYTES = 3e7  # of derivatives at a time: more does not stay in the processor's cache
_STRETCH, _LONGEST = 400, 2500  # samples at a time
_SEGMENT_SHARE = 24 * 24  # the estimator starts at 24 stored states of a recording and runs on from there
_TINY = 1e-9  # expected size of a magnitude of a law that is 0: the estimator starts at a millionth of it


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
        raise TooLargeError(
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


# --- derivatives -----------------------------------------------------------------------------------------------------


@dataclass
class Pass:
    """Terms that are in the same description at a strength of zero."""

    base: Mapping[str, Any]
    edits: dict[tuple[str, str], Edit] = field(default_factory=dict)
    rows: list[Mapping[str, Any]] = field(default_factory=list)
    settings: dict[str, float] = field(default_factory=dict)
    columns: list[tuple[int, Direction]] = field(default_factory=list)

    def takes(self, variant: Variant) -> bool:
        """Return whether a variant's term fits in with the others."""
        settings, given = variant.settings or {}, len(self.base.get("extensions") or [])
        return (
            all(self.settings.get(path, value) == value for path, value in settings.items())
            and all(self.edits.get((edit.kind, edit.path), edit) == edit for edit in variant.edits)
            and given + len(self.rows) + len(variant.rows) <= MOST_ROWS
            and len(self.columns) + variant.count <= _MOST_NUMBERS
        )

    def add(self, variant: Variant, first: int) -> None:
        """Add a variant; `first` is the index of its first column among all."""
        given = len(self.base.get("extensions") or [])
        shift = len(self.rows)
        own = {
            f"extensions[{given + k}].": f"extensions[{given + shift + k}]." for k in range(1, len(variant.rows) + 1)
        }
        for k, column in enumerate(variant.columns):
            moved = {_moved(path, own): share for path, share in column.numbers.items()}
            self.columns.append((first + k, moved))
        self.edits |= {(edit.kind, edit.path): edit for edit in variant.edits}
        self.rows += variant.rows
        self.settings |= variant.settings or {}

    def data(self) -> dict[str, Any]:
        return apply_edits(self.base, self.edits.values(), self.rows, self.settings)


def _moved(path: str, own: Mapping[str, str]) -> str:
    head, dot, last = path.rpartition(".")
    return f"{own.get(f'{head}{dot}', f'{head}{dot}')}{last}"


def plan_passes(base: Mapping[str, Any], variants: Sequence[tuple[Variant, int]]) -> list[Pass]:
    """Distribute variants over as few passes as possible; each comes with the index of its first column."""
    passes = [Pass(base)]
    for variant, first in variants:
        chosen = next((pass_ for pass_ in passes if pass_.takes(variant)), None)
        if chosen is None:
            chosen = Pass(base)
            passes.append(chosen)
        chosen.add(variant, first)
    return passes


def nominal_directions(data: Mapping[str, Any]) -> tuple[list[str], list[Direction]]:
    """Return the numbers that a fit of a description estimates, except for the initial bias: names and directions."""
    image = native.image_from_json(json.dumps({**data, "sensor_fault": None}))
    paths = [parameter.path for parameter in native.Instance(image).parameters()]
    estimator = Estimator(image)
    names: list[str] = []
    directions: list[Direction] = []
    for name, unknown in zip(unknown_names(estimator), estimator.unknowns, strict=True):
        if not unknown.path.startswith("bias."):
            names.append(name)
            directions.append(dict.fromkeys((paths[k] for k in unknown.parameters), 1.0))
    return names, directions


def run_pass(
    data: Mapping[str, Any],
    columns: Sequence[tuple[int, Direction]],
    recordings: Sequence[FitRecording],
    blocks: SampleBlocks,
    sums: Single,
) -> None:
    """Add to `sums` [B, n, c] the block sums of the derivatives of G, the torque with all jumps so far, N·m."""
    finer = [(place, _finer(data, direction)) for place, direction in columns]
    estimator, numbers = _estimator_of(data, {path for _, direction in finer for path in direction})
    entries = [(numbers[path], k, share) for k, (_, direction) in enumerate(finer) for path, share in direction.items()]
    row, column, share = (np.array(part) for part in zip(*entries, strict=True))
    mix = sparse.csr_array((share, (row, column)), shape=(len(estimator.unknowns), len(finer)))
    places = np.array([place for place, _ in finer])
    joints = len(data["joints"])
    for recording, block in zip(recordings, blocks.of, strict=True):
        for part in recording.parts:
            own = block[part]
            inside = own[own >= 0]
            if not len(inside):
                continue
            first, last = int(inside[0]), int(inside[-1]) + 1
            part_sums = np.zeros((last - first, joints, len(finer)), dtype=np.float32)
            shifted = np.where(own >= 0, own - first, own)
            target = BlockSums(part_sums, mix)
            for begin, values, jumps in _stretches(estimator, recording, part):
                target.add(shifted[begin : begin + len(values)], values, jumps)
            for run in np.split(np.arange(len(places)), np.flatnonzero(np.diff(places) != 1) + 1):
                sums[first:last, :, places[run[0]] : places[run[-1]] + 1] += part_sums[:, :, run[0] : run[-1] + 1]


def _finer(data: Mapping[str, Any], direction: Direction) -> dict[str, float]:
    return {fine: share for path, share in direction.items() for fine in finer_paths(data, path)}


def _stretches(estimator: Estimator, recording: FitRecording, part: slice) -> Iterator[Stretch]:
    """Yield derivatives of the part in order; samples count from its start."""
    number = estimator.add_recording(recording.arrays(part), recording.kinematics)
    samples = part.stop - part.start
    row = 2 * 8 * estimator.joints * len(estimator.unknowns)
    length = max(min(int(_BYTES / row), _LONGEST), _STRETCH, samples // _SEGMENT_SHARE)
    for begin in range(0, samples, length):
        end = min(begin + length, samples)
        _, _, values, jumps = estimator.jacobian(number, estimator.start, begin, end)
        yield begin, values, jumps


def _estimator_of(data: Mapping[str, Any], wanted: set[str]) -> tuple[Estimator, dict[str, int]]:
    """Return an estimator in which each wanted number is an unknown of its own, and path -> its column."""
    image = native.image_from_json(json.dumps({**data, "sensor_fault": None}))
    paths = [parameter.path for parameter in native.Instance(image).parameters()]
    index = {path: k for k, path in enumerate(paths)}
    group = np.full(len(paths), -1, dtype=np.int32)
    scale = np.full(len(paths), np.nan)
    for path in wanted | _statics_beside(data, wanted):
        place = index[path]
        group[place] = place
        if _starts_at_zero(data, path):
            scale[place] = _TINY if is_law_number(path) else 1.0
    estimator = Estimator(image, group, scale)
    return estimator, {paths[unknown.parameters[0]]: k for k, unknown in enumerate(estimator.unknowns)}


def _statics_beside(data: Mapping[str, Any], wanted: set[str]) -> set[str]:
    """Return the statics of laws with a Stribeck effect whose coulomb is wanted."""
    paths = set()
    for path in wanted:
        if is_law_number(path) and path.endswith(".coulomb"):
            static = f"{path.rsplit('.', 1)[0]}.static"
            if data_number(data, static) != data_number(data, path):
                paths.add(static)
    return paths


def _starts_at_zero(data: Mapping[str, Any], path: str) -> bool:
    value = data_number(data, path)
    if is_law_number(path) and path.endswith(".static"):
        value -= data_number(data, f"{path.rsplit('.', 1)[0]}.coulomb")
    return value == 0.0
