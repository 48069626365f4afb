"""How much an extension gains: both models run over data that neither was fitted to, and what they leave is compared.

What is left is τ − T in means of about 10 ms, without a learning bias: a bias follows everything slow, such as a spring
or a weight, and would hide that it is missing. What the FMU leaves of every sample with its bias stands beside it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.result import ModelErrors
from tendonfmu.diagnosis.samples import Samples, as_described
from tendonfmu.errors import InputError
from tendonfmu.model import finger_of, without_friction
from tendonfmu.recordings import FitRecording, rms
from tendonfmu.statistics import BlockIndex, Interval, blocks_of, gain_interval, variance_between


@dataclass(frozen=True)
class Gain:
    """Errors and gain of an extended model: fields of `Diagnosis`."""

    nominal: ModelErrors  # rms per joint on the samples trained on and on those of the test
    extended: ModelErrors
    bias_only_rms: tuple[float, ...]
    delivered: tuple[ModelErrors, ModelErrors]  # the same with the bias, through the FMU: nominal, extended
    gain: Interval  # 1 − rms_extended/rms_nominal over all joints on the test
    steps: tuple[float, ...]  # rms over all joints on the test of each model of a sequence, N·m
    held_out: bool  # whether the test is held-out blocks of the training recordings


def measure_gain(
    nominal: Data,
    extended: Data,
    training: Sequence[FitRecording],
    tests: Sequence[FitRecording] = (),
    *,
    between: Sequence[Data] = (),
    seed: int = 0,
    threads: int = 1,
) -> Gain:
    """Measure the gain of the extended over the nominal model."""
    unseen, trained = Unseen(nominal, training, tests, threads), _Judged(nominal, training, threads, "train")
    pairs = [pair for judged in (unseen, trained) for pair in judged.pairs(nominal, extended)]
    return Gain(
        nominal=ModelErrors(trained.rms(nominal), unseen.rms(nominal)),
        extended=ModelErrors(trained.rms(extended), unseen.rms(extended)),
        bias_only_rms=unseen.rms(without_friction(extended)),
        delivered=(_delivered(nominal, training, tests), _delivered(extended, training, tests)),
        gain=unseen.gain(nominal, extended, seed, variance_between(pairs) / len(unseen.recordings)),
        steps=tuple(unseen.whole(data) for data in (nominal, *between, *([] if extended == nominal else [extended]))),
        held_out=not tests,
    )


def require_unseen(training: Sequence[FitRecording], tests: Sequence[FitRecording]) -> None:
    """Raise InputError if there is nothing to measure a gain on."""
    judged = [recording.tracked for recording in tests] or [recording.held_out for recording in training]
    if not any(flags.any() for flags in judged):
        raise InputError(
            f"{(tests or training)[0].path}: no sample to measure the gain on; expected free motion of some seconds"
        )


# --- without a bias ---------------------------------------------------------------------------------------------------


class _Judged:
    """What models leave of some samples of recordings."""

    def __init__(self, data: Data, recordings: Sequence[FitRecording], threads: int, chosen: str) -> None:
        """Judge the samples of one of the flags of a recording: "train", "held_out" or "tracked"."""
        # constants and drift are those of all free motion
        self.recordings = [replace(recording, train=recording.tracked) for recording in recordings]
        self._samples = Samples.of(data, self.recordings, threads).as_rests_demand(data)
        grid = self._samples.grid
        flags = grid.means([getattr(recording, chosen).astype(np.float64) for recording in recordings])
        self._mask: Flags = (flags == 1.0) & self._samples.used
        self._recording = np.concatenate([np.full(each.count, each.recording) for each in grid.segments])
        self._left: dict[str, Numbers] = {}

    @cached_property
    def _blocks(self) -> list[tuple[Flags, BlockIndex]]:
        """The blocks of some seconds of each recording, over its rows."""
        own = [self._recording == number for number in np.unique(self._recording)]
        return [(rows, blocks_of(self._samples.runs.time[rows], self._mask[rows])) for rows in own]

    def left(self, data: Data) -> Numbers:
        """Return what a description leaves [B, n], N·m."""
        key = json.dumps(data)
        if key not in self._left:
            self._left[key] = as_described(self._samples.residual(data), data)
        return self._left[key]

    def rms(self, data: Data) -> tuple[float, ...]:
        """Return the rms of what a description leaves, per joint, N·m."""
        return tuple(rms(self.left(data), self._mask))

    def whole(self, data: Data) -> float:
        """Return the rms over all joints, N·m."""
        return float(np.sqrt(np.mean(self.left(data)[self._mask] ** 2)))

    def squares(self, data: Data) -> Numbers:
        """Return Σ e² over all joints, (N·m)², by blocks of some seconds [K]."""
        return np.concatenate(self._squares(data))

    def _squares(self, data: Data) -> list[Numbers]:
        each = np.sum(self.left(data) ** 2, axis=1)
        return [index.sums(each[rows]) for rows, index in self._blocks]

    def pairs(self, before: Data, after: Data) -> list[Numbers]:
        """Return the same of two descriptions for each recording [K, 2]."""
        both = zip(self._squares(before), self._squares(after), strict=True)
        return [np.column_stack(pair) for pair in both]


class Unseen(_Judged):
    """What models leave of tests, or of held-out parts if there are none."""

    def __init__(
        self, data: Data, training: Sequence[FitRecording], tests: Sequence[FitRecording], threads: int = 1
    ) -> None:
        super().__init__(data, tests or training, threads, "tracked" if tests else "held_out")

    def gain(self, before: Data, after: Data, seed: int, between: float = 0.0) -> Interval:
        """Return 1 − rms after / rms before over all joints, with a 95 % interval."""
        return gain_interval(self.squares(before), self.squares(after), seed, between)


# --- with the bias ----------------------------------------------------------------------------------------------------


def _delivered(data: Data, training: Sequence[FitRecording], tests: Sequence[FitRecording]) -> ModelErrors:
    """Return the rms of r, which the FMU leaves before it moves its bias, per joint."""
    finger = finger_of(data)
    trained = [recording.run(finger).residual for recording in training]
    tested = [recording.run(finger).residual for recording in tests] if tests else trained
    unseen = [recording.tracked if tests else recording.held_out for recording in tests or training]
    flags = np.concatenate([recording.train for recording in training])
    return ModelErrors(
        tuple(rms(np.concatenate(trained), flags)), tuple(rms(np.concatenate(tested), np.concatenate(unseen)))
    )
