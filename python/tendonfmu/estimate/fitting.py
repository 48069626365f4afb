"""Estimates a finger's friction from contact-free motion, with an interface like that of scikit-learn."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.estimate.constructor_arguments import ConstructorArguments
from tendonfmu.estimate.coverage import EffectCoverage, coverage_of, with_laws_of
from tendonfmu.estimate.evaluation import Evaluation, evaluate, model_over, residuals
from tendonfmu.estimate.files import (
    Unfinished,
    check_given_once,
    resumed_start,
    with_uncertainty,
    with_values,
)
from tendonfmu.estimate.fit_report import Outcome, Run, build_report
from tendonfmu.estimate.methods import Interrupted, Learned, Settings, Watch, learn_batch, learn_ekf, unknown_names
from tendonfmu.estimate.picture import FitPicture, FitSeries
from tendonfmu.estimate.previous_fit import CHANGE, PreviousFit, read_previous_fit, with_previous_values
from tendonfmu.estimate.structure import Choice, build_structure
from tendonfmu.estimate.uncertainty import parameter_uncertainty
from tendonfmu.estimate.verdicts import Fitted, Knowledge, judge_numbers
from tendonfmu.files import counted
from tendonfmu.model import FingerSource, description_text, read_finger
from tendonfmu.recordings import (
    FitRecording,
    Held,
    RecordingSource,
    admit,
    bias_settings,
    listed_sources,
    motion_of,
    prepare,
    read_recording,
    read_recordings,
    refuse_stillness,
    require_noise,
    slack_sentences,
)

METHODS = {"batch": (learn_batch, 60), "ekf": (learn_ekf, 2)}  # and the default of `max_passes`
LEAST_NIS, MOST_NIS, MOST_LAG_ONE = 0.5, 2.0, 0.3  # values outside give a warning
_MORE_PASSES = ": allow more (--passes), or estimate fewer numbers (--only, --fix, --share)"
SIDES = ("given", "symmetric", "asymmetric")


class FitWarning(UserWarning):
    """A remark on the recordings or the fit that the user should read; also in `FrictionFit.warnings_`."""


class FrictionFit(ConstructorArguments):
    """Estimates the numbers of a finger description (paper, sections V and VI).

    Parameters
    ----------
    finger
        Description: its file, parsed JSON, or the result of `read_finger`. Effects that are absent stay absent.
    method
        "batch", maximum likelihood; or "ekf", the extended Kalman filter of the paper.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    holdout, holdout_block
        Share of the time that is not trained on, in evenly spread blocks, and their greatest length (s).
    sides
        "given", "symmetric" (both sides of every law equal) or "asymmetric" (each side estimated separately).
    only, fix, share
        Patterns (`estimate.structure`) of the numbers to estimate, not to estimate, and of the laws that share their
        values; `share` also takes "tendons" and "pulleys". A single pattern may be a string.
    prior, scale
        Standard deviation of the prior in units of each number's expected magnitude, and "PATTERN=VALUE": expected
        magnitudes that replace those of the description.
    max_passes, tolerance, threads
        Most passes over the data (None: 60 for "batch", 2 for "ekf"). For "batch": length of the last step in standard
        errors, and threads (0: all cores).
    uncertainty
        Whether the fitted description states the uncertainty of its friction (`contact.uncertainty`).
    parameter_drift
        For "ekf": relative variance per s with which the parameters may drift.
    effective_samples
        Whether samples count as fewer (`effective_number`) if the residuals are not white. None: only with `previous`.
    previous, change
        Report of an earlier fit, or the description that it wrote: its numbers and errors are start and prior (`prior`
        applies to numbers that it lacks). And the relative standard deviation of what may have changed since.
    start, progress
        File of an interrupted fit to continue, and a function that gets each `FitProgress` and returns False to stop.

    Attributes
    ----------
    description_, report_, warnings_
        Fitted description, report as of `tendonfmu fit --report`, and its warnings, also issued as FitWarning.
    parameters_, standard_errors_, covariance_
        Estimated numbers and standard errors by path, and [p, p] their covariance, in the units of the description.
    finished_, unfinished_
        Whether `fit` reached its end, and the state of an interrupted fit, else None.
    converged_, n_iter_, cost_
        Whether it converged, after how many iterations, and the negative log likelihood with the prior.
    unknowns_, z_, z_covariance_
        Unknowns of the estimation, [u] their estimate and [u, u] its covariance.
    """

    def __init__(
        self,
        finger: FingerSource,
        method: str = "batch",
        *,
        kinematics: int = 1,
        holdout: float = 0.0,
        holdout_block: float = 10.0,
        sides: str = "given",
        only: Sequence[str] = (),
        fix: Sequence[str] = (),
        share: Sequence[str] = (),
        prior: float = 1.0,
        scale: Sequence[str] = (),
        max_passes: int | None = None,
        tolerance: float = 0.3,
        threads: int = 0,
        uncertainty: bool = True,
        parameter_drift: float = 0.0,
        effective_samples: bool | None = None,
        previous: str | os.PathLike[str] | None = None,
        change: float = CHANGE,
        start: str | os.PathLike[str] | None = None,
        progress: Callable[[Any], bool | None] | None = None,
    ) -> None:
        self.finger = finger
        self.method = method
        self.kinematics = kinematics
        self.holdout = holdout
        self.holdout_block = holdout_block
        self.sides = sides
        self.only = only
        self.fix = fix
        self.share = share
        self.prior = prior
        self.scale = scale
        self.max_passes = max_passes
        self.tolerance = tolerance
        self.threads = threads
        self.uncertainty = uncertainty
        self.parameter_drift = parameter_drift
        self.effective_samples = effective_samples
        self.previous = previous
        self.change = change
        self.start = start
        self.progress = progress

    def __repr__(self) -> str:
        defaults = inspect.signature(type(self).__init__).parameters
        given = {name: value for name, value in self.get_params().items() if value is not defaults[name].default}
        return f"FrictionFit({', '.join(f'{name}={value!r}' for name, value in given.items())})"

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
        self._check_options()
        self.finished_ = False
        self.unfinished_: Unfinished | None = None
        finger = read_finger(self.finger)
        previous = None if self.previous is None else read_previous_fit(Path(self.previous))
        if previous is not None:
            finger = with_previous_values(finger, previous)
        chosen = (self.only, self.fix, self.share, self.scale)
        structure = build_structure(finger, Choice(self.sides, *map(_listed_text, chosen)))
        self.structure_, self.start_ = structure, structure.start
        held = Held(self.holdout, self.holdout_block, strict=True)
        given, compared_with = listed_sources(recordings), listed_sources(compare)
        check_given_once(given, compared_with)
        training, others = read_recordings(given), read_recordings(compared_with, "compare")
        if not training:
            raise InputError("no recording; expected at least one")
        found = [] if checked else admit(self.start_, [*training, *others])
        self.recordings_ = [self._prepared(each, held) for each in training]
        compared = [self._prepared(each, Held()) for each in others]
        require_noise(self.start_, self.recordings_)
        found += self._motion_warnings(not checked)
        learned = self._learn(previous, Watch(self.progress))
        if learned is None:
            return self
        # an interruption while the result is judged must not lose the estimate
        self.unfinished_ = self._unfinished(Interrupted(learned.estimator, learned.z, learned.cost, by_user=True))
        self._conclude(learned, compared, found)
        self.unfinished_ = None
        return self

    def _check_options(self) -> None:
        checks = (
            (self.method in METHODS, "method", self.method, " or ".join(METHODS)),
            (self.sides in SIDES, "sides", self.sides, ", ".join(SIDES)),
            (self.kinematics in (1, 2, 3), "kinematics", self.kinematics, "1, 2 or 3"),
            (0 <= self.holdout <= 0.9, "holdout", self.holdout, "a share from 0 to 0.9"),
            (self.holdout_block >= 1, "holdout_block", self.holdout_block, "at least 1 s"),
            (
                0 < self.prior <= 1e6,
                "prior",
                self.prior,
                "above 0 and at most 1e6, in units of the expected magnitude",
            ),
            (self.max_passes is None or self.max_passes >= 1, "max_passes", self.max_passes, "at least 1"),
            (0 < self.tolerance < 1, "tolerance", self.tolerance, "between 0 and 1"),
            (0 < self.change <= 10, "change", self.change, "above 0 and at most 10, relative to the previous values"),
            (0 <= self.parameter_drift <= 1, "parameter_drift", self.parameter_drift, "0 to 1, per s"),
            (
                self.parameter_drift == 0 or self.method == "ekf",
                "parameter_drift",
                self.parameter_drift,
                f"0 with method {self.method}; only method ekf lets parameters drift",
            ),
        )
        for sound, name, value, expectation in checks:
            if not sound:
                raise InputError(f"{name} = {value!r}: expected {expectation}")

    def _prepared(self, source: RecordingSource, held: Held) -> FitRecording:
        return prepare(self.start_, read_recording(source), self.kinematics, held)

    def _motion_warnings(self, of_recordings: bool) -> list[str]:
        self.coverage_: list[EffectCoverage] = coverage_of(self.start_.data, *motion_of(self.recordings_))
        moves = {cover.effect.path: cover.times.positive + cover.times.negative > 0 for cover in self.coverage_}
        several = len(self.recordings_) > 1
        found = [
            f"{each.path}: {sentence}" if several else sentence
            for each in (self.recordings_ if of_recordings else [])
            for sentence in each.warnings
        ]
        return [*found, *refuse_stillness(self.start_, self.recordings_, moves)]

    def _learn(self, previous: PreviousFit | None, watch: Watch) -> Learned | None:
        """Run the estimation; None if it was stopped."""
        begin = perf_counter()
        learn, passes = METHODS[self.method]
        settings = Settings(
            prior=self.prior,
            max_passes=passes if self.max_passes is None else self.max_passes,
            tolerance=self.tolerance,
            threads=self.threads,
            parameter_drift=self.parameter_drift,
            effective=previous is not None if self.effective_samples is None else self.effective_samples,
            previous=previous,
            change=self.change,
            noise=bias_settings(self.start_.data).noise,
        )
        start = None if self.start is None else partial(resumed_start, Path(self.start))
        try:
            learned = learn(self.structure_, self.recordings_, watch, settings, start)
        except Interrupted as stopped:
            self.unfinished_ = self._unfinished(stopped)
            if stopped.by_user:
                raise KeyboardInterrupt from None
            return None
        self.seconds_ = perf_counter() - begin
        return learned

    def _unfinished(self, stopped: Interrupted) -> Unfinished:
        fitted = with_values(self.structure_, np.asarray(stopped.estimator.values(stopped.z)))
        return Unfinished(
            finger=fitted.name,
            method=self.method,
            z=stopped.z,
            unknowns=unknown_names(stopped.estimator),
            cost=stopped.cost,
            options=self._options(),
            description=fitted.data,
        )

    def _options(self) -> dict[str, Any]:
        """Return the options that shape the result, as JSON values."""
        left_out = ("finger", "progress", "threads")
        given = {name: value for name, value in self.get_params().items() if name not in left_out}
        given |= {name: list(_listed_text(given[name])) for name in ("only", "fix", "share", "scale")}
        return {
            name: os.fspath(value)
            if isinstance(value, os.PathLike)
            else list(value)
            if isinstance(value, tuple)
            else value
            for name, value in given.items()
        }

    def _conclude(self, learned: Learned, compared: list[FitRecording], found: list[str]) -> None:
        self.unknowns_, self.z_, self.z_covariance_ = learned.estimator.unknowns, learned.z, learned.covariance
        self.description_ = with_values(self.structure_, np.asarray(learned.estimator.values(learned.z)))
        self.numbers_, self.covariance_ = judge_numbers(self.structure_, self._knowledge(learned))
        self.parameters_ = {number.number.path: number.value for number in self.numbers_}
        self.standard_errors_ = {number.number.path: number.standard_error for number in self.numbers_}
        start, fitted = self.start_.data, self.description_.data
        self.training_ = [evaluate(start, fitted, each) for each in self.recordings_]
        self.comparisons_ = [evaluate(start, fitted, each) for each in compared]
        told = self.uncertainty and bool(np.isfinite(learned.covariance).all())
        uncertainty = self._tell_uncertainty(learned) if told else None
        self.converged_, self.n_iter_, self.cost_ = learned.converged, learned.iterations, learned.cost
        slack = np.concatenate([each.model.slack[each.recording.train] for each in self.training_])
        self.warnings_ = [*found, *slack_sentences(slack, self.description_), *_fit_sentences(learned, self.numbers_)]
        innovations = learned.innovations or [_trained(each) for each in self.training_]
        run = Run(self.method, learned.converged, learned.iterations, learned.passes, self.seconds_, learned.cost)
        self.report_ = build_report(
            Outcome(
                fitted=self.description_,
                run=run,
                options=self._options(),
                warnings=self.warnings_,
                numbers=self.numbers_,
                names=unknown_names(learned.estimator),
                covariance=learned.covariance,
                innovations=innovations,
                weights=learned.weights,
                training=self.training_,
                comparisons=self.comparisons_,
                uncertainty=uncertainty,
            )
        )
        self.warnings_ += _noise_sentences(self.report_["innovations"])
        self.report_["warnings"] = list(self.warnings_)
        self.finished_ = True
        for sentence in self.warnings_:
            warnings.warn(sentence, FitWarning, stacklevel=5)  # at the call of tendonfmu.fit

    def _tell_uncertainty(self, learned: Learned) -> dict[str, Any]:
        """Write `contact.uncertainty` into the fitted description and return its entry in the report."""
        found = parameter_uncertainty(self.structure_, learned, self.description_.data, self.training_)
        level = (read_finger(self.finger).data["contact"] or {}).get("uncertainty_level")
        self.description_ = with_uncertainty(self.description_, found.directions, level)
        return found.entry

    def _knowledge(self, learned: Learned) -> Knowledge:
        return Knowledge(
            estimator=learned.estimator,
            z=learned.z,
            covariance=learned.covariance,
            information=learned.information,
            fitted=self.description_,
            coverage=with_laws_of(self.description_.data, self.coverage_),
            noise=bias_settings(self.description_.data).noise,
        )

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
        rows = prepared.tracked & ~np.isnan(left).any(axis=1)
        torque = prepared.target[rows]
        return float(1 - np.sum(left[rows] ** 2) / np.sum((torque - torque.mean(axis=0)) ** 2))

    def _left(self, source: RecordingSource) -> tuple[FitRecording, Numbers]:
        self._require_fitted()
        prepared = self._prepared(source, Held())
        data = self.description_.data
        return prepared, residuals(data, prepared, model_over(data, prepared)).residual

    def _require_fitted(self) -> None:
        if not getattr(self, "finished_", False):
            raise InputError("FrictionFit: not fitted yet; expected a call of fit that was not interrupted")

    def picture(self) -> FitPicture:
        """Return the data that `write_fit_page` of `tendonfmu.report` draws."""
        self._require_fitted()
        return FitPicture(
            report=self.report_,
            start=self.start_.data,
            fitted=self.description_.data,
            unknowns=self.unknowns_,
            z=self.z_,
            covariance=self.z_covariance_,
            series=[
                *(_series(each, "training") for each in self.training_),
                *(_series(each, "comparison") for each in self.comparisons_),
            ],
        )

    def description_text(self) -> str:
        """Return the fitted description as JSON, as `tendonfmu fit -o` writes it."""
        self._require_fitted()
        return description_text(self.description_.data)


def _listed_text(patterns: str | Sequence[str]) -> Sequence[str]:
    """Put a single pattern into a list, so that it is not read letter by letter."""
    return [patterns] if isinstance(patterns, str) else patterns


def _trained(found: Evaluation) -> Numbers:
    """Return [N, n] standardised innovations of the samples trained on, NaN elsewhere."""
    return np.where(found.recording.train[:, None], found.fit.standardised, np.nan)


def _fit_sentences(learned: Learned, numbers: Sequence[Fitted]) -> list[str]:
    more = "" if learned.converged else _MORE_PASSES
    found = [f"{sentence}{more}" for sentence in learned.warnings]
    at_bound = [number for number in numbers if number.at_bound]
    if at_bound:
        some = ", ".join(number.number.path for number in at_bound[:3])
        more = f" and {len(at_bound) - 3} more" if len(at_bound) > 3 else ""
        found.append(f"{counted(len(at_bound), 'number')} ended at a bound: {some}{more}")
    return found


def _noise_sentences(innovations: Mapping[str, Any]) -> list[str]:
    """Warn if the residuals contradict the noise settings, since the standard errors depend on these."""
    nis, lag_one = innovations["nis"]["mean"], innovations["whiteness"]["lag_one"]
    found = []
    times = "-" if nis is None else f"{nis:.2g}" if nis < 100 else f"{nis:.0f}"
    if nis is not None and not LEAST_NIS <= nis <= MOST_NIS:
        found.append(
            f"the residuals' variance is {times} times that of bias.noise_std, noise_std_per_force, noise_time and "
            "drift_variance: standard errors are those of these settings, not of the data"
        )
    far = max((abs(value) for value in lag_one if value is not None), default=0.0)
    if far > MOST_LAG_ONE:
        samples, worth = (sum(innovations["effective"][key]) for key in ("samples", "worth"))
        count = f"{samples:.0f} samples count as {worth:.0f}" if worth < samples else "each sample counts as new"
        found.append(
            f"residuals are not white (autocorrelation {far:.2f} from one sample to the next): the model lacks an "
            f"effect, or the noise is correlated; {count}, treat the standard errors with caution"
        )
    return found


def _series(found: Evaluation, role: Any) -> FitSeries:
    recording, model = found.recording, found.model
    training = role == "training"
    return FitSeries(
        label=recording.path.stem,
        role=role,
        mean_force=recording.mean_force,
        time=recording.time,
        torque=recording.target,
        residual=found.fit.residual,
        model_torque=model.torque,
        joint_angle=model.joint_angle,
        joint_speed=model.joint_speed,
        used=recording.train if training else np.zeros(len(recording.time), dtype=bool),
        held_out=recording.held_out if training and recording.held_out.any() else None,
    )
