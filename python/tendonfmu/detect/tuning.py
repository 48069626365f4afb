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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect.alarm_level import alarms_above, cells_of, least_hours, rate_limit
from tendonfmu.detect.bounds import Bound, Search, search_for
from tendonfmu.detect.closed_loop import LoopAlarms, count_loop
from tendonfmu.detect.contact_at_rest import RestRule, learn_rest
from tendonfmu.detect.free_motion import Clock, FreePart, FreeRun, free_parts, run_free
from tendonfmu.detect.level import SECOND_SHARE, Level, Line, evidence_line, given_line, level_of, searched_line
from tendonfmu.detect.noise import BiasNoise, Deviation, bias_noise, deviation, wanted_time
from tendonfmu.detect.sensor_faults import SensorRule, learn_sensors
from tendonfmu.detect.support import NotEnough, hours_by_pretension, supported
from tendonfmu.errors import InputError
from tendonfmu.estimate import ConstructorArguments, check_given_once, own_copy
from tendonfmu.files import are, counted
from tendonfmu.model import FingerSource, description_text, finger_from_data, read_finger
from tendonfmu.recordings import RecordingSource, admit, listed_sources, read_recordings

METHODS = ("innovation", "cusum", "threshold")
INNOVATION_TIME = 0.05  # s, T
JUMP_TIME = 0.06  # s, T_J
STUCK_TIME = 0.25  # s, T_H
STUCK_TIME_PRESLIDING = 0.06  # s, if presliding models how friction reverses after break-away
EVIDENCE_TIME = 0.02  # s, τ_e
RELEASE = {"release_ratio": 1.0, "hold_time": 0.05}  # 1, s
RELEASE_TIME = 2.0  # s
LEAST_DRIFT = (
    10.0  # min of free motion: 60 of the slow means that contact.drift compares with, more than a fit could adapt to
)
START_SHARE = 1.0  # bias.start_share: before the start all friction may point in either direction
_STEP, _STEPS = 1.05, 12  # factor on the level, and most steps, until the running finger keeps the rate
_DIGITS = 6


class TuneWarning(UserWarning):
    """A remark of a tuning on its recordings and its result."""


@dataclass(frozen=True)
class Pretension:
    """Free motion at one pretension."""

    force: float
    hours: float
    rms: list[float]
    alarms: int
    limit: float


