"""How uncertain the modelled friction torque is after a fit, in the form of `contact.uncertainty`.

The form has at most four directions per joint, each a relative error of every part of the joint's friction (tendons,
joint friction, joint load friction, cover; docs/reference/semantics/detection.md#uncertainty).

With g the derivative of T_j by the unknowns and C their covariance, T_j has the variance gᵀ C g. C is that of the fit,
with the information of the data reduced by the factor by which the residuals vary more than white noise
(`estimate.evaluation.block_scores`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Indices, Numbers, rounded
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.evaluation import Evaluation, block_scores, sampled
from tendonfmu.estimate.learning import Learned, MemoryEvidence
from tendonfmu.estimate.memory_methods import windows
from tendonfmu.estimate.prior import posterior_factor
from tendonfmu.estimate.structure import Structure
from tendonfmu.model import NEVER, native
from tendonfmu.recordings import FitRecording, with_angles
from tendonfmu.statistics import error_directions

LOAD = 4.0  # times the recorded forces: the directions must also hold at other pretensions
WORST = 0.99  # quantile of the error that is reported
ROLES = ("train", "held_out")  # of samples
DIGITS = 6  # of a written number
_SAMPLES, _SIZE = 1000, 2_000_000  # most samples; most samples times joints times unknowns
_SECONDS = 120.0  # s of windows that friction with a memory is evaluated in, at least
_CHUNK = 500_000  # numbers of a Jacobian in memory
_STEP = 0.01  # s between samples that are evaluated separately; no result depends on it


@dataclass(frozen=True)
class Seen:
    """Samples of the motion, by joint."""

    parts: Numbers
    slopes: Numbers


@dataclass(frozen=True)
class Known:
    """The covariance C of the unknowns, and how much of it is due to the data."""

    factor: Numbers
    share: Numbers

    def growth(self, inflation: float) -> Numbers:
        """Return [u] the growth of the variance along each column of F if the data know `inflation` times less."""
        return np.asarray(1 / (1 - self.share + self.share / inflation))


@dataclass(frozen=True)
class JointUncertainty:
    """Uncertainty of one joint."""

    directions: list[list[float]]
    inflation: float
    captured: float
    stated: dict[str, tuple[float, float, float]]


def parameter_uncertainty(
    structure: Structure, learned: Learned, data: Data, training: Sequence[Evaluation]
) -> tuple[list[list[list[float]]], dict[str, Any]]:
    """Compute the uncertainty of the friction torque: by joint up to four lists of m + 3 numbers, and the report."""
    known = Known(*posterior_factor(learned.information, learned.prior))
    if learned.memory is None:
        estimator = Estimator(structure.start.image, structure.group, structure.scale)
        scores, block_time = block_scores(structure, learned.z, data, training, learned.weights)
        motion: Motion | RememberedMotion = Motion(estimator, learned.z, data, known)
    else:
        scores, block_time = learned.memory.scores()
        motion = RememberedMotion(learned.memory, data, known)
    scores = scores @ known.factor
    trained, held = ([np.flatnonzero(getattr(each.recording, which)) for each in training] for which in ROLES)
    seen = {"train": motion.look(training, trained), "loaded": motion.look(training, trained, LOAD)}
    if any(len(rows) for rows in held):
        seen["held_out"] = motion.look(training, held)
    joints = [
        _of_joint({which: Seen(each.parts[j], each.slopes[j]) for which, each in seen.items()}, known, scores)
        for j in range(len(data["joints"]))
    ]
    entry = {
        "blocks": len(scores),
        "block_time": block_time,
        "inflation": [joint.inflation for joint in joints],
        "directions": [len(joint.directions) for joint in joints],
        "captured": [joint.captured for joint in joints],
        "train": _stated(joints, "train"),
        "held_out": _stated(joints, "held_out") if "held_out" in seen else None,
        "loaded": _stated(joints, "loaded"),
    }
    return [joint.directions for joint in joints], entry


def _of_joint(seen: Mapping[str, Seen], known: Known, scores: Numbers) -> JointUncertainty:
    """Compute the uncertainty of one joint from its parts [K, m + 3] and slopes [K, u]."""
    inflation = inflation_of(seen["train"].slopes, known, scores)
    growth = np.sqrt(known.growth(inflation))
    slopes = {which: each.slopes * growth for which, each in seen.items()}
    std = {which: np.sqrt(error_directions.squares(each)) for which, each in slopes.items()}
    # scaled, so that the larger torques under more load do not get more weight
    size = {which: _rms(std[which]) or 1.0 for which in ("train", "loaded")}
    directions, captured = error_directions.few_directions(
        np.concatenate([seen[which].parts / size[which] for which in size]),
        np.concatenate([slopes[which] / size[which] for which in size]),
    )
    written = [rounded(row, DIGITS) for row in directions]
    stated = {}
    for which, each in seen.items():
        error = np.abs(
            error_directions.predicted(each.parts, np.array(written).reshape(-1, each.parts.shape[1])) - std[which]
        )
        stated[which] = (_rms(std[which]), _rms(error), float(np.quantile(error, WORST)))
    return JointUncertainty(written, inflation, captured, stated)


def _rms(values: Numbers) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _stated(joints: Sequence[JointUncertainty], which: str) -> dict[str, list[float]]:
    rows = zip(*(joint.stated[which] for joint in joints), strict=True)
    return dict(zip(("std", "error_rms", "error_worst"), map(list, rows), strict=True))


def inflation_of(slopes: Numbers, known: Known, scores: Numbers) -> float:
    """Compute by how much the sampling variance of the torque exceeds that of white residuals, on average."""
    if len(scores) < 2:
        return 1.0
    observed = float(np.sum((slopes @ scores.T) ** 2)) * len(scores) / (len(scores) - 1)
    assumed = float(np.sum(error_directions.squares(slopes * np.sqrt(known.share))))
    return observed / assumed if assumed > 0 and observed > 0 else 1.0


# --- samples of the motion --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    """Evaluates samples of recordings."""

    estimator: Estimator
    z: Numbers
    data: Data
    known: Known

    def look(self, recordings: Sequence[Evaluation], rows: Sequence[Indices], load: float = 1.0) -> Seen:
        """Evaluate every k-th of the rows of each recording, at `load` times the recorded tendon forces."""
        joints, tendons, unknowns = len(self.data["joints"]), len(self.data["tendons"]), len(self.z)
        most = min(_SAMPLES, max(_SIZE // (joints * unknowns), _SAMPLES // 10))
        every = max(1, math.ceil(sum(map(len, rows)) / most))
        chosen = [each[::every] for each in rows]
        total = sum(map(len, chosen))
        seen = Seen(np.empty((joints, total, tendons + 3)), np.empty((joints, total, unknowns)))
        at = 0
        for evaluation, each in zip(recordings, chosen, strict=True):
            for chunk in np.array_split(each, len(each) * joints * unknowns // _CHUNK + 1):
                arrays = sampled(evaluation, chunk, _STEP * np.arange(len(chunk), dtype=np.float64))
                arrays["tendon_force"] *= load
                taken = slice(at, at + len(chunk))
                seen.parts[:, taken] = friction_parts(self.data, arrays).transpose(1, 0, 2)
                seen.slopes[:, taken] = (self._slopes(arrays) @ self.known.factor).transpose(1, 0, 2)
                at = taken.stop
        return seen

    def _slopes(self, arrays: Mapping[str, Numbers]) -> Numbers:
        """Compute [K, n, u] the derivative of T by the unknowns."""
        number = self.estimator.add_recording(arrays, kinematics_source=3)
        return self.estimator.jacobian(number, self.z, 0, len(arrays["time"]))[2]


def friction_parts(data: Data, arrays: Mapping[str, Numbers], kinematics: int = 3) -> Numbers:
    """Compute [K, n, m + 3] the parts of T due to each tendon, joint friction, load friction and cover (N·m)."""
    joints, tendons = len(data["joints"]), len(data["tendons"])
    none = [[[0.0] * (tendons + 3)]] * joints
    asked = {**data, "contact": {"threshold": [NEVER] * joints, "uncertainty": none}, "sensor_fault": None}
    return np.asarray(native.Instance.from_description(asked, kinematics).run(arrays, parts=True)["friction_parts"])


@dataclass(frozen=True)
class RememberedMotion:
    """Evaluates blocks of recordings with friction that remembers, whose torque needs all samples before."""

    memory: MemoryEvidence
    data: Data
    known: Known

    def look(self, recordings: Sequence[Evaluation], rows: Sequence[Indices], load: float = 1.0) -> Seen:
        """Evaluate every k-th of the blocks that lie in the rows, at `load` times the recorded tendon forces."""
        problem, minimum = self.memory.problem, self.memory.minimum
        flags = [_flags(len(each.recording.time), own) for each, own in zip(recordings, rows, strict=True)]
        whole = problem.runs.grid
        grid = next(each for each in (windows(whole, _SECONDS), whole) if (each.means(flags) == 1.0).any())
        chosen = np.flatnonzero(grid.means(flags) == 1.0)
        chosen = chosen[:: max(1, math.ceil(len(chosen) / _SAMPLES))]
        loaded = [_loaded(each, load) for each in recordings]
        slopes = problem.over(problem.runs.over(loaded, grid)).slopes(minimum.state)[chosen]
        parts = grid.means([_parts(self.data, each) for each in loaded])[chosen]
        return Seen(parts.transpose(1, 0, 2), (slopes @ self.known.factor).transpose(1, 0, 2))


def _flags(samples: int, rows: Indices) -> Numbers:
    flags = np.zeros(samples)
    flags[rows] = 1.0
    return flags


def _loaded(evaluation: Evaluation, load: float) -> FitRecording:
    """Return a recording with its angles and `load` times its forces."""
    recording = evaluation.recording
    if load == 1.0:
        return recording
    groups = {**recording.recording.groups, "tendon_force": load * recording.recording.groups["tendon_force"]}
    heavier = replace(recording, recording=replace(recording.recording, groups=groups))
    return with_angles(heavier, np.nan_to_num(evaluation.model.joint_angle))


def _parts(data: Data, recording: FitRecording) -> Numbers:
    """Compute [N, n, m + 3] the parts of T of all samples; 0 outside the parts without a gap (N·m)."""
    parts = np.zeros((*recording.target.shape, len(data["tendons"]) + 3))
    for part in recording.parts:
        parts[part] = friction_parts(data, recording.arrays(part), recording.kinematics)
    return parts
