"""What every candidate would add to the model's torque, at every place and point of its grid, averaged over blocks.

The signal is G_k = T_k + Σ Δb up to k: T of eq. (10) with all jumps of fig. 5 so far. A candidate's column is the
derivative of G by its number at a strength of zero, or the difference that its term makes to G. All of it comes from
the C core.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import native
from tendonfmu.balance import moment_arms
from tendonfmu.block_averages import Blocks
from tendonfmu.derivative_passes import nominal_directions, plan_passes, run_pass
from tendonfmu.diagnosis_span import Span, span_of
from tendonfmu.effects import CANDIDATES, Candidate, Place, Variant
from tendonfmu.fit_recordings import FitRecording

Numbers = NDArray[np.float64]
Single = NDArray[np.float32]
Progress = Callable[[int, int], None]

_NEVER = 1e9  # N·m; no contact threshold is ever passed
_STRETCH = 4000  # samples of a run at a time: what a run returns stays near the processor


@dataclass(frozen=True)
class Shape:
    """A candidate at one point of its grid.

    shape: its non-linear numbers. columns: where its columns are in `CandidateColumns.values`. paths: the first number
    that each moves. signs: expected of each magnitude, 0 either. expected: magnitudes of an ordinary effect. secant:
    the column is the difference that the term makes at full strength; a magnitude of 1 is expected.
    """

    shape: Mapping[str, float]
    columns: slice
    paths: tuple[str, ...]
    signs: tuple[int, ...]
    expected: tuple[float, ...]
    secant: bool


@dataclass(frozen=True)
class Proposal:
    """A candidate at a place, with its grid."""

    candidate: Candidate
    place: Place
    shapes: tuple[Shape, ...]

    @property
    def columns(self) -> slice:
        """All of its columns."""
        return slice(self.shapes[0].columns.start, self.shapes[-1].columns.stop)


@dataclass(frozen=True)
class CandidateColumns:
    """Block means.

    prediction: [B, n] G of the description, N·m. nominal: [B, n, u] its derivatives by what a fit of it estimates;
    nominal_names: [u], a law's numbers as coulomb, drop, rate (1/Stribeck velocity) and viscous. values: [B, n, c] of
    the candidates; names: [c]. proposals: which columns are whose.
    """

    prediction: Numbers
    nominal: Single
    nominal_names: list[str]
    values: Single
    names: list[str]
    proposals: tuple[Proposal, ...]


def candidate_columns(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    blocks: Blocks,
    *,
    candidates: Sequence[Candidate] = CANDIDATES,
    span: Span | None = None,
    progress: Progress | None = None,
) -> CandidateColumns:
    """The columns of the description and of all candidates that it lacks.

    data: the fitted nominal description. recordings: made ready for it, all with the same kinematics source. span: of
    the recordings, None: found here. progress: called with samples done and all samples, over all passes.
    """
    plain = without_uncertainty(data)
    found_span = span_of(plain, recordings) if span is None else span
    proposed = list(_proposed(plain, recordings[0].kinematics, found_span, candidates))
    names, nominal = nominal_directions(plain)
    variants = [variant for _, _, variants in proposed for variant in variants]
    firsts = np.cumsum([0, *(variant.count for variant in variants)]).tolist()
    joints, u, c = len(data["joints"]), len(names), firsts[-1]
    passes = plan_passes(plain, [(v, u + at) for v, at in zip(variants, firsts, strict=False) if not v.secant_rows])
    secants = [(v, u + at) for v, at in zip(variants, firsts, strict=False) if v.secant_rows]
    sums = np.zeros((blocks.count, joints, u + c), dtype=np.float32)
    watch = _watched(progress, recordings, len(passes) + len(_bundles(secants)) + 1)
    passes[0].columns[:0] = enumerate(nominal)
    for each in passes:
        if each.columns:
            run_pass(each.data(), each.columns, recordings, blocks, sums, watch)
    sizes = np.maximum(blocks.sizes(), 1)
    sums /= sizes[:, None, None].astype(np.float32)
    prediction = block_prediction(plain, recordings, blocks)
    watch(_samples(recordings))
    for bundle in _bundles(secants):
        together = bundle[0][0].with_secants([variant for variant, _ in bundle])
        change = block_prediction(together, recordings, blocks) - prediction
        for variant, at in bundle:
            own = slice(None) if variant.only_joint is None else variant.only_joint - 1
            sums[:, own, at] = change[:, own]
        watch(_samples(recordings))
    proposals, labels = _labelled(proposed)
    return CandidateColumns(prediction, sums[:, :, :u], names, sums[:, :, u:], labels, proposals)


def without_uncertainty(data: Mapping[str, Any]) -> dict[str, Any]:
    """Without directions of uncertainty, which tell of the description's own numbers and grow with their count."""
    contact = {key: value for key, value in data["contact"].items() if not key.startswith("uncertainty")}
    return {**data, "contact": contact}


