"""Tunes contact detection on free motion for a stated rate of false alarms, with an interface like scikit-learn's.

Bounds are chosen on runs without contact detection. Their alarms are counted on blocks that the bounds were not chosen
on, and again with the tuned finger as it will run.

Examples
--------
>>> tuning = ContactTuning("fitted.json", false_alarms_per_hour=6).tune(["free_10N.parquet", "free_40N.parquet"])
>>> tuning.description_
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from tendonfmu.arrays import Numbers, rounded
from tendonfmu.detect.alarm_level import (
    NotEnough,
    alarms_above,
    cells_of,
    hours_by_pretension,
    least_hours,
    rate_limit,
    supported,
)
from tendonfmu.detect.bounds import (
    SECOND_SHARE,
    SHARES,
    Bound,
    Level,
    Line,
    Search,
    evidence_line,
    given_line,
    level_of,
    search_for,
    searched_line,
)
from tendonfmu.detect.contact_at_rest import RestRule, learn_rest
from tendonfmu.detect.free_motion import Clock, FreePart, FreeRun, LoopAlarms, count_loop, free_parts, run_free
from tendonfmu.detect.noise import BiasNoise, Deviation, bias_noise, deviation, wanted_time
from tendonfmu.detect.sensor_faults import SensorRule, learn_sensors
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once, own_copy
from tendonfmu.files import are, counted
from tendonfmu.model import description_text, finger_from_data, read_finger
from tendonfmu.options import Configured, Number, Options, TuneOptions, option
from tendonfmu.recordings import RecordingSource, admit, listed_sources, read_recordings

STUCK_TIME = 0.25  # s, T_H
STUCK_TIME_PRESLIDING = 0.06  # s, if presliding models how friction reverses after break-away
RELEASE = {"release_ratio": 1.0, "hold_time": 0.05}  # 1, s
# min of free motion: 60 of the slow means that contact.drift compares with, more than a fit could adapt to
LEAST_DRIFT = 10.0
USUAL_LEVEL, LOW_LEVEL = 3.0, 1.0  # standard deviations of the modelled friction in the residual's bound
CLEAR = 0.05  # of the lightest push found, by which the low level must be better
START_SHARE = 1.0  # bias.start_share: before the start all friction may point in either direction
_STEP, _STEPS = 1.05, 12  # factor on the level, and most steps, until the running finger keeps the rate
_DIGITS = 6


class TuneWarning(UserWarning):
    """A remark of a tuning on its recordings and its result."""


@dataclass(frozen=True)
class ContactTuningOptions(TuneOptions):
    """Options of `ContactTuning`: those of `tune`, and further keys of the description."""

    innovation_time: float = option(0.05, Number(1e-6, 100.0), "T (s)")
    jump_time: float = option(0.06, Number(1e-6, 100.0), "T_J (s)")
    stuck_time: float | None = option(None, Number(0.0, 100.0, optional=True), "T_H (s); None: by the presliding")
    evidence_time: float = option(0.02, Number(1e-6, 100.0), "τ_e (s)")


@dataclass(frozen=True)
class Pretension:
    """Free motion at one pretension."""

    force: float
    hours: float
    rms: list[float]
    alarms: int
    limit: float


class ContactTuning(Configured):
    """Tunes contact detection from recordings of free motion.

    Parameters
    ----------
    finger
        Description: its file, parsed JSON, or the result of `read_finger`.
    progress
        Called with steps done and steps.
    **options
        The options of `tendonfmu.tune`, with the same names and defaults, and `innovation_time`, `jump_time`,
        `stuck_time` and `evidence_time`, values of these keys (s). stuck_time None: chosen by whether the description
        has presliding.

    Attributes
    ----------
    description_
        Tuned description.
    bias_, deviation_
        Noise of the bias, and standard deviation of the estimated torque.
    lines_, levels_, bounds_
        Bounds before and after scaling, and their levels, by "residual", "innovation" and "drift".
    cells_, runs_, pretensions_
        Counted time, runs without contact detection, and free motion by pretension.
    rest_, sensors_
        Rules for contact at rest (None without enough rests) and for failing sensors (sensor_fault).
    held_out_, loop_
        Alarms on blocks that the bounds were not chosen on, with the upper limit of their rate (1/h); alarms of the
        finger as it runs.
    rate_, allowed_, more_minutes_
        Rate that it is tuned for (1/h), the alarms in the recordings that it allows, and the time missing for the
        wished rate (min).
    hours_, forces_
        Counted time (h), and lowest and highest recorded mean force (N).
    level_raised_
        Factor on the levels that the running finger needed.
    warnings_, seconds_
        Sentences, each also raised as a TuneWarning, and the time of the computation (s).
    """

    Options: ClassVar[type[Options]] = ContactTuningOptions
    options: ContactTuningOptions

    @property
    def method(self) -> str:
        """Method of the detection."""
        return self.options.method

    @property
    def confidence(self) -> float:
        """Probability that the rate of false alarms is not exceeded."""
        return self.options.confidence

    def tune(self, recordings: RecordingSource | Sequence[RecordingSource], *, checked: bool = False) -> ContactTuning:
        """Tune on recordings of free motion.

        Parameters
        ----------
        recordings
            Recordings, DataFrames or files.
        checked
            Whether the caller has compared the recordings with the finger and reported the findings.

        Returns
        -------
        ContactTuning
            The object itself.

        Raises
        ------
        InputError
            A recording has contact or is not sound, or an option is out of range.
        NotEnough
            There is no free motion, or with `strict` too little.
        """
        begin = perf_counter()
        self.start_ = read_finger(self.finger)
        parts = self._parts(listed_sources(recordings), checked)
        self.hours_ = sum(part.hours for part in parts)
        self.cells_ = cells_of(parts)
        self.forces_ = (float(self.cells_.force.min()), float(self.cells_.force.max()))
        wished, confidence, strict = self.options.false_alarms_per_hour, self.confidence, self.options.strict
        support = supported(self.cells_, self.hours_, wished, confidence, strict)
        self.rate_, self.allowed_, self.more_minutes_ = support.rate, support.allowed, support.more
        self.warnings_ += support.sentences
        self._run(parts)
        self._choose()
        self.rest_: RestRule | None
        self.rest_, sentences = learn_rest(self.start_.data, parts, wished, confidence)
        self.warnings_ += sentences
        self.sensors_: SensorRule = learn_sensors(self.start_.data, parts)
        self._close_the_loop(parts)
        self.pretensions_ = self._by_pretension()
        self.seconds_ = perf_counter() - begin
        self._judge()
        for sentence in self.warnings_:
            warnings.warn(sentence, TuneWarning, stacklevel=3)  # at the call of tendonfmu.tune
        return self

    # --- recordings ---------------------------------------------------------------------------------------------------

    def _parts(self, sources: Sequence[RecordingSource], checked: bool) -> list[FreePart]:
        check_given_once(sources, [])
        if not sources:
            raise InputError("no recording; expected at least one of free motion")
        recordings = read_recordings(sources)
        parts: list[FreePart] = []
        self.warnings_: list[str] = [] if checked else admit(self.start_, recordings)
        for recording in recordings:
            of_recording, sentences = free_parts(self.start_, recording, self.options.kinematics)
            parts += of_recording
            self.warnings_ += [] if checked else [f"{recording.path}: {sentence}" for sentence in sentences]
        if not any(part.counted.any() for part in parts):
            raise NotEnough("no free motion after the first 2 s of a recording; expected minutes of it", 0.0)
        return parts

    # --- bias, bounds, levels -----------------------------------------------------------------------------------------

    def _run(self, parts: Sequence[FreePart]) -> None:
        """Find the noise of the bias, in rounds: residuals depend on the bias, and its noise on the residuals."""
        given = self.start_.data["contact"].get("friction_bound") or {}
        jump, stuck = self.options.jump_time, self._stuck_time()
        if self.method == "threshold":  # this method keeps the friction bound
            jump, stuck = float(given.get("jump_time") or jump), float(given.get("stuck_time") or 0.0)
        clock = Clock(self.options.innovation_time, jump, stuck)
        time = wanted_time(self.start_, parts, self.options.bias_time)
        bias = self.start_.data.get("bias") or {}
        start = START_SHARE if bias.get("start_share") is None else bias["start_share"]
        data = {**self.start_.data, "bias": {**bias, "start_share": start}}
        if self.method != "threshold" and self._slides():
            data["contact"] = {**data["contact"], "friction_bound": {**given, "stuck_presliding": True}}
        for _ in range(2):
            self.runs_: list[FreeRun] = run_free(data, parts, clock)
            self.bias_: BiasNoise = bias_noise(data, self.runs_, self.cells_, time)
            data = {**data, "bias": {**(data.get("bias") or {}), **self.bias_.keys()}}
        self.runs_ = run_free(data, parts, clock)
        self._data = data

    def _slides(self) -> bool:
        return any(row["effect"] == "presliding" for row in self.start_.data.get("extensions") or [])

    def _stuck_time(self) -> float:
        """Return T_H (s)."""
        if self.options.stuck_time is not None:
            return self.options.stuck_time
        return STUCK_TIME_PRESLIDING if self._slides() else STUCK_TIME

    def _choose(self) -> None:
        """Choose the lines of `contact.innovation` and `contact.threshold`, and their levels."""
        contact = self.start_.data["contact"]
        second = self.allowed_ // SECOND_SHARE
        level = contact.get("uncertainty_level")
        slow = self._residual(USUAL_LEVEL if level is None else float(level))
        self.searches_: dict[str, Search] = {"residual": slow}
        self.lines_: dict[str, Line] = {}
        self.levels_: dict[str, Level] = {}
        if self.method == "threshold":
            given = contact.get("friction_bound") or {}
            pair = (float(given.get("stuck_share") or 0.0), float(given.get("jump_share") or 0.0))
            self.lines_["residual"] = given_line(slow, pair, self.allowed_)
            self.levels_["residual"] = level_of(self.lines_["residual"], self.cells_, self.allowed_)
            return
        fast = search_for(self.runs_, self.cells_, "innovation", self.rate_)
        line = searched_line(fast, self.allowed_)
        if self.progress is not None:
            self.progress(1, 25)
        behind = given_line(slow, SHARES, second)
        if slow.uncertain is not None and level is None and self.cells_.groups > 1:
            low = self._residual(LOW_LEVEL)
            other = given_line(low, SHARES, second)
            if other.mean_log < behind.mean_log - CLEAR:
                behind, self.searches_["residual"] = other, low
                self._data["contact"] = {**self._data["contact"], "uncertainty_level": LOW_LEVEL}
        self.lines_["residual"] = behind
        self.levels_["residual"] = above = level_of(behind, self.cells_, second)
        if self.method == "cusum":
            line = evidence_line(fast, line, [run.part for run in self.runs_], self.options.evidence_time)
        self._choose_drift(second)
        order, factor = self.cells_.order, above.factor
        above_others, held_above = behind.statistic > factor, behind.held > factor
        if "drift" in self.lines_:
            drift, drifted = self.lines_["drift"], self.levels_["drift"].factor
            above_others, held_above = above_others | (drift.statistic > drifted), held_above | (drift.held > drifted)
        others, held = order[above_others], order[held_above]
        self.lines_["innovation"] = line
        self.levels_["innovation"] = level_of(line, self.cells_, self.allowed_, others, held)
        self.searches_["innovation"] = fast

    def _residual(self, level: float) -> Search:
        """Prepare the search of the residual's bound beside `level` standard deviations of the modelled friction."""
        return search_for(self.runs_, self.cells_, "residual", self.rate_, level)

    def _choose_drift(self, allowed: int) -> None:
        """Choose the line of `contact.drift` for slow loads; jumps of friction and stiction do not raise it."""
        if 60.0 * self.hours_ < LEAST_DRIFT:
            self.warnings_.append(
                f"contact.drift is left out, so slow loads are not found: {60 * self.hours_:.1f} min of free motion; "
                f"expected {LEAST_DRIFT:g} min or more"
            )
            return
        slow = search_for(self.runs_, self.cells_, "drift", self.rate_)
        self.lines_["drift"] = line = given_line(slow, (0.0, 0.0), allowed)
        self.levels_["drift"] = level_of(line, self.cells_, allowed)
        self.searches_["drift"] = slow

    # --- the finger as it runs ----------------------------------------------------------------------------------------

    def _close_the_loop(self, parts: Sequence[FreePart]) -> None:
        """Raise the level until the tuned finger, whose bias stops in contact, also keeps the rate."""
        raised = 1.0
        for _ in range(_STEPS):
            self.bounds_: dict[str, Bound] = {
                name: line.bound.scaled(raised * self.levels_[name].factor) for name, line in self.lines_.items()
            }
            main = self.bounds_.get("innovation", self.bounds_["residual"])
            self.deviation_: Deviation = deviation(self.runs_, self.cells_, main)
            data = self._tuned()
            self.loop_: list[LoopAlarms] = count_loop(data, parts)
            if sum(loop.alarms for loop in self.loop_) <= self.allowed_:
                break
            raised *= _STEP
        self.level_raised_ = raised
        self.description_ = finger_from_data(data, self.start_.path)

    def _tuned(self) -> dict[str, Any]:
        """Return the description with everything that was learned."""
        data = own_copy(self._data)
        contact: dict[str, Any] = {**data["contact"], "method": self.method}
        for key in ("innovation", "threshold", "threshold_per_force", "drift"):
            contact.pop(key, None)
        contact |= _keys_of(self.bounds_["residual"])
        if self.method != "threshold":
            fast = self.bounds_["innovation"]
            contact["innovation"] = {
                "time": self.options.innovation_time,
                **_keys_of(fast),
                **({"evidence_time": self.options.evidence_time} if self.method == "cusum" else {}),
            }
            contact["friction_bound"] = {
                **(contact.get("friction_bound") or {}),
                "stuck_share": fast.stuck_share,
                "stuck_time": self._stuck_time(),
                "jump_share": fast.jump_share,
                "jump_time": self.options.jump_time,
            }
        if "drift" in self.bounds_:
            contact["drift"] = _keys_of(self.bounds_["drift"])
        contact |= {
            "deviation": rounded(self.deviation_.base, _DIGITS),
            "deviation_per_force": rounded(self.deviation_.per_force, _DIGITS),
            **RELEASE,
        }
        contact.pop("release_time", None)
        if math.isfinite(self.options.release_time):
            contact["release_time"] = self.options.release_time
        if self.rest_ is not None:
            contact["rest"] = dict(self.rest_.keys)
        data = {key: value for key, value in data.items() if key != "sensor_fault"}
        if self.sensors_.keys is not None:
            data["sensor_fault"] = dict(self.sensors_.keys)
        return {**data, "contact": contact}

    # --- counted alarms -----------------------------------------------------------------------------------------------

    def tail(self, factors: Numbers) -> list[tuple[float, int, int]]:
        """Count the alarms with the bases of all bounds times a factor.

        Parameters
        ----------
        factors
            Factors on the chosen bounds.

        Returns
        -------
        list of tuple
            (factor, alarms in sample, alarms held out).
        """
        return [
            (float(factor), self._alarms("statistic", float(factor)), self._alarms("held", float(factor)))
            for factor in factors
        ]

    def _alarms(self, which: str, factor: float) -> int:
        above = np.zeros(len(self.cells_.order), dtype=bool)
        for name, line in self.lines_.items():
            above |= getattr(line, which) > factor * (self.level_raised_ * self.levels_[name].factor)
        return alarms_above(self.cells_.order, above)

    def _by_pretension(self) -> list[Pretension]:
        pretensions = []
        square = self.searches_["residual"].mean_square
        for g, (force, hours) in enumerate(hours_by_pretension(self.cells_)):
            rows = self.cells_.group == g
            alarms = sum(self.cells_.alarms_at(g, loop.part, loop.begins) for loop in self.loop_)
            rms = [float(value) for value in np.sqrt(square[rows].mean(axis=0))]
            pretensions.append(Pretension(force, hours, rms, alarms, rate_limit(alarms, hours, self.confidence)))
        return pretensions

    def _judge(self) -> None:
        held = self._alarms("held", 1.0)
        self.held_out_ = (held, rate_limit(held, self.hours_, self.confidence))
        alarms = sum(loop.alarms for loop in self.loop_)
        if alarms > self.allowed_:
            self.warnings_.append(
                f"the tuned finger alarms {counted(alarms, 'time')} in {60 * self.hours_:.1f} min even with bounds "
                f"{self.level_raised_:.2f} times as high; expected at most {self.allowed_}"
            )
        if held > self.allowed_:
            self.warnings_.append(
                f"{counted(held, 'alarm')} in the held-out halves, {self.allowed_} {are(self.allowed_)} "
                "allowed: the rate is not supported"
            )
        self.warnings_ += self._sentences()

    def _sentences(self) -> list[str]:
        sentences = []
        least = least_hours(self.rate_, self.confidence)
        short = [
            f"{rate_limit(0, each.hours, self.confidence):.0f} per hour with {60 * each.hours:.1f} min at "
            f"{each.force:.3g} N (record {60 * (least - each.hours):.1f} min more)"
            for each in self.pretensions_
            if each.hours < least and len(self.pretensions_) > 1
        ]
        if short:
            sentences.append(f"the rate holds for all pretensions together; at one alone it may be {', '.join(short)}")
        if len(self.pretensions_) == 1:
            low, high = self.forces_
            sentences.append(
                f"one pretension, {self.pretensions_[0].force:.3g} N: the growth with the force is not known, so "
                f"thresholds are constants and hold for mean tendon forces of {low:.3g} to {high:.3g} N; at "
                "lower forces they miss more, at higher ones there are more false alarms; record several pretensions"
            )
        start = sum(loop.at_start for loop in self.loop_)
        if start:
            sentences.append(
                f"{counted(start, 'alarm')} within 2 s of a start {are(start)} not counted: bias.initial_variance is "
                "too small"
            )
        wide = [self.start_.joint_names[j] for j in np.flatnonzero(self.deviation_.too_wide)]
        if wide:
            sentences.append(
                f"compensated_torque_std is too large at {', '.join(wide)}: bounds alone exceed the residuals"
            )
        return sentences

    def description_text(self) -> str:
        """Return the tuned description as JSON, as `tendonfmu tune -o` writes it."""
        return description_text(self.description_.data)


def _keys_of(bound: Bound) -> dict[str, list[float]]:
    return {"threshold": rounded(bound.base, _DIGITS), "threshold_per_force": rounded(bound.per_force, _DIGITS)}
