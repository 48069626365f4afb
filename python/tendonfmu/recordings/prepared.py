"""Which samples a fit uses: a recording is checked, cut at gaps, and its samples train, are held out or left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Flags, Numbers
from tendonfmu.errors import InputError, NothingLeftError
from tendonfmu.files import are, counted, percent
from tendonfmu.model import (
    INPUTS_OF_SOURCE,
    Finger,
    bias_is_constant,
    effects,
    inputs_used,
    moment_arms,
    number_of,
    sliding_velocity,
    velocity_threshold,
    watches_motors,
)
from tendonfmu.recordings.columns import RecordingEntry
from tendonfmu.recordings.faults import SETTLING, gap_sentences, gaps, rate_sentences, silent_tendons, stuck_sensors
from tendonfmu.recordings.recording import Recording, check_numbers
from tendonfmu.recordings.residuals import Model, run_parts

FEWEST = 20  # samples of a part; fewer say nothing of a bias, let alone of friction
_LOOKED_AT = 50_000  # about so many samples are used to describe the motion
MANY_RESTS = 0.15  # of the samples
SHORTEST_BLOCK = 1.0  # s; of a held-out block


@dataclass(frozen=True)
class Held:
    """The share of time that is held out, and in which blocks."""

    share: float = 0.0  # share of time that is held out, 0 to below 1
    block: float = 10.0  # longest block (s)
    # whether to refuse a recording that is too short for blocks of `SHORTEST_BLOCK`. Otherwise its blocks are shorter
    strict: bool = False


@dataclass(frozen=True)
class FitRecording:
    """A recording that is ready for a fit."""

    recording: Recording  # the recording itself
    kinematics: int  # source of angles and speeds, 1 to 3
    target: Numbers  # torque that the model has to explain [N, n] (N·m): τ, or τ − external_torque
    train: Flags  # flags [N]; each sample has at most one of them
    held_out: Flags
    contact_out: Flags
    faulty: Flags
    silent: Flags  # [N, n] joints at rest, which say nothing: `without_rests`
    parts: list[slice]  # slices without a gap
    model: Model  # what the given finger makes of it
    warnings: list[str]  # sentences about what was left out and what is poor

    @property
    def path(self) -> Path:
        """File of the recording."""
        return self.recording.path

    @property
    def time(self) -> Numbers:
        """Times [N] (s)."""
        return self.recording.time

    @property
    def at_rest(self) -> Flags:
        """Samples [N] that are left out since all joints rest."""
        return self.silent.all(axis=1) & ~(self.contact_out | self.faulty)

    @property
    def tracked(self) -> Flags:
        """Samples [N] that the bias filter learns from when a finished fit is judged, as at run time."""
        return self.train | self.held_out | self.at_rest

    @property
    def external(self) -> Numbers | None:
        """Torque of the reference sensor [N, n] (N·m), or None."""
        return self.recording.groups.get("external_torque")

    @property
    def duration(self) -> float:
        """Duration without gaps (s)."""
        return float(sum(self.time[part.stop - 1] - self.time[part.start] for part in self.parts))

    @property
    def mean_force(self) -> float:
        """Mean magnitude of all tendon forces (N)."""
        return float(np.abs(self.recording.groups["tendon_force"]).mean())

    def arrays(self, part: slice) -> dict[str, Numbers]:
        """Return the signals of one part."""
        return {name: np.ascontiguousarray(values[part]) for name, values in self.recording.arrays().items()}

    def with_groups(self, **groups: Numbers) -> FitRecording:
        """Return the recording with other signals of some groups."""
        return replace(self, recording=replace(self.recording, groups={**self.recording.groups, **groups}))

    def run(self, finger: Finger) -> Model:
        """Run a finger over the recording; its bias learns from the tracked samples."""
        model = run_parts(finger, self.recording.arrays(), self.parts, self.tracked, self.kinematics)
        residual, variance = (np.where(self.silent, np.nan, each) for each in (model.residual, model.variance))
        return replace(model, residual=residual, variance=variance)

    def entry(self) -> RecordingEntry:
        """Return what a report says about the recording."""
        return {
            "path": str(self.path),
            "samples": len(self.time),
            "used": int(self.train.sum()),
            "held_out": int(self.held_out.sum()),
            "contact_left_out": int(self.contact_out.sum()),
            "faulty_left_out": int(self.faulty.sum()),
            "at_rest": int(self.at_rest.sum()),
            "parts": len(self.parts),
            "duration": self.duration,
            "mean_force": self.mean_force,
            "kinematics": self.kinematics,
            "external_torque": self.external is not None,
        }


def prepare(finger: Finger, recording: Recording, kinematics: int, held: Held) -> FitRecording:
    """Prepare a recording for a fit, and collect what is left out of it."""
    joints, tendons = len(finger.joint_names), len(finger.tendon_names)
    recording.require(joints, tendons, inputs_used(kinematics, watches_motors(finger.data)))
    check_numbers(recording)
    target = recording.groups["tendon_force"] @ moment_arms(finger.data)
    external = recording.groups.get("external_torque")
    contact = np.zeros(len(recording), dtype=bool)
    if external is not None:
        target = target - external
    elif recording.contact is not None:
        contact = recording.contact.copy()
    parts, short = _parts(recording.time)
    warnings = [*gap_sentences(recording), *rate_sentences(recording, finger), *silent_tendons(recording, finger)]
    if short.any() and parts:
        few = int(short.sum())
        warnings.append(f"{counted(few, 'sample')} in parts of fewer than {FEWEST} between gaps {are(few)} left out")
    stuck, sentences = _stuck(recording, finger, kinematics)
    faulty = (short | stuck) & ~contact
    usable = ~(faulty | contact)
    _refuse_too_little(recording, parts, usable, contact)
    held_out = held_out_blocks(recording, held) & usable
    if contact.any():
        out = int(contact.sum())
        warnings.append(f"{counted(out, 'sample')} labelled contact {are(out)} left out: no column external_torque")
    return FitRecording(
        recording=recording,
        kinematics=kinematics,
        target=np.asarray(target),
        train=usable & ~held_out,
        held_out=held_out,
        contact_out=contact,
        faulty=faulty,
        silent=np.zeros((len(recording), joints), dtype=bool),
        parts=parts,
        model=run_parts(finger, recording.arrays(), parts, usable, kinematics),
        warnings=[*warnings, *sentences],
    )


def without_rests(recording: FitRecording, finger: Finger, is_batch: bool) -> FitRecording:
    """Let nothing learn from samples at rest, but for a filter whose bias does. If it is constant, begin in motion."""
    is_constant = bias_is_constant(finger.data)
    silent, parts = left_at_rest(finger.data, recording.model.joint_speed), recording.parts
    rests = np.asarray(silent.all(axis=1))
    train, held_out = recording.train & ~rests, recording.held_out & ~rests
    if not (is_batch or is_constant) or not silent.any() or not train.any():
        return recording
    if is_constant:
        parts = [slice(part.start + int(np.argmin(rests[part])), part.stop) for part in parts if not rests[part].all()]
    _refuse_too_little(recording.recording, parts, train | held_out, recording.contact_out)
    left = replace(recording, train=train, held_out=held_out, silent=silent, parts=parts)
    return replace(left, model=left.run(finger))


def left_at_rest(data: Mapping[str, Any], joint_velocity: Numbers) -> Flags:
    """Return [N, n] the joints at rest that a fit leaves out. joint_velocity: [N, n] (rad/s).

    A motor holds a joint whose friction sticks everywhere with any torque up to it, |F| ≤ F(v_min), unless friction has
    a memory that says more. Few rests are no harm to a bias that learns, and a joint that never moves has no others.
    """
    turns, joints = np.array(moment_arms(data), dtype=bool), np.arange(1, joint_velocity.shape[1] + 1)
    rests = np.ones(joint_velocity.shape, dtype=bool)
    for effect in effects(data):
        still = np.abs(sliding_velocity(data, effect, joint_velocity)) <= velocity_threshold(data, effect)
        acts = turns[effect.tendon - 1] & (joints >= effect.joint) if effect.tendon else joints == effect.joint
        rests[:, acts] &= still[:, None]
    remembers = any(row["effect"] == "presliding" for row in data.get("extensions") or ())
    are_few = (rests.mean(axis=0) <= MANY_RESTS) & (not bias_is_constant(data))
    return np.asarray(rests & ~(remembers | are_few | rests.all(axis=0)))


def _parts(time: Numbers) -> tuple[list[slice], Flags]:
    """Return the slices between gaps that are long enough, and the samples [N] of those that are too short."""
    bounds = [0, *gaps(time), len(time)]
    short, parts = np.zeros(len(time), dtype=bool), []
    for begin, end in pairwise(bounds):
        if end - begin >= FEWEST:
            parts.append(slice(begin, end))
        else:
            short[begin:end] = True
    return parts, short


def _refuse_too_little(recording: Recording, parts: list[slice], usable: Flags, contact: Flags) -> None:
    if not parts:
        most = f"{counted(len(recording), 'sample')} without a gap at most"
        raise NothingLeftError(f"{recording.path}: {most}; expected at least {FEWEST}, better some minutes of motion")
    if usable.sum() >= FEWEST:
        return
    why = f"{int(contact.sum())} of {len(recording)} are labelled contact and there is no column external_torque"
    if not contact.any():
        why = "the others are at rest, or left out for a stuck sensor"
    left = f"{counted(int(usable.sum()), 'sample')} to fit to: {why}"
    raise NothingLeftError(f"{recording.path}: {left}; expected at least {FEWEST} without contact")


def slack_sentences(slack: Flags, finger: Finger) -> list[str]:
    """Describe tendons whose modelled force falls below zero. slack: [N, m]."""
    share = slack.mean(axis=0)
    return [
        f"tendon {i + 1} ({finger.tendon_names[i]}) is slack in {percent(part)} of the samples: its modelled force "
        "falls below 0 and counts as 0; expected a recording with more pretension"
        for i, part in enumerate(share)
        if part > 0
    ]


# --- stuck sensors ----------------------------------------------------------------------------------------------------


def _stuck(recording: Recording, finger: Finger, kinematics: int) -> tuple[Flags, list[str]]:
    """Return the samples [N] to leave out because of stuck sensors, and sentences. Unused channels cost no samples."""
    out, sentences = np.zeros(len(recording), dtype=bool), []
    used = {"tendon_force", *INPUTS_OF_SOURCE[kinematics]}
    time = recording.time
    for column, sensors in stuck_sensors(recording, finger).items():
        first = sensors[0]
        begin, end = time[first.begin], time[first.end - 1]
        more = f" and {len(sensors) - 1} times more" if len(sensors) > 1 else ""
        what = f"{column} stands still at {first.value:.6g} from {begin:.4g} to {end:.4g} s{more} while others move"
        lost = np.zeros(len(recording), dtype=bool)
        for sensor in sensors:
            lost |= (time >= time[sensor.begin]) & (time <= time[sensor.end - 1] + SETTLING)
        if first.group not in used:
            sentences.append(f"{what}: a stuck sensor; it is not used with kinematics {kinematics}")
            continue
        if lost.mean() > 0.5:
            share = f"in {100 * lost.mean():.0f} % of the recording"
            raise InputError(f"{recording.path}: column {what}: a stuck sensor {share}; expected a working one")
        out |= lost
        many = int(lost.sum())
        sentences.append(
            f"{what}: a stuck sensor; {counted(many, 'sample')} until {SETTLING:g} s after it {are(many)} left out"
        )
    return out, sentences


# --- hold-out ---------------------------------------------------------------------------------------------------------


def held_out_blocks(recording: Recording, held: Held) -> Flags:
    """Return the samples [N] of evenly spread blocks of time. Blocks count from the start of each part."""
    out = np.zeros(len(recording), dtype=bool)
    if not held.share:
        return out
    blocks = 0
    for part in _parts(recording.time)[0]:
        time = recording.time[part] - recording.time[part.start]
        length = min(held.block, float(time[-1]) * held.share / 2)
        if held.strict and length < SHORTEST_BLOCK:
            continue
        block = np.floor(time / length)
        # the share's multiples that a block passes: 0.2 takes blocks 4, 9, 14, ...
        out[part] = np.floor((block + 1) * held.share + 1e-9) > np.floor(block * held.share + 1e-9)
        blocks += 1
    if not blocks:
        of_it = f"{held.share:g} of it in blocks of at least {SHORTEST_BLOCK:g} s"
        expected = f"{2 * SHORTEST_BLOCK / held.share:.3g} s or more without a gap"
        raise InputError(f"{recording.path}: too short to hold out {of_it}; expected {expected}")
    return out


# --- all of them ------------------------------------------------------------------------------------------------------


def motion_of(recordings: list[FitRecording]) -> tuple[Numbers, Numbers, Numbers]:
    """Return where and how fast the joints moved in the samples that are trained on."""
    # returns joint angles [K, n] (rad), joint speeds [K, n] (rad/s), time that each sample stands for [K] (s)
    every = max(1, sum(len(recording.time) for recording in recordings) // _LOOKED_AT)
    angle, speed, share = [], [], []
    for recording in recordings:
        rows = np.flatnonzero(recording.train)[::every]
        angle.append(recording.model.joint_angle[rows])
        speed.append(recording.model.joint_speed[rows])
        share.append(_sample_time(recording)[rows] * every)
    return np.concatenate(angle), np.concatenate(speed), np.concatenate(share)


def _sample_time(recording: FitRecording) -> Numbers:
    step = np.zeros(len(recording.time))
    for part in recording.parts:
        step[part] = np.gradient(recording.time[part])
    return step


def refuse_stillness(finger: Finger, recordings: list[FitRecording], moves: Mapping[str, bool]) -> list[str]:
    """Refuse recordings without any motion, and describe joints that never move."""
    if not moves:
        return []
    if not any(moves.values()):
        files = ", ".join(str(recording.path) for recording in recordings)
        nothing = "no motion: nothing is ever faster than velocity_threshold"
        raise InputError(f"{files}: {nothing}; expected free motion of all joints (tendonfmu excite plans one)")
    threshold = number_of(finger.data, "velocity_threshold.joint")
    fastest = np.max([np.abs(part.model.joint_speed[part.train]).max(axis=0) for part in recordings], axis=0)
    return [
        f"joint {j} ({finger.joint_names[j - 1]}) never moves faster than {threshold:g} rad/s: its friction cannot "
        "be estimated and stays near its start"
        for j in np.flatnonzero(fastest <= threshold) + 1
    ]


def require_noise(finger: Finger, recordings: list[FitRecording]) -> None:
    """Refuse a finger whose residuals would get an infinite weight."""
    base, per_force = (number_of(finger.data, f"bias.{key}") for key in ("noise_std", "noise_std_per_force"))
    if base > 0:
        return
    if not per_force:
        given = "bias.noise_std = 0 and bias.noise_std_per_force = 0: every residual would count infinitely much"
        raise InputError(f"{finger.path}: {given}; expected the noise of the joint torque in N.m")
    for recording in recordings:
        silent = np.flatnonzero(~recording.recording.groups["tendon_force"].any(axis=1))
        if silent.size:
            row = f"row {int(silent[0]) + 1} of {recording.path}"
            given = f"bias.noise_std = 0, and {row} has no tendon force: its residual would count infinitely much"
            raise InputError(f"{finger.path}: {given}; expected bias.noise_std above 0 (N.m)")


# --- blocks of time ---------------------------------------------------------------------------------------------------


SHORTEST_STEP = 0.01  # s; shortest block
MOST_BLOCKS = 12_000


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording without a gap, cut into blocks with equally many samples."""

    recording: int  # its number, from 0
    part: slice  # its samples there
    first: int  # first block in the whole series, and number of blocks
    count: int
    samples: int  # samples of a block

    @property
    def blocks(self) -> slice:
        return slice(self.first, self.first + self.count)

    def mean(self, values: Array) -> Array:
        """Return block means [count, ...] of values [samples of the part, or as many as the blocks have, ...]."""
        whole = values[: self.count * self.samples]
        return np.asarray(whole.reshape(self.count, self.samples, *whole.shape[1:]).mean(axis=1))