class ContactTuning(ConstructorArguments):
    """Tunes contact detection from recordings of free motion.

    Parameters
    ----------
    finger
        Description: its file, parsed JSON, or the result of `read_finger`.
    false_alarms_per_hour, confidence
        Highest rate of false alarms in free motion like that of the recordings (1/h), and the probability that it is
        not exceeded.
    method
        "innovation", "cusum" or "threshold" (contact.method).
    bias_time
        Time constant of the bias (s); None: that of the description, at the mean force of the recordings.
    release_time
        Time in contact after which the bias is tracked again (s); math.inf: never.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    strict
        Whether to refuse too little free motion for the rate. Otherwise the tuning is for the rate that it supports.
    innovation_time, jump_time, stuck_time, evidence_time
        Values of these keys (s). stuck_time None: chosen by whether the description has presliding.
    progress
        Called with steps done and steps.

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

    def __init__(
        self,
        finger: FingerSource,
        *,
        false_alarms_per_hour: float = 6.0,
        confidence: float = 0.9,
        method: str = "innovation",
        bias_time: float | None = None,
        release_time: float = RELEASE_TIME,
        kinematics: int = 1,
        strict: bool = False,
        innovation_time: float = INNOVATION_TIME,
        jump_time: float = JUMP_TIME,
        stuck_time: float | None = None,
        evidence_time: float = EVIDENCE_TIME,
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self.finger = finger
        self.false_alarms_per_hour = false_alarms_per_hour
        self.confidence = confidence
        self.method = method
        self.bias_time = bias_time
        self.release_time = release_time
        self.kinematics = kinematics
        self.strict = strict
        self.innovation_time = innovation_time
        self.jump_time = jump_time
        self.stuck_time = stuck_time
        self.evidence_time = evidence_time
        self.progress = progress

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
        self._check_options()
        self.start_ = read_finger(self.finger)
        parts = self._parts(listed_sources(recordings), checked)
        self.hours_ = sum(part.hours for part in parts)
        self.cells_ = cells_of(parts)
        self.forces_ = (float(self.cells_.force.min()), float(self.cells_.force.max()))
        self._support()
        self._run(parts)
        self._choose()
        self._learn_rest(parts)
        self.sensors_: SensorRule = learn_sensors(self.start_.data, parts, self.kinematics)
        self._close_the_loop(parts)
        self.pretensions_ = self._by_pretension()
        self.seconds_ = perf_counter() - begin
        self._judge()
        for sentence in self.warnings_:
            warnings.warn(sentence, TuneWarning, stacklevel=4)  # at the call of tendonfmu.tune
        return self

    def _check_options(self) -> None:
        checks = (
            (self.method in METHODS, "method", " or ".join(METHODS)),
            (0 < self.false_alarms_per_hour <= 3600, "false_alarms_per_hour", "above 0 and at most 3600, 1/h"),
            (0.5 <= self.confidence < 1, "confidence", "from 0.5 to below 1"),
            (self.bias_time is None or 1e-3 <= self.bias_time <= 1e4, "bias_time", "from 0.001 to 10000 s"),
            (0 <= self.release_time <= 1e9 or self.release_time == math.inf, "release_time", "0 to 1e9 s, or inf"),
            (self.kinematics in (1, 2, 3), "kinematics", "1, 2 or 3"),
            (0 < self.innovation_time <= 100, "innovation_time", "above 0 and at most 100 s"),
            (0 < self.jump_time <= 100, "jump_time", "above 0 and at most 100 s"),
            (self.stuck_time is None or 0 <= self.stuck_time <= 100, "stuck_time", "0 to 100 s"),
            (0 < self.evidence_time <= 100, "evidence_time", "above 0 and at most 100 s"),
        )
        for sound, name, expectation in checks:
            if not sound:
                raise InputError(f"{name} = {getattr(self, name)!r}: expected {expectation}")

    # --- recordings ---------------------------------------------------------------------------------------------------

    def _parts(self, sources: Sequence[RecordingSource], checked: bool) -> list[FreePart]:
        check_given_once(sources, [])
        if not sources:
            raise InputError("no recording; expected at least one of free motion")
        recordings = read_recordings(sources)
        parts: list[FreePart] = []
        self.warnings_: list[str] = [] if checked else admit(self.start_, recordings)
        for recording in recordings:
            found, sentences = free_parts(self.start_, recording, self.kinematics)
            parts += found
            self.warnings_ += [] if checked else [f"{recording.path}: {sentence}" for sentence in sentences]
        if not any(part.counted.any() for part in parts):
            raise NotEnough("no free motion after the first 2 s of a recording; expected minutes of it", 0.0)
        return parts

    def _support(self) -> None:
        found = supported(self.cells_, self.hours_, self.false_alarms_per_hour, self.confidence, self.strict)
        self.rate_, self.allowed_, self.more_minutes_ = found.rate, found.allowed, found.more
        self.warnings_ += [found.sentence] if found.sentence else []

    # --- bias, bounds, levels -----------------------------------------------------------------------------------------

    def _run(self, parts: Sequence[FreePart]) -> None:
        """Find the noise of the bias, in rounds: residuals depend on the bias, and its noise on the residuals."""
        given = self.start_.data["contact"].get("friction_bound") or {}
        jump, stuck = self.jump_time, self._stuck_time()
        if self.method == "threshold":  # this method keeps the friction bound
            jump, stuck = float(given.get("jump_time") or jump), float(given.get("stuck_time") or 0.0)
        clock = Clock(self.innovation_time, jump, stuck)
        time = wanted_time(self.start_.data, parts, self.bias_time)
        bias = self.start_.data.get("bias") or {}
        start = START_SHARE if bias.get("start_share") is None else bias["start_share"]
        data = {**self.start_.data, "bias": {**bias, "start_share": start}}
        if self.method != "threshold" and self._slides():
            data["contact"] = {**data["contact"], "friction_bound": {**given, "stuck_presliding": True}}
        for _ in range(2):
            self.runs_: list[FreeRun] = run_free(data, parts, self.kinematics, clock)
            self.bias_: BiasNoise = bias_noise(data, self.runs_, self.cells_, time)
            data = {**data, "bias": {**(data.get("bias") or {}), **self.bias_.keys()}}
        self.runs_ = run_free(data, parts, self.kinematics, clock)
        self._data = data

    def _slides(self) -> bool:
        return any(row["effect"] == "presliding" for row in self.start_.data.get("extensions") or [])

    def _stuck_time(self) -> float:
        """Return T_H (s)."""
        if self.stuck_time is not None:
            return self.stuck_time
        return STUCK_TIME_PRESLIDING if self._slides() else STUCK_TIME

    def _choose(self) -> None:
        """Choose the lines of `contact.innovation` and `contact.threshold`, and their levels."""
        contact = self.start_.data["contact"]
        uncertainty = contact.get("uncertainty_level")
        level = 3.0 if uncertainty is None else float(uncertainty)
        second = self.allowed_ // SECOND_SHARE
        slow = search_for(self.runs_, self.cells_, "residual", self.rate_, level)
        self.searches_: dict[str, Search] = {"residual": slow}
        self.lines_: dict[str, Line] = {}
        self.levels_: dict[str, Level] = {}
        if self.method == "threshold":
            given = contact.get("friction_bound") or {}
            pair = (float(given.get("stuck_share") or 0.0), float(given.get("jump_share") or 0.0))
            self.lines_["residual"] = given_line(slow, [pair] * 3, self.allowed_)
            self.levels_["residual"] = level_of(self.lines_["residual"], self.cells_, self.allowed_)
            return
        fast = search_for(self.runs_, self.cells_, "innovation", self.rate_)
        line = searched_line(fast, self.allowed_, self._tick)
        self.lines_["residual"] = behind = given_line(slow, line.shares, second)
        self.levels_["residual"] = above = level_of(behind, self.cells_, second)
        if self.method == "cusum":
            line = evidence_line(fast, line, [run.part for run in self.runs_], self.evidence_time)
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

    def _choose_drift(self, allowed: int) -> None:
        """Choose the line of `contact.drift` for slow loads; jumps of friction and stiction do not raise it."""
        if 60.0 * self.hours_ < LEAST_DRIFT:
            self.warnings_.append(
                f"contact.drift is left out, so slow loads are not found: {60 * self.hours_:.1f} min of free motion; "
                f"expected {LEAST_DRIFT:g} min or more"
            )
            return
        slow = search_for(self.runs_, self.cells_, "drift", self.rate_)
        self.lines_["drift"] = line = given_line(slow, [(0.0, 0.0)] * 3, allowed)
        self.levels_["drift"] = level_of(line, self.cells_, allowed)
        self.searches_["drift"] = slow

    def _tick(self) -> None:
        self._ticks = getattr(self, "_ticks", 0) + 1
        if self.progress is not None:
            self.progress(min(self._ticks, 25), 25)

    def _bounds(self, raised: float) -> dict[str, Bound]:
        return {name: line.bound.scaled(raised * self.levels_[name].factor) for name, line in self.lines_.items()}

    def _learn_rest(self, parts: Sequence[FreePart]) -> None:
        rate, confidence = self.false_alarms_per_hour, self.confidence
        self.rest_: RestRule | None
        self.rest_, sentences = learn_rest(self.start_.data, parts, self.kinematics, rate, confidence)
        self.warnings_ += sentences

    # --- the finger as it runs ----------------------------------------------------------------------------------------

    def _close_the_loop(self, parts: Sequence[FreePart]) -> None:
        """Raise the level until the tuned finger, whose bias stops in contact, also keeps the rate."""
        raised = 1.0
        for _ in range(_STEPS):
            self.bounds_ = self._bounds(raised)
            main = self.bounds_.get("innovation", self.bounds_["residual"])
            self.deviation_: Deviation = deviation(self.runs_, self.cells_, main)
            data = self._tuned()
            self.loop_: list[LoopAlarms] = count_loop(data, parts, self.kinematics)
            if sum(each.alarms for each in self.loop_) <= self.allowed_:
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
        slow = self.bounds_["residual"]
        contact |= {"threshold": _rounded(slow.base), "threshold_per_force": _rounded(slow.per_force)}
        if self.method != "threshold":
            fast = self.bounds_["innovation"]
            contact["innovation"] = {
                "time": self.innovation_time,
                "threshold": _rounded(fast.base),
                "threshold_per_force": _rounded(fast.per_force),
                **({"evidence_time": self.evidence_time} if self.method == "cusum" else {}),
            }
            contact["friction_bound"] = {
                **(contact.get("friction_bound") or {}),
                "stuck_share": fast.stuck_share,
                "stuck_time": self._stuck_time(),
                "jump_share": fast.jump_share,
                "jump_time": self.jump_time,
            }
        if "drift" in self.bounds_:
            drift = self.bounds_["drift"]
            contact["drift"] = {"threshold": _rounded(drift.base), "threshold_per_force": _rounded(drift.per_force)}
        contact |= {
            "deviation": _rounded(self.deviation_.base),
            "deviation_per_force": _rounded(self.deviation_.per_force),
            **RELEASE,
        }
        contact.pop("release_time", None)
        if math.isfinite(self.release_time):
            contact["release_time"] = self.release_time
        if self.rest_ is not None:
            contact["rest"] = dict(self.rest_.keys)
        data = {key: value for key, value in data.items() if key != "sensor_fault"}
        if self.sensors_.keys is not None:
            data["sensor_fault"] = dict(self.sensors_.keys)
        return {**data, "contact": contact}

    # --- counted alarms -----------------------------------------------------------------------------------------------

    def _factor(self, name: str) -> float:
        return self.level_raised_ * self.levels_[name].factor

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
            above |= getattr(line, which) > factor * self._factor(name)
        return alarms_above(self.cells_.order, above)

    def _by_pretension(self) -> list[Pretension]:
        found = []
        square = self.searches_["residual"].mean_square
        for g, (force, hours) in enumerate(hours_by_pretension(self.cells_)):
            rows = self.cells_.group == g
            alarms = sum(each.alarms_in(self.cells_, g) for each in self.loop_)
            rms = [float(value) for value in np.sqrt(square[rows].mean(axis=0))]
            found.append(Pretension(force, hours, rms, alarms, rate_limit(alarms, hours, self.confidence)))
        return found

    def _judge(self) -> None:
        held = self._alarms("held", 1.0)
        self.held_out_ = (held, rate_limit(held, self.hours_, self.confidence))
        alarms = sum(each.alarms for each in self.loop_)
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
        found = []
        least = least_hours(self.rate_, self.confidence)
        for each in self.pretensions_:
            if each.hours < least and len(self.pretensions_) > 1:
                found.append(
                    f"{60 * each.hours:.1f} min at {each.force:.3g} N: alone they support no rate below "
                    f"{rate_limit(0, each.hours, self.confidence):.3g} per hour; {60 * (least - each.hours):.1f} "
                    "min more are needed"
                )
        if len(self.pretensions_) == 1:
            low, high = self.forces_
            found.append(
                f"one pretension, {self.pretensions_[0].force:.3g} N: the growth with the force is not known, so "
                f"thresholds are constants and hold for mean tendon forces of {low:.3g} to {high:.3g} N; below they "
                "miss more, above they raise more false alarms; expected recordings at several pretensions"
            )
        start = sum(each.at_start for each in self.loop_)
        if start:
            found.append(
                f"{counted(start, 'alarm')} within 2 s of a start {are(start)} not counted: bias.initial_variance is "
                "too small"
            )
        wide = [self.start_.joint_names[j] for j in np.flatnonzero(self.deviation_.too_wide)]
        if wide:
            found.append(f"compensated_torque_std is too large at {', '.join(wide)}: bounds alone exceed the residuals")
        return found

    def description_text(self) -> str:
        """Return the tuned description as JSON, as `tendonfmu tune -o` writes it."""
        return description_text(self.description_.data)


def _rounded(values: Numbers) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]
