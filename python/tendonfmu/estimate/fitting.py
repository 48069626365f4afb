"""Estimates a finger's friction from contact-free motion, with an interface like that of scikit-learn."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.errors import InputError
from tendonfmu.estimate.files import (
    FIT_REPORT,
    PreviousFit,
    check_given_once,
    estimated_numbers,
    read_previous_fit,
    with_estimates,
    with_previous_values,
)
from tendonfmu.estimate.fit_report import (
    Evaluation,
    FitPicture,
    FitReport,
    FitSeries,
    GivenNumbers,
    comparison_entry,
    correlation_of,
    evaluate,
    fit_sentences,
    innovations_of,
    is_worse,
    movement,
    noise_sentences,
    parameter_entry,
    residual_entry,
    unseen_square,
)
from tendonfmu.estimate.identifiability import EffectCoverage, coverage_of
from tendonfmu.estimate.learning import FrictionFitOptions, Interrupted, Learned, Watch, settings_of, unknown_names
from tendonfmu.estimate.memory import has_memory
from tendonfmu.estimate.memory_choice import Remembered, learn_remembered
from tendonfmu.estimate.methods import learn_batch, learn_ekf
from tendonfmu.estimate.structure import Choice, build_structure, held_delay, torque_scales, with_values
from tendonfmu.estimate.verdicts import Fitted, judge_numbers, sizes_of
from tendonfmu.files import finite
from tendonfmu.model import Finger, FingerSource, number_of, read_finger
from tendonfmu.options import FitOptions
from tendonfmu.recordings import (
    FitRecording,
    Held,
    RecordingSource,
    RoutingEntry,
    admit,
    listed_sources,
    motion_of,
    prepare,
    read_recording,
    read_recordings,
    refuse_stillness,
    require_noise,
    require_routing,
    routed,
    routing_entry,
    slack_sentences,
    without_rests,
)

METHODS = {"batch": (learn_batch, 60), "ekf": (learn_ekf, 2)}  # and the default of `passes`
SIDES = {"given": None, "symmetric": False, "asymmetric": True}  # as reports say it -> `asymmetric`
# options whose names in reports are others
REPORTED = {"passes": "max_passes", "drift": "parameter_drift"}


class FitWarning(UserWarning):
    """A remark on the recordings or the fit that the user should read; also in `FrictionFit.warnings_`."""


class FrictionFit:
    """Estimates the numbers of a finger description (paper, sections V and VI).

    Parameters
    ----------
    finger
        Description: its file, parsed JSON, or the result of `read_finger`. Effects that are absent stay absent.
    **options
        The options of `tendonfmu.fit`, with the same names and defaults, and `threads` (0: all cores).

    Attributes
    ----------
    description_, report_, warnings_
        Fitted description, report as of `tendonfmu fit --report`, and its warnings, also issued as FitWarning.
    parameters_, standard_errors_, covariance_
        Estimated numbers and standard errors by path, and [p, p] their covariance, in the units of the description.
    finished_, unfinished_
        Whether `fit` reached its end, and the finger with the best estimate so far of an interrupted fit, else None.
    converged_, n_iter_, cost_
        Whether it converged, after how many iterations, and the negative log likelihood with the prior.
    unknowns_, z_, z_covariance_
        Unknowns of the estimation, [u] their estimate and [u, u] its covariance.
    """

    def __init__(self, finger: FingerSource, **options: Any) -> None:
        self.finger, self.options = finger, FrictionFitOptions(**options)

    # --- fit ----------------------------------------------------------------------------------------------------------

    def fit(
        self,
        recordings: RecordingSource | Sequence[RecordingSource],
        compare: RecordingSource | Sequence[RecordingSource] = (),
        *,
        checked: bool = False,
    ) -> FrictionFit:
        """Estimate the numbers from recordings, each with its own bias path, and return the object itself.

        Ctrl-C, or `progress` returning False, leaves `finished_` False and the best estimate so far in `unfinished_`.
        After Ctrl-C the KeyboardInterrupt continues.

        Parameters
        ----------
        recordings, compare
            Recordings of free motion, DataFrames or files, to train on; and recordings to judge only.
        checked
            Whether the caller has compared the recordings with the finger and reported the findings.

        Raises
        ------
        InputError
            An option, a file or a recording does not allow a sound fit.
        """
        options = self.options
        self.finished_ = False
        self.unfinished_: Finger | None = None
        finger = read_finger(self.finger)
        given, compared_with = listed_sources(recordings), listed_sources(compare)
        check_given_once(given, compared_with)
        self.routing_: RoutingEntry | None = None
        if options.routing:
            finger, self.routing_ = _with_routing(finger, given)
        previous = None if options.previous is None else read_previous_fit(Path(options.previous))
        if previous is not None:
            finger = with_previous_values(finger, previous)
        else:
            previous = estimated_numbers(finger)
        fixed = options.fix if options.only else (*options.fix, *_left_alone(finger.data))
        self._choice = Choice(_sides(options), options.only, fixed, options.share, options.scale)
        self.structure_ = build_structure(finger, self._choice)
        self.start_ = self.structure_.start
        held = Held(options.holdout, options.holdout_block, strict=True)
        training, others = read_recordings(given), read_recordings(compared_with, "compare")
        if not training:
            raise InputError("no recording; expected at least one")
        remarks = [] if checked else admit(self.start_, [*training, *others])
        self.recordings_ = [self._prepared(recording, held) for recording in training]
        compared = [self._prepared(recording, Held()) for recording in others]
        require_noise(self.start_, self.recordings_)
        remarks += self._motion_warnings(not checked)
        learned = self._learn(previous, Watch(self.options.progress))
        if learned is None:
            return self
        # an interruption while the result is judged must not lose the estimate
        self.unfinished_ = learned.fitted(self.structure_)
        self._conclude(learned, compared, remarks, previous is not None)
        self.unfinished_ = None
        for sentence in self.warnings_:
            warnings.warn(sentence, FitWarning, stacklevel=4)  # at the call of tendonfmu.fit
        return self

    def _prepared(self, source: RecordingSource, held: Held) -> FitRecording:
        prepared = prepare(self.start_, read_recording(source), self.options.kinematics, held)
        return without_rests(prepared, self.start_, is_batch=self.options.method == "batch")

    def _motion_warnings(self, of_recordings: bool) -> list[str]:
        self.coverage_: list[EffectCoverage] = coverage_of(self.start_.data, *motion_of(self.recordings_))
        moves = {cover.effect.path: cover.times.positive + cover.times.negative > 0 for cover in self.coverage_}
        several = len(self.recordings_) > 1
        sentences = [
            f"{recording.path}: {sentence}" if several else sentence
            for recording in (self.recordings_ if of_recordings else [])
            for sentence in recording.warnings
        ]
        return [*sentences, *refuse_stillness(self.start_, self.recordings_, moves)]

    def _learn(self, previous: PreviousFit | None, watch: Watch) -> Learned | None:
        """Run the estimation; None if it was stopped."""
        begin = perf_counter()
        options = self.options
        learn, passes = METHODS[options.method]
        settings = replace(
            settings_of(self.start_.data, self.recordings_, passes=options.passes or passes),
            options=options,
            previous=previous,
            begin=None if options.start is None else read_finger(options.start),
        )
        self.remembered_: Remembered | None = None
        try:
            if options.method == "batch" and self.structure_.needs_runs:
                self.remembered_ = learn_remembered(self.structure_, self._choice, self.recordings_, watch, settings)
                self.structure_, learned = self.remembered_.structure, self.remembered_.learned
            else:
                learned = learn(self.structure_, self.recordings_, watch, settings)
        except Interrupted as stopped:
            self.unfinished_ = with_values(self.structure_, stopped.estimator.values(stopped.z))
            if stopped.by_user:
                raise KeyboardInterrupt from None
            return None
        self.seconds_ = perf_counter() - begin
        return learned

    def _evaluated(self, learned: Learned) -> list[Evaluation]:
        self.description_ = learned.fitted(self.structure_)
        return [evaluate(self.start_, self.description_, recording) for recording in self.recordings_]

    def _conclude(self, learned: Learned, compared: list[FitRecording], remarks: list[str], is_estimated: bool) -> None:
        self.training_ = self._evaluated(learned)
        if learned.memory is None:
            keeps = is_worse(self.training_)
        else:
            before, after = (unseen_square(each, self.recordings_) for each in (self.start_, self.description_))
            keeps = after > before
        if keeps:
            learned = replace(learned, z=learned.estimator.start)
            self.training_ = self._evaluated(learned)
        self.unknowns_, self.z_, self.z_covariance_ = learned.estimator.unknowns, learned.z, learned.covariance
        self.numbers_, self.covariance_ = self._judged(learned)
        self.parameters_ = {number.number.path: number.value for number in self.numbers_}
        self.standard_errors_ = {number.number.path: number.standard_error for number in self.numbers_}
        self.comparisons_ = [evaluate(self.start_, self.description_, recording) for recording in compared]
        numbers, noise = [each.number for each in self.numbers_], number_of(self.description_.data, "bias.noise_std")
        self.description_ = with_estimates(self.description_, numbers, self.covariance_, sizes_of(numbers, noise))
        self.converged_, self.n_iter_, self.cost_ = learned.converged, learned.iterations, learned.cost
        slack = np.concatenate([each.model.slack[each.recording.train] for each in self.training_])
        self.warnings_ = [*remarks, *slack_sentences(slack, self.description_), *fit_sentences(learned, self.numbers_)]
        self.report_ = self._report(learned, movement(self.numbers_, is_estimated, keeps))
        if self.remembered_ is None:
            self.warnings_ += noise_sentences(self.report_["innovations"])
        else:
            self.warnings_ += self.remembered_.sentences()
        self.report_["warnings"] = list(self.warnings_)
        self.finished_ = True

    def _report(self, learned: Learned, moved: GivenNumbers) -> FitReport:
        """Return all results as JSON has them; numbers that are not finite become None."""
        trained = residual_entry(self.training_, "train")
        assert trained is not None, "a fit is trained on something"
        innovations = learned.innovations or [_trained(evaluation) for evaluation in self.training_]
        report: FitReport = {
            "format": FIT_REPORT,
            "finger": self.description_.name,
            "method": self.options.method,
            "converged": learned.converged,
            "finished": True,
            "iterations": learned.iterations,
            "passes": learned.passes,
            "seconds": self.seconds_,
            "cost": learned.cost,
            "options": _reported(self.options),
            "warnings": list(self.warnings_),
            "recordings": [evaluation.recording.entry() for evaluation in self.training_],
            "parameters": [parameter_entry(number, self.description_) for number in self.numbers_],
            "correlation": {
                "paths": unknown_names(learned.estimator),
                "standard_errors": np.sqrt(np.maximum(np.diag(learned.covariance), 0.0)).tolist(),
                "matrix": correlation_of(learned.covariance),
            },
            "routing": self.routing_,
            "given_numbers": moved,
            "identified": {"count": sum(each.identified for each in self.numbers_), "of": len(self.numbers_)},
            "residual": {
                "train": trained,
                "held_out": residual_entry(self.training_, "held_out"),
                "comparisons": [comparison_entry(evaluation) for evaluation in self.comparisons_],
            },
            "innovations": innovations_of(innovations, learned.weights),
            "memory": None if self.remembered_ is None else self.remembered_.entry(),
        }
        return finite(report)

    def _judged(self, learned: Learned) -> tuple[list[Fitted], Numbers]:
        noise = number_of(self.description_.data, "bias.noise_std")
        return judge_numbers(self.structure_, learned, self.description_, self.coverage_, noise)

    # --- what was learned, on other recordings ------------------------------------------------------------------------

    def predict(self, recording: RecordingSource) -> Numbers:
        """Predict the torque of a recording, before the bias learns from the sample itself.

        Returns
        -------
        ndarray
            [N, n] T_eff (N·m); NaN where there is none, such as for the first sample. The residual is τ, less
            external_torque where the recording has it, minus this.
        """
        prepared, left = self._left(recording)
        return np.asarray(prepared.target - left)

    def score(self, recording: RecordingSource) -> float:
        """Compute 1 − Σ residual² / Σ (torque − mean)² over all joints and samples without contact; 1 is perfect."""
        prepared, left = self._left(recording)
        torque = np.where(prepared.tracked[:, None] & ~np.isnan(left), prepared.target, np.nan)
        return float(1 - np.nansum(left[prepared.tracked] ** 2) / np.nansum((torque - np.nanmean(torque, axis=0)) ** 2))

    def _left(self, source: RecordingSource) -> tuple[FitRecording, Numbers]:
        self._require_fitted()
        prepared = self._prepared(source, Held())
        return prepared, prepared.run(self.description_).residual

    def _require_fitted(self) -> None:
        if not getattr(self, "finished_", False):
            raise InputError("FrictionFit: not fitted yet; expected a call of fit that was not interrupted")

    def picture(self) -> FitPicture:
        """Return the data that `write_fit_page` of `tendonfmu.report` draws."""
        self._require_fitted()
        return FitPicture(
            report=self.report_,
            start=self.start_,
            fitted=self.description_,
            unknowns=self.unknowns_,
            z=self.z_,
            covariance=self.z_covariance_,
            series=[
                *(_series(evaluation, "training") for evaluation in self.training_),
                *(_series(evaluation, "comparison") for evaluation in self.comparisons_),
            ],
        )


def _left_alone(data: Data) -> tuple[str, ...]:
    """Return what is estimated only if it is asked for: it imitates friction, or motion alone does not tell it."""
    return (*torque_scales(data), *(held_delay(data) if has_memory(data) else ()))


def _with_routing(given: Finger, sources: Sequence[RecordingSource]) -> tuple[Finger, RoutingEntry]:
    """Return the finger with the routing that the recordings show, and what the report says of it."""
    learned = require_routing(given, read_recordings(sources))
    return routed(given, learned)[0], routing_entry(given, learned)


def _sides(options: FitOptions) -> str:
    return next(words for words, asymmetric in SIDES.items() if asymmetric is options.asymmetric)


def _reported(options: FitOptions) -> dict[str, Any]:
    """Return the options that shape the result, with their names in reports."""
    values = {each.name: getattr(options, each.name) for each in fields(FitOptions)}
    del values["asymmetric"], values["progress"]
    reported = {REPORTED.get(name, name): value for name, value in values.items()}
    paths = {name: os.fspath(value) for name, value in reported.items() if isinstance(value, os.PathLike)}
    return {**reported, **paths, "sides": _sides(options)}


def _trained(evaluation: Evaluation) -> Numbers:
    """Return [N, n] standardised innovations of the samples trained on, NaN elsewhere."""
    return np.where(evaluation.recording.train[:, None], evaluation.model.standardised, np.nan)


def _series(evaluation: Evaluation, role: Any) -> FitSeries:
    recording, model = evaluation.recording, evaluation.model
    training = role == "training"
    return FitSeries(
        label=recording.path.stem,
        role=role,
        mean_force=recording.mean_force,
        time=recording.time,
        torque=recording.target,
        residual=model.residual,
        model_torque=model.torque,
        joint_angle=model.joint_angle,
        joint_speed=model.joint_speed,
        used=recording.train if training else np.zeros(len(recording.time), dtype=bool),
        held_out=recording.held_out if training and recording.held_out.any() else None,
    )