@dataclass(frozen=True)
class Grid:
    """All segments, one after another; they are the estimator's recordings. `step` is the length of a block, s."""

    segments: tuple[Segment, ...]
    step: float

    @property
    def blocks(self) -> int:
        return sum(segment.count for segment in self.segments)

    def means(self, values: Sequence[Array]) -> Array:
        """Return block means [B, ...] of values [N, ...] of each recording."""
        return np.concatenate([segment.mean(values[segment.recording][segment.part]) for segment in self.segments])

    def forces(self, recordings: Sequence[FitRecording]) -> Numbers:
        """Return block means of the tendon forces, N [B, m]."""
        return self.means([recording.recording.groups["tendon_force"] for recording in recordings])


def make_grid(recordings: Sequence[FitRecording], shortest: float = SHORTEST_STEP) -> Grid:
    """Cut recordings into blocks of about 10 ms, or of another length (s)."""
    duration = sum(recording.duration for recording in recordings)
    step = max(shortest, duration / MOST_BLOCKS)
    segments, first = [], 0
    for number, recording in enumerate(recordings):
        samples = max(1, round(step / float(np.median(np.diff(recording.time)))))
        samples += samples % 2 if samples > 3 else 0  # runs of the core thin by whole parts of a block
        for part in recording.parts:
            count = (part.stop - part.start) // samples
            if count and recording.train[part].any():
                segments.append(Segment(number, part, first, count, samples))
                first += count
    return Grid(tuple(segments), step)
