"""Tunes contact detection on free motion for a stated rate of false alarms, in the manner of scikit-learn.

Examples
--------
>>> tuning = ContactTuning("fitted.json", false_alarms_per_hour=6).tune(["free_10N.parquet", "free_40N.parquet"])
>>> tuning.description_
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import minimize

from tendonfmu.arrays import Data, Flags, Numbers, rounded
from tendonfmu.detect.free_motion import Alarms, FreePart, count_alarms, free_parts, runs_of
from tendonfmu.detect.learning import (
    ClosedLoop,
    Terms,
    bands_of,
    close_the_loop,
    levels_of,
    motors_of,
    numbers_of,
    run_free,
    seconds_of,
    weights_of,
)
from tendonfmu.detect.noise import (
    BiasNoise,
    Deviation,
    Residuals,
    bias_noise,
    deviation,
    line_over_force,
    noise_time,
    residuals_of,
    wanted_time,
)
from tendonfmu.detect.sensor_faults import SensorRule, learn_sensors
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import are, counted
from tendonfmu.model import Finger, FingerSource, moment_arms, read_finger
from tendonfmu.options import TuneOptions
from tendonfmu.recordings import RecordingSource, admit, listed_sources, read_recordings

# --- pushes that are found --------------------------------------------------------------------------------------------
# A push of torque t at a joint turns the joints by Δq = −(RᵀKR)⁻¹·t and changes the tendon forces by −K·R·Δq, as with
# motors that stand firm.


EVERY = (2.5, 3.5)  # s, from one push to the next
RISE, HELD = 0.02, 0.3  # s
SIZES = (1.0, 40.0)  # times the rms of the residual
WITHIN = 0.06  # s after its onset in which a push is found
SURE = 0.9  # share of the pushes of a size that are found
LONGEST = 1200.0  # s of motion, for each joint
SLOPES = (0.5, 20.0)  # of the log odds over the log of the size


def push_sizes(finger: Finger, parts: Sequence[FreePart], rms: Numbers) -> Numbers:
    """Return by joint [n] the torque of which `SURE` are found within `WITHIN`; NaN if that is beyond `SIZES` (N·m)."""
    seconds = sum(float(part.seconds.sum()) for part in parts)
    used = [part.cut(np.arange(int(len(part.time) * min(1.0, LONGEST / seconds)))) for part in parts]
    used = [part for part in used if part.counted.any()]
    sizes = np.full(len(rms), np.nan)
    for j, left in enumerate(rms):
        random = np.random.default_rng(j)
        pushes = [_pushes(part, left, random) for part in used]
        loaded = [pushed_part(finger.data, part, j, *each) for part, each in zip(used, pushes, strict=True)]
        found = [
            _found(part.time, outputs["contact"].ravel().astype(bool), onset)
            for (part, outputs), (onset, _) in zip(runs_of(finger, loaded), pushes, strict=True)
        ]
        sizes[j] = size_found(np.abs(np.concatenate([size for _, size in pushes])), np.concatenate(found))
    return np.where(sizes <= SIZES[1] * rms, sizes, np.nan)


def size_found(sizes: Numbers, found: Flags) -> float:
    """Return the size of which `SURE` are found, by logistic regression of found [p] on the log of the sizes [p]."""
    if not found.any():
        return float("nan")
    middle = float(np.log(sizes).mean())
    x, sign = np.log(sizes) - middle, np.where(found, 1.0, -1.0)

    def loss(line: Numbers) -> float:
        return float(np.logaddexp(0.0, -sign * (line[0] + line[1] * x)).sum())

    level, slope = minimize(loss, np.array([0.0, 2.0]), method="L-BFGS-B", bounds=[(None, None), SLOPES]).x
    return float(np.exp(middle + (np.log(SURE / (1.0 - SURE)) - level) / slope))


def _pushes(part: FreePart, rms: float, random: np.random.Generator) -> tuple[Numbers, Numbers]:
    """Return the onsets [p] (s) and the torques [p] (N·m) of pushes in counted time."""
    count = int((part.time[-1] - part.time[0]) / EVERY[0]) + 1
    onset = part.time[0] + np.cumsum(random.uniform(*EVERY, count))
    factor = np.exp(random.uniform(np.log(SIZES[0]), np.log(SIZES[1]), count))
    size = rms * factor * random.choice([-1.0, 1.0], count)
    rows = np.searchsorted(part.time, onset)
    kept = onset < part.time[-1] - HELD
    kept[kept] = part.counted[rows[kept]]
    return onset[kept], size[kept]


def pushed_part(data: Data, part: FreePart, joint: int, onset: Numbers, size: Numbers) -> FreePart:
    """Return the part with pushes at a joint."""
    torque, time = np.zeros(len(part.time)), part.time
    for at, own in zip(onset, size, strict=True):
        rows = slice(*np.searchsorted(time, [at, at + HELD]))
        since = np.minimum(time[rows] - at, at + HELD - time[rows])
        torque[rows] = own * np.clip(since / RISE, 0.0, 1.0)
    arms = moment_arms(data)
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]], dtype=float)
    turned = -np.linalg.pinv(arms.T * stiffness @ arms)[joint]
    arrays = dict(part.arrays)
    arrays["tendon_force"] = arrays["tendon_force"] - np.outer(torque, stiffness * (arms @ turned))
    if "joint_position" in arrays:
        arrays["joint_position"] = arrays["joint_position"] + np.outer(torque, turned)
    if "joint_velocity" in arrays:
        arrays["joint_velocity"] = arrays["joint_velocity"] + np.outer(np.gradient(torque, time), turned)
    return replace(part, arrays=arrays)


def _found(time: Numbers, contact: Flags, onset: Numbers) -> Flags:
    """Return [p] whether contact begins within `WITHIN` of an onset."""
    first, end = np.searchsorted(time, onset), np.searchsorted(time, onset + WITHIN, side="right")
    return np.array([contact[a:b].any() and not contact[a - 1] for a, b in zip(first, end, strict=True)], dtype=bool)


RECORDINGS, MOST = 3, 10  # from so many on, whole recordings are left out, of more several at once; else quarters


# --- the bounds -------------------------------------------------------------------------------------------------------

QUARTERS = 4
EXPECTED = 3.0  # alarms at the rate asked for, below which the motion is too short to show it
_DIGITS = 6
Rule = tuple[Numbers, ...]  # numbers of the bands [n, 4, 6]; or base and slope [n] of the paper's threshold


class TuneWarning(UserWarning):
    """A remark of a tuning on its recordings and its result."""


class NotEnough(InputError):
    """There is too little free motion to learn from."""


@dataclass(frozen=True)
class KeptOut:
    """The finger on motion that its numbers were not learned from."""

    parts: Sequence[Alarms]
    seconds: float  # all time (s)

    @property
    def alarms(self) -> int:
        """Number of false alarms."""
        return sum(len(part.begins) for part in self.parts)

    @property
    def hours(self) -> float:
        """Counted time (h)."""
        return sum(part.hours for part in self.parts)

    @property
    def share_in_alarm(self) -> float:
        """Share of the time in alarm."""
        return sum(part.seconds for part in self.parts) / self.seconds


class ContactTuning:
    """Tunes contact detection from recordings of free motion.

    Parameters
    ----------
    finger
        Description: its file, parsed JSON, or the result of `read_finger`.
    **options
        The options of `tendonfmu.tune`, `progress` among them, with the same names and defaults.

    Attributes
    ----------
    description_
        Tuned description.
    bias_, deviation_
        Noise of the bias, and standard deviation of the estimated torque.
    loop_, kept_out_
        Factors on all bounds with their alarms, and the alarms in motion that was kept out.
    push_
        By joint, the sudden torque of which nine of ten are found within 60 ms; NaN if none is (N·m).
    residuals_, hours_
        Residuals of all free motion, and its counted time (h).
    sensors_
        Rule for failing sensors (sensor_fault).
    warnings_, seconds_
        Sentences, each also raised as a TuneWarning, and the time of the computation (s).
    """

    def __init__(self, finger: FingerSource, **options: Any) -> None:
        self.finger, self.options = finger, TuneOptions(**options)

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
            There is too little free motion.
        """
        begin = perf_counter()
        self._start: Finger = read_finger(self.finger)
        self._data: dict[str, Any] = {**self._start.data, "sensor_fault": None}
        self._groups = groups_of(self._parts(listed_sources(recordings), checked))
        parts = [part for group in self._groups for part in group]
        self.hours_ = sum(part.hours for part in parts)
        self._motors = motors_of(parts)
        terms = self._learn_bias(parts)
        self.sensors_: SensorRule = learn_sensors(self._data, parts)
        self._data = {key: value for key, value in self._data.items() if key != "sensor_fault"}
        if self.sensors_.keys is not None:
            self._data["sensor_fault"] = dict(self.sensors_.keys)
        rule = self._learn_rule(terms)
        self.description_ = self._with(rule, learned=True)
        left = np.sqrt(np.mean(self.residuals_.residual**2, axis=0))
        self.push_: Numbers = push_sizes(self.description_, parts, left)
        self.seconds_ = perf_counter() - begin
        self._judge()
        for sentence in self.warnings_:
            warnings.warn(sentence, TuneWarning, stacklevel=4)  # at the call of tendonfmu.tune
        return self

    def _parts(self, sources: Sequence[RecordingSource], checked: bool) -> list[FreePart]:
        check_given_once(sources, [])
        if not sources:
            raise InputError("no recording; expected at least one of free motion")
        recordings = read_recordings(sources)
        parts: list[FreePart] = []
        self.warnings_: list[str] = [] if checked else admit(self._start, recordings)
        for recording in recordings:
            of_recording, sentences = free_parts(self._start, recording, self.options.kinematics)
            parts += of_recording
            self.warnings_ += [] if checked else [f"{recording.path}: {sentence}" for sentence in sentences]
        return parts

    # --- what is learned ----------------------------------------------------------------------------------------------

    def _learn_bias(self, parts: Sequence[FreePart]) -> list[Terms]:
        """Learn noise and drift of the bias in rounds, since the residuals depend on the bias; return the terms."""
        time = wanted_time(self._start, parts, self.options.bias_time)
        of_bias = noise_time(self._start.data, parts)
        for _ in range(2):
            terms, runs = run_free(self._data, parts)
            self.residuals_: Residuals = residuals_of(parts, runs)
            self.bias_: BiasNoise = bias_noise(self.residuals_, of_bias, time)
            self._data["bias"] = {**(self._data.get("bias") or {}), **self.bias_.keys()}
        self.deviation_: Deviation = deviation(self.residuals_)
        return terms

    def _learn_rule(self, terms: Sequence[Terms]) -> Rule:
        """Learn from all groups, and the factor from each group with what the others say."""
        owner = np.repeat(np.arange(len(self._groups)), [len(group) for group in self._groups])
        rules = []
        for group in (*range(len(self._groups)), -1):
            rules.append(self._rule([part for part, own in zip(terms, owner, strict=True) if own != group]))
            self._show(len(rules), 2 * len(self._groups) + 1)

        def run(group: int, factor: float) -> list[Alarms]:
            return count_alarms(self._with(rules[group], factor), self._groups[group])

        hours = np.array([sum(part.hours for part in group) for group in self._groups])
        self.loop_: ClosedLoop = close_the_loop(
            lambda group, factor: sum(len(part.begins) for part in run(group, factor)),
            hours,
            self.options.false_alarms_per_hour,
        )
        kept_out = [part for group, factor in enumerate(self.loop_.kept_out) for part in run(group, float(factor))]
        seconds = sum(float(part.seconds.sum()) for group in self._groups for part in group)
        self.kept_out_ = KeptOut(kept_out, seconds)
        return tuple(self.loop_.factor * numbers for numbers in rules[-1])

    def _rule(self, terms: Sequence[Terms]) -> Rule:
        if self.options.method == "paper":
            force = self.residuals_.of_pretensions(self.residuals_.force)
            lines = [line_over_force(force, column) for column in self.residuals_.rms().T]
            return tuple(np.array(lines).T)
        weights = weights_of(terms)
        levels = levels_of(seconds_of(terms, weights), self.options.false_alarms_per_hour)
        return (numbers_of(weights, levels),)

    def _with(self, rule: Rule, factor: float = 1.0, learned: bool = False) -> Finger:
        """Return the finger that decides by a rule; with everything that was learned, if wanted."""
        given = self._start.data["contact"]
        contact = {key: given[key] for key in ("threshold", "threshold_per_force") if given.get(key) is not None}
        contact["method"] = self.options.method
        if self.options.method == "paper":
            contact["threshold"], contact["threshold_per_force"] = (rounded(factor * each, _DIGITS) for each in rule)
        else:
            contact |= {"bands": bands_of(factor * rule[0]), **self._motors}
        if learned:
            contact["deviation"] = rounded(self.deviation_.base, _DIGITS)
            contact["deviation_per_force"] = rounded(self.deviation_.per_force, _DIGITS)
        return self._start.with_data({**self._data, "contact": contact})

    def _show(self, done: int, steps: int) -> None:
        if self.options.progress is not None:
            self.options.progress(done, steps)

    # --- what is said -------------------------------------------------------------------------------------------------

    def _judge(self) -> None:
        rate, minutes = self.options.false_alarms_per_hour, 60.0 * self.hours_
        self.more_minutes_ = max(0.0, 60.0 * EXPECTED / rate - minutes)
        if self.more_minutes_:
            self.warnings_.append(
                f"{minutes:.1f} min of free motion show a rate of {rate:g} false alarms an hour only by extrapolation; "
                f"record {self.more_minutes_:.1f} min more"
            )
        force = self.residuals_.force
        if self.residuals_.group.max() == 0:
            self.warnings_.append(
                f"one pretension, {self.residuals_.mean_force:.3g} N: how the bounds grow with the force is learned "
                f"from {force.min():.3g} to {force.max():.3g} N alone; record several pretensions"
            )
        start = sum(part.at_start for part in self.kept_out_.parts)
        if start:
            self.warnings_.append(
                f"{counted(start, 'alarm')} before 2 s of motion {are(start)} not counted: how friction stands there "
                "is not known"
            )
        wide = [self._start.joint_names[j] for j in np.flatnonzero(self.deviation_.too_wide)]
        if wide:
            self.warnings_.append(
                f"compensated_torque_std is too large at {', '.join(wide)}: that of the bias exceeds the residuals"
            )


