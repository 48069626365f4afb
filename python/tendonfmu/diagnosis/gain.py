"""How much an extension gains: both models run over data that neither was fitted to, and their residuals are compared.

The residual r is τ − T of eq. (10) − bias before the update, of the core, which is what the FMU runs too.

r hides causes: the bias filter follows everything slow, such as a spring or a weight, and single samples of r are
mostly sensor noise. So the search uses `OnlineError`: means over 10 ms of raw samples, less a bias that moves within
2 s (splines). r only shows that a cause does no harm.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.result import ModelErrors
from tendonfmu.diagnosis.series import block_prediction
from tendonfmu.diagnosis.view import bias_of, series_of
from tendonfmu.errors import InputError, InternalError
from tendonfmu.model import number_of, without_friction
from tendonfmu.recordings import FitRecording, make_grid, rms, sample_blocks
from tendonfmu.statistics import BlockIndex, Interval, Span, blocks_of, gain_interval, make_folds, variance_between


@dataclass(frozen=True)
class Gain:
    """Errors and gain of an extended model."""

    nominal: ModelErrors  # rms per joint on the samples trained on and on those of the test
    extended: ModelErrors
    bias_only_rms: tuple[float, ...]
    value: Interval  # 1 − rms_extended/rms_nominal over all joints on the test
    steps: tuple[float, ...]  # rms over all joints on the test of each model of a sequence, N·m
    blocks: int  # number of blocks of some seconds of the test; the intervals come from them
    held_out: bool  # whether the test is held-out blocks of the training recordings


def measure_gain(
    nominal: Data,
    extended: Data,
    training: Sequence[FitRecording],
    tests: Sequence[FitRecording] = (),
    *,
    between: Sequence[Data] = (),
    seed: int = 0,
) -> Gain:
    """Measure the gain of the extended over the nominal model."""
    test = _Test.of(training, tests)
    _check_settings(nominal, extended)
    same = extended == nominal
    left = {"nominal": test.left(nominal)}
    left["extended"] = left["nominal"] if same else test.left(extended)
    before, after = test.squares(left["nominal"]), test.squares(left["extended"])
    trained = {"nominal": test.trained(nominal, left["nominal"])}
    trained["extended"] = trained["nominal"] if same else test.trained(extended, left["extended"])
    by_recording = test.pairs(left["nominal"], left["extended"], trained["nominal"], trained["extended"])
    sequence = [before, *(test.squares(test.left(data)) for data in between), *([] if same else [after])]
    return Gain(
        nominal=ModelErrors(test.pooled(trained["nominal"]), test.tested(left["nominal"])),
        extended=ModelErrors(test.pooled(trained["extended"]), test.tested(left["extended"])),
        bias_only_rms=test.tested(test.left(without_friction(extended))),
        value=gain_interval(before, after, seed, variance_between(by_recording) / len(test.recordings)),
        steps=tuple(float(np.sqrt(squares.sum() / max(test.count, 1))) for squares in sequence),
        blocks=len(before),
        held_out=test.held_out,
    )


def require_unseen(training: Sequence[FitRecording], tests: Sequence[FitRecording]) -> None:
    """Raise InputError if there is nothing to measure a gain on."""
    _Test.of(training, tests)


def _check_settings(nominal: Data, extended: Data) -> None:
    if _filter_of(nominal) != _filter_of(extended):
        raise InternalError("bias: different settings in the two descriptions, so their rms cannot be compared")


def _filter_of(data: Data) -> list[Any]:
    """Return the settings of the bias filter without its initial value, which is fitted and may differ."""
    given = data.get("bias") or {}
    required = (number_of(data, f"bias.{key}") for key in ("drift_variance", "noise_std", "noise_std_per_force"))
    return [*required, *(given.get(key) for key in ("noise_time", "initial_variance", "start_share"))]


def squared_residual(data: Data, recordings: Sequence[FitRecording], flags: Sequence[Flags] | None = None) -> float:
    """Return Σ r² over all joints, (N·m)², at the flagged samples [N] of each recording; those trained on if None."""
    chosen = [recording.train for recording in recordings] if flags is None else flags
    left = (recording.run(data).residual[own] for recording, own in zip(recordings, chosen, strict=True))
    return float(sum(np.nansum(residual**2) for residual in left))


# --- the samples of the test ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Test:
    """Recordings with the samples that are tested on, and their blocks."""

    training: Sequence[FitRecording]
    recordings: Sequence[FitRecording]
    masks: Sequence[Flags]
    blocks: Sequence[BlockIndex]
    held_out: bool

    @classmethod
    def of(cls, training: Sequence[FitRecording], tests: Sequence[FitRecording]) -> _Test:
        held_out = not tests
        recordings = training if held_out else tests
        masks = [_judged(recording, recording.held_out if held_out else recording.tracked) for recording in recordings]
        if not any(mask.any() for mask in masks):
            raise InputError(
                f"{recordings[0].path}: no sample to measure the gain on; expected free motion of some seconds"
            )
        blocks = [blocks_of(recording.time, mask) for recording, mask in zip(recordings, masks, strict=True)]
        return cls(training, recordings, masks, blocks, held_out)

    def squares(self, left: Sequence[Numbers]) -> Numbers:
        """Return block sums [B] of the squared residuals [N, n], over all joints and recordings."""
        return np.concatenate(
            [block.sums(np.sum(residual**2, axis=1)) for block, residual in zip(self.blocks, left, strict=True)]
        )

    def left(self, data: Data) -> list[Numbers]:
        """Return the residuals [N, n] of a description."""
        return [recording.run(data).residual for recording in self.recordings]

    @property
    def count(self) -> int:
        """Number of judged samples times joints."""
        return sum(int(mask.sum()) for mask in self.masks) * int(self.recordings[0].target.shape[1])

    def tested(self, left: Sequence[Numbers]) -> tuple[float, ...]:
        return _pooled(left, self.masks)

    def trained(self, data: Data, left: Sequence[Numbers]) -> Sequence[Numbers]:
        """Return the residuals of the training recordings."""
        return left if self.held_out else [recording.run(data).residual for recording in self.training]

    @cached_property
    def _trained_on(self) -> list[Flags]:
        return [_judged(recording, recording.train) for recording in self.training]

    def pooled(self, trained: Sequence[Numbers]) -> tuple[float, ...]:
        """Return the rms on the samples trained on."""
        return _pooled(trained, self._trained_on)

    def pairs(self, before: Sequence[Numbers], after: Sequence[Numbers], *trained: Sequence[Numbers]) -> list[Numbers]:
        """Return the block sums [B, 2] of the squares of two models, of each recording."""
        listed = [*zip(self.blocks, before, after, strict=True)]
        if not self.held_out:
            blocks = [
                blocks_of(recording.time, mask) for recording, mask in zip(self.training, self._trained_on, strict=True)
            ]
            listed += zip(blocks, *trained, strict=True)
        return [
            np.column_stack([block.sums(np.sum(residual**2, axis=1)) for residual in residuals])
            for block, *residuals in listed
        ]


def _judged(recording: FitRecording, chosen: Flags) -> Flags:
    """Return the chosen samples that have a residual [N]."""
    judged = np.zeros(len(recording.time), dtype=bool)
    for part in recording.parts:
        if recording.tracked[part].any():
            judged[part.start + int(np.argmax(recording.tracked[part])) + 1 : part.stop] = True
    return chosen & judged


def _pooled(left: Sequence[Numbers], masks: Sequence[Flags]) -> tuple[float, ...]:
    return tuple(rms(np.concatenate(left), np.concatenate(masks)))


# --- means of 10 ms --------------------------------------------------------------------------------------------------


class OnlineError:
    """Errors of several models over the same samples of the same recordings."""

    def __init__(self, data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> None:
        """Prepare the recordings."""
        grid = make_grid(recordings)
        self._recordings, self._blocks = recordings, sample_blocks(grid, recordings)
        series = series_of(data, recordings, grid)
        folds = make_folds(series)
        self._rows, self._stretch, self._stretches = folds.rows, folds.stretch, folds.stretches
        self._span = Span(bias_of(data, series)[self._rows])
        self._measured = series.target[self._rows] + block_prediction(data, recordings, self._blocks)[self._rows]
        self._squares: dict[str, float] = {}  # models are compared with several others

    def square(self, data: Mapping[str, Any]) -> float:
        """Return Σ r² over all joints, (N·m)², of every sample; r is taken before the bias update."""
        key = json.dumps(data)
        if key not in self._squares:
            self._squares[key] = squared_residual(data, self._recordings)
        return self._squares[key]

    def by_stretch(self, data: Mapping[str, Any]) -> Numbers:
        """Return Σ e² over all joints, (N·m)² [K], by stretches of about 2 s."""
        predicted = block_prediction(data, self._recordings, self._blocks)[self._rows]
        left = self._span.without(self._measured - predicted)
        sums = np.bincount(self._stretch, np.sum(left**2, axis=1), minlength=self._stretches)
        return np.asarray(sums, dtype=np.float64)
