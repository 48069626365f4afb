"""How much an extension gains: both FMUs run over data that neither was fitted to, and their residuals are compared.

The residual r is τ − T of eq. (10) − bias before the update. It is no output of an FMU: compensated_torque = (1 − K)·r
is what the update leaves of it. So the core runs over the same samples. Where all outputs of FMU and core agree, the
core's r is that of the FMU, and it shows how the bias jumped.

With a known external torque, labelled contact or gaps, the bias filter runs once more over y − T (`track`), with the T
of the FMU. In a recording without these, this gives r of the core again, and both are compared.

r hides causes: the bias filter follows everything slow, such as a spring or a weight, and single samples of r are
mostly sensor noise. So the search uses `OnlineError`: means over 10 ms of raw samples, less a bias that moves within
2 s (splines). r only shows that a cause does no harm.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.result import ModelErrors
from tendonfmu.diagnosis.series import block_prediction, make_grid, sample_blocks
from tendonfmu.diagnosis.view import bias_of, series_of
from tendonfmu.errors import InputError, InternalError
from tendonfmu.estimate import residuals
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.model import NUMBERS, description_text, native
from tendonfmu.recordings import BiasSettings, FitRecording, Model, bias_settings, delayed_torque, rms
from tendonfmu.statistics import BlockIndex, Interval, Span, blocks_of, gain_interval, make_folds, variance_between

AGREEMENT = 1e-9  # of the largest value of an output's series: allowed difference of two implementations
_NEVER = 1e9  # N·m; a contact threshold that is never passed
_THRESHOLDS = ("contact.threshold[", "contact.innovation.threshold[")
_TINY = 1e-12  # N·m; lower limit of a scale, for series that are 0


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
    # largest difference between the outputs of an FMU and of the core, in units of the output's largest value
    agreement: float


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
    runs = {"nominal": [run_both(nominal, recording) for recording in test.recordings]}
    same = extended == nominal
    runs["extended"] = runs["nominal"] if same else [run_both(extended, recording) for recording in test.recordings]
    left = {name: [run.residual for run in runs_of] for name, runs_of in runs.items()}
    before, after = test.squares(left["nominal"]), test.squares(left["extended"])
    trained = {"nominal": test.trained(nominal, left["nominal"])}
    trained["extended"] = trained["nominal"] if same else test.trained(extended, left["extended"])
    by_recording = test.pairs(left["nominal"], left["extended"], trained["nominal"], trained["extended"])
    sequence = [before, *(test.squares_of(data) for data in between), *([] if same else [after])]
    return Gain(
        nominal=ModelErrors(test.pooled(trained["nominal"]), test.tested(left["nominal"])),
        extended=ModelErrors(test.pooled(trained["extended"]), test.tested(left["extended"])),
        bias_only_rms=test.tested([residuals(extended, recording, None).residual for recording in test.recordings]),
        value=gain_interval(before, after, seed, variance_between(by_recording) / len(test.recordings)),
        steps=tuple(float(np.sqrt(squares.sum() / max(test.count, 1))) for squares in sequence),
        blocks=len(before),
        held_out=test.held_out,
        agreement=max(run.agreement for runs_of in runs.values() for run in runs_of),
    )


def require_unseen(training: Sequence[FitRecording], tests: Sequence[FitRecording]) -> None:
    """Raise InputError if there is nothing to measure a gain on."""
    _Test.of(training, tests)


def _check_settings(nominal: Data, extended: Data) -> None:
    if _filter_of(nominal) != _filter_of(extended):
        raise InternalError("bias: different settings in the two descriptions, so their rms cannot be compared")


def _filter_of(data: Data) -> BiasSettings:
    """Return the settings of the bias filter without its initial value, which is fitted and may differ."""
    return replace(bias_settings(data), initial_torque=None)


def residual_of(data: Data, recording: FitRecording) -> Numbers:
    """Return the residual r of a recording before the bias update, from a run of the core."""
    # returns r, N·m [N, n]; NaN where there is none
    outputs = _core_outputs(data, recording)
    if not _one_piece(data, recording):
        return residuals(data, recording, _model(data, recording, outputs)).residual
    left: Numbers = outputs["residual"].copy()  # the core's own filter saw the same
    left[0] = np.nan
    return left


def squared_residual(data: Data, recordings: Sequence[FitRecording], flags: Sequence[Flags] | None = None) -> float:
    """Return Σ r² over all joints, (N·m)², at the flagged samples [N] of each recording; those trained on if None."""
    chosen = [recording.train for recording in recordings] if flags is None else flags
    left = (residual_of(data, recording)[own] for recording, own in zip(recordings, chosen, strict=True))
    return float(sum(np.nansum(residual**2) for residual in left))


# --- an FMU and the core side by side ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class BothRun:
    """The residual and how well FMU and core agree."""

    residual: Numbers  # r, N·m [N, n]
    agreement: float  # largest difference of the outputs of FMU and core, in units of the output's largest value


def run_both(data: Data, recording: FitRecording) -> BothRun:
    """Pack the FMU of a description, run it over a recording without contact detection, and compute r from its T."""
    outputs, beside = _fmu_outputs(data, recording), _core_outputs(data, recording)
    agreement = max(_difference(outputs[name], beside[name]) for name in NUMBERS)
    left = residuals(data, recording, _model(data, recording, {**beside, **outputs})).residual
    if _one_piece(data, recording):
        size = max(float(np.abs(beside["friction_torque"]).max()), float(np.abs(beside["joint_torque"]).max()))
        agreement = max(agreement, float(np.abs(left[1:] - beside["residual"][1:]).max()) / max(size, _TINY))
    if not agreement <= AGREEMENT:
        raise InternalError(
            f"{recording.path}: the FMU's outputs and the core's differ by {agreement:.3g} of their largest value; "
            f"expected at most {AGREEMENT:g}"
        )
    return BothRun(left, agreement)


def _fmu_outputs(data: Data, recording: FitRecording) -> dict[str, Numbers]:
    """Return the outputs of the packed FMU by group [N, n]."""
    out_of_reach = {
        parameter.path: min(_NEVER, parameter.maximum)
        for parameter in native.Instance.from_description(data).parameters()
        if parameter.path.startswith(_THRESHOLDS)
    }
    with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
        file = Path(folder) / "finger.json"
        file.write_text(description_text(data), encoding="utf-8")
        fmu = build_fmu(file, file.with_suffix(".fmu"), illustrated=False)
        columns = run_fmu(fmu, recording.recording, kinematics_source=recording.kinematics, parameters=out_of_reach)
    return {
        name: np.column_stack([columns[f"{name}[{j}]"] for j in range(1, len(data["joints"]) + 1)]) for name in NUMBERS
    }


def _core_outputs(data: Data, recording: FitRecording) -> dict[str, Any]:
    """Return the outputs of `native.Instance.run` without contact detection."""
    free = {**data, "contact": {"threshold": [_NEVER] * len(data["joints"])}, "sensor_fault": None}
    return native.Instance.from_description(free, recording.kinematics).run(recording.recording.arrays())


def _model(data: Data, recording: FitRecording, outputs: Mapping[str, Any]) -> Model:
    """Return T and Δb of a run."""
    bias = outputs["bias_torque"]
    torque = outputs["friction_torque"] - bias
    jump = np.diff(bias, axis=0, prepend=bias[:1]) - (outputs["residual"] - outputs["compensated_torque"])
    jump[0] = 0.0
    return Model(
        torque=torque - delayed_torque(data, recording.recording.groups, outputs["joint_torque"]),
        jump=jump,
        joint_angle=outputs["joint_angle"],
        joint_speed=outputs["joint_speed"],
        slack=outputs["slack"],
    )


def _one_piece(data: Data, recording: FitRecording) -> bool:
    """Return whether the FMU's bias filter sees what a fit is judged on: all samples, with the same mean force."""
    rows = data.get("extensions") or []
    delayed = any(row["effect"] == "time_delay" and row["delay"] < 0 for row in rows)
    same_noise = not (delayed and bias_settings(data).per_force)
    return len(recording.parts) == 1 and recording.external is None and bool(recording.tracked.all()) and same_noise


def _difference(mine: Numbers, other: Numbers) -> float:
    """Return the largest difference in units of the largest value."""
    return float(np.abs(mine - other).max()) / max(float(np.abs(other).max()), _TINY)


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

    def squares_of(self, data: Data) -> Numbers:
        """Return the same for a description, run by the core."""
        return self.squares([residual_of(data, recording) for recording in self.recordings])

    @property
    def count(self) -> int:
        """Number of judged samples times joints."""
        return sum(int(mask.sum()) for mask in self.masks) * int(self.recordings[0].target.shape[1])

    def tested(self, left: Sequence[Numbers]) -> tuple[float, ...]:
        return _pooled(left, self.masks)

    def trained(self, data: Data, left: Sequence[Numbers]) -> Sequence[Numbers]:
        """Return the residuals of the training recordings."""
        return left if self.held_out else [residual_of(data, recording) for recording in self.training]

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