def block_prediction(data: Mapping[str, Any], recordings: Sequence[FitRecording], blocks: Blocks) -> Numbers:
    """[B, n] block means of G of a description, N·m, less the torque of the forces in use beyond the measured ones.

    The latter is 0 but for forces that the description delays (`time_delay` below 0).
    """
    sums = np.zeros((blocks.count, len(data["joints"])))
    finger, arms = native.Finger(native.image_from_json(json.dumps(_learning_nothing(data)))), moment_arms(data)
    for recording, block in zip(recordings, blocks.of, strict=True):
        for part in recording.parts:
            finger.reset()
            finger.set_kinematics_source(recording.kinematics)
            for begin in range(part.start, part.stop, _STRETCH):
                rows = slice(begin, min(begin + _STRETCH, part.stop))
                arrays = recording.arrays(rows)
                # τ − T_eff, and T_eff is T with all jumps so far where the bias learns nothing
                whole = arrays["tendon_force"] @ arms - finger.run(arrays)["compensated_torque"]
                _add_up(sums, block[rows], whole)
    return np.asarray(sums / np.maximum(blocks.sizes(), 1)[:, None])


def _add_up(sums: Numbers, block: NDArray[np.int64], values: Numbers) -> None:
    inside = block >= 0
    if inside.any():
        first, own = int(block[inside][0]), block[inside]
        for j in range(sums.shape[1]):
            found = np.bincount(own - first, weights=values[inside, j])
            sums[first : first + len(found), j] += found


def _learning_nothing(data: Mapping[str, Any]) -> dict[str, Any]:
    """The description whose bias moves by the jumps alone, and that never sees contact."""
    kept = {key: value for key, value in (data.get("bias") or {}).items() if key in ("forget_rate", "entry_load")}
    joints = len(data["joints"])
    still = {**kept, "drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * joints}
    return {**data, "bias": still, "contact": {"threshold": [_NEVER] * joints}}


def _proposed(
    data: Mapping[str, Any], kinematics: int, span: Span, candidates: Sequence[Candidate]
) -> Iterator[tuple[Candidate, Place, list[Variant]]]:
    for candidate in candidates:
        for place in candidate.places(data, kinematics):
            variants = candidate.variants(data, place, span)
            if variants:
                yield candidate, place, variants


def _bundles(secants: Sequence[tuple[Variant, int]]) -> list[list[tuple[Variant, int]]]:
    """Those that share a run: terms of which each changes the torque of another joint alone."""
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


def _labelled(proposed: Sequence[tuple[Candidate, Place, list[Variant]]]) -> tuple[tuple[Proposal, ...], list[str]]:
    proposals: list[Proposal] = []
    labels: list[str] = []
    for candidate, place, variants in proposed:
        shapes = []
        for variant in variants:
            columns = slice(len(labels), len(labels) + variant.count)
            secant = bool(variant.secant_rows)
            expected = (1.0,) if secant else tuple(column.expected for column in variant.columns)
            paths = ("",) if secant else variant.paths
            shapes.append(Shape(variant.shape, columns, paths, variant.signs, expected, secant))
            labels += [_label(candidate, place, variant, path) for path in paths]
        proposals.append(Proposal(candidate, place, tuple(shapes)))
    return tuple(proposals), labels


def _label(candidate: Candidate, place: Place, variant: Variant, path: str) -> str:
    parts = (("joint", place.joint), ("tendon", place.tendon))
    where = [f"{word} {number}" for word, number in parts if number is not None]
    numbers = [f"{key} {value:.4g}" for key, value in variant.shape.items()]
    return ", ".join([candidate.name, *where, *numbers, *([path] if path else [])])


def _samples(recordings: Sequence[FitRecording]) -> int:
    return sum(part.stop - part.start for each in recordings for part in each.parts)


def _watched(progress: Progress | None, recordings: Sequence[FitRecording], passes: int) -> Callable[[int], None]:
    total, done = passes * _samples(recordings), 0

    def watch(samples: int) -> None:
        nonlocal done
        done += samples
        if progress is not None:
            progress(min(done, total), total)

    return watch