# --- what is left out together ----------------------------------------------------------------------------------------


def groups_of(parts: Sequence[FreePart]) -> list[list[FreePart]]:
    """Divide free motion: each recording is a group, or, of few recordings, each quarter of their time."""
    sources = list(dict.fromkeys(part.source for part in parts))
    of_source = [[part for part in parts if part.source == source] for source in sources]
    groups = [[part for recording in of_source[k::MOST] for part in recording] for k in range(MOST)]
    if len(sources) < RECORDINGS:
        quarters = [_quarters(recording) for recording in of_source]
        groups = [[part for recording in quarters for part in recording[k]] for k in range(QUARTERS)]
    groups = [[part for part in group if part.counted.any()] for group in groups]
    groups = [group for group in groups if group]
    if len(groups) < 2:
        raise NotEnough("no free motion after the first 2 s of motion of a recording; expected minutes of it")
    return groups


def _quarters(parts: Sequence[FreePart]) -> list[list[FreePart]]:
    """Divide the parts of a recording by time."""
    ends = np.cumsum([0.0, *(part.seconds.sum() for part in parts)])
    quarters: list[list[FreePart]] = [[] for _ in range(QUARTERS)]
    for part, before in zip(parts, ends, strict=False):
        of_sample = np.minimum((before + np.cumsum(part.seconds)) / ends[-1] * QUARTERS, QUARTERS - 1e-9).astype(int)
        for k in np.unique(of_sample):
            quarters[k].append(part.cut(np.flatnonzero(of_sample == k)))
    return quarters
