"""What the detection campaign compares with: simpler models of friction, each with the product's bias filter and the
paper's rule of contact in the C core, and each with the thresholds that suit it best.

A rival is a description without friction that takes tendon forces from which the rival's own prediction has been
removed: forces f' = f − R (Rᵀ R)⁻¹ p carry the torque Rᵀ f − p. Its predictors are linear in their coefficients, which
are those that leave the least residual behind the bias filter, on the training recording (least squares).

- no model: the joint torque itself, with a constant bias, the mean over the free recordings
- bias alone: the product's finger without friction, its bias filter and covers
- joint Coulomb: per joint s, q̇, q
- tension-proportional: per joint |r_ij| f_i s for every tendon, s, q̇, q
- paper's rule: the product's description, thresholds chosen in the same way

s is tanh(q̇/v0), or the direction in which the joint last moved; whichever fits the training recording better.
"""

from __future__ import annotations

import copy
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.signal import lfilter

from evidence.runner import digest, plain
from matched_physics import held_sign
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect import DetectionScore, score_detection
from tendonfmu.detect.counting import stretches
from tendonfmu.model import moment_arms, native, number_of, without_friction
from tendonfmu.recordings import Recording, run_parts

Description = dict[str, Any]

NEVER = 1e9  # N·m
SCALES = (0.01, 0.03, 0.1, 0.2, 0.4)  # rad/s, v0
PER_SECOND = 1.0 / 600.0  # false alarms, 1 in 10 min
TAIL = 1e-3  # part of the free samples beyond the thresholds whose shape over the pretension is taken
FINER = 0.96  # from one scale of the thresholds to the next lower one
MOST_SHARE = 0.01  # of free time in alarm: few alarms that never end are no low rate


@dataclass(frozen=True)
class Predictor:
    """Friction torque of a joint: columns [N, c] times coefficients."""

    tensions: bool  # with a column for each tendon
    scale: float  # v0, rad/s; 0: the last direction
    coefficients: list[Numbers]  # [n] arrays

    def torque(self, moved: _Moved) -> Numbers:
        """[N, n] N·m."""
        return np.column_stack(
            [_columns(moved, j, self.tensions, self.scale) @ c for j, c in enumerate(self.coefficients)]
        )


@dataclass(frozen=True)
class Detector:
    """A description for the C core, and what is removed from the tendon forces before it sees them."""

    name: str
    description: Description
    predictor: Predictor | None = None

    @classmethod
    def of_file(cls, name: str, file: Path) -> Detector:
        return cls(name, json.loads(file.read_text(encoding="utf-8")))

    def inputs(self, recording: Recording) -> dict[str, Numbers]:
        """As `native.Instance.run` takes them."""
        given = recording.arrays()
        if self.predictor is None:
            return given
        arms = moment_arms(self.description)
        torque = self.predictor.torque(moved_by(self.description, recording))
        return {**given, "tendon_force": given["tendon_force"] - torque @ np.linalg.pinv(arms)}

    def alarm(self, inputs: Mapping[str, Numbers]) -> Flags:
        """[N] contact."""
        return np.asarray(native.run_recording(self.description, inputs)["contact"], dtype=bool).ravel()

    def score(self, recording: Recording) -> DetectionScore:
        """By the recording's labels."""
        label = np.zeros(len(recording.time), dtype=bool) if recording.contact is None else recording.contact
        return score_detection(recording.time, label, self.alarm(self.inputs(recording)))

    def residual(self, inputs: Mapping[str, Numbers]) -> Numbers:
        """[N, n] N·m before the bias update, without any detection; 0 for the first sample."""
        whole = np.ones(len(inputs["time"]), dtype=bool)
        left = run_parts(self.description, inputs, [slice(0, len(whole))], whole, 1).residual
        return np.nan_to_num(left)

    @property
    def digest(self) -> str:
        """Of all that it depends on."""
        return digest(to_json([self]))

    def with_thresholds(self, constant: Numbers, per_force: Numbers) -> Detector:
        changed = copy.deepcopy(self.description)
        changed["contact"] = {"threshold": constant.tolist(), "threshold_per_force": per_force.tolist()}
        return replace(self, description=changed)


# --- predictors -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Moved:
    force: Numbers  # [N, m] N
    angle: Numbers  # [N, n]
    speed: Numbers
    arms: Numbers  # [m, n] m
    still: float  # rad/s, below which a joint keeps its direction


def moved_by(description: Mapping[str, Any], recording: Recording) -> _Moved:
    """Kinematics as the C core takes them from tendon positions and forces."""
    run = native.run_recording(without_friction(description, "cover"), recording.arrays())
    still = float((description.get("velocity_threshold") or {}).get("joint", 0.01))
    force = recording.groups["tendon_force"]
    return _Moved(force, run["joint_angle"], run["joint_speed"], moment_arms(description), still)


def _direction(moved: _Moved, joint: int, scale: float) -> Numbers:
    speed = moved.speed[:, joint]
    if scale > 0:
        return np.asarray(np.tanh(speed / scale))
    return held_sign(speed, moved.still)


def _columns(moved: _Moved, joint: int, tensions: bool, scale: float) -> Numbers:
    """[N, c]: what resists motion first, the angle last."""
    direction = _direction(moved, joint, scale)
    columns = [direction, moved.speed[:, joint]]
    if tensions:
        columns += [abs(arm) * moved.force[:, i] * direction for i, arm in enumerate(moved.arms[:, joint]) if arm]
    return np.column_stack([*columns, moved.angle[:, joint]])


def fit_predictor(description: Mapping[str, Any], training: Recording, tensions: bool) -> tuple[Predictor, Numbers]:
    """The best of all scales, and its rms [n] in N·m behind the bias filter. Friction coefficients are not negative."""
    moved = moved_by(description, training)
    passed = HighPass.of(description, training.time, moved.force)
    torque = passed(moved.force @ moved.arms)
    tried: list[tuple[float, Predictor, Numbers]] = []
    for scale in (0.0, *SCALES):
        coefficients, rms = [], []
        for j in range(torque.shape[1]):
            columns = passed(_columns(moved, j, tensions, scale))
            both = np.column_stack([columns, -columns[:, -1:]])  # the angle's coefficient may have either sign
            solved = nnls(both.T @ both, both.T @ torque[:, j])[0]
            coefficient = np.append(solved[:-2], solved[-2] - solved[-1])
            left = float(np.sqrt(np.mean((torque[:, j] - columns @ coefficient) ** 2)))
            coefficients.append(coefficient)
            rms.append(left)
        tried.append((float(np.linalg.norm(rms)), Predictor(tensions, scale, coefficients), np.array(rms)))
    _, predictor, best = min(tried, key=lambda fit: fit[0])
    return predictor, best


@dataclass(frozen=True)
class HighPass:
    """What the bias filter lets through, with its steady gain: r_k = y_k − y_k−1 + (1 − K) r_k−1."""

    gain: float

    @classmethod
    def of(cls, description: Mapping[str, Any], time: Numbers, force: Numbers) -> HighPass:
        """Of the bias settings at a recording's mean force. The root of P² = q (P + R)."""
        settings, step = description.get("bias") or {}, float(np.median(np.diff(time)))
        base, per_force = (number_of(description, f"bias.{key}") for key in ("noise_std", "noise_std_per_force"))
        noise = (base + per_force * float(np.abs(force).mean())) ** 2
        if settings.get("noise_time") is not None:
            noise *= settings["noise_time"] / step
        drift = number_of(description, "bias.drift_variance") * step
        known = 0.5 * (drift + np.sqrt(drift**2 + 4 * drift * noise))
        return cls(float(known / (known + noise)))

    def __call__(self, signals: Numbers) -> Numbers:
        """[N, c], from rest at the first sample's values."""
        return np.asarray(lfilter([1.0, -1.0], [1.0, self.gain - 1.0], signals - signals[0], axis=0))


# --- descriptions -----------------------------------------------------------------------------------------------------


def constant_bias(description: Mapping[str, Any], torque: Numbers) -> Description:
    """Without friction and covers, with a bias that stays at torque [n], N·m."""
    bare = without_friction(description)
    bare["bias"] = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": torque.tolist()}
    return bare


def make_rivals(product: Mapping[str, Any], training: Recording, free: Sequence[Recording]) -> list[Detector]:
    """Without thresholds of their own yet. product: the description whose bias filter all of them have."""
    arms = moment_arms(product)
    mean = np.mean([(recording.groups["tendon_force"] @ arms).mean(axis=0) for recording in free], axis=0)
    bare = without_friction(product)
    return [
        Detector("no model", constant_bias(product, mean)),
        Detector("bias alone", without_friction(product, "cover")),
        Detector("joint Coulomb", bare, fit_predictor(product, training, tensions=False)[0]),
        Detector("tension-proportional", bare, fit_predictor(product, training, tensions=True)[0]),
        Detector("paper's rule", copy.deepcopy(dict(product))),
    ]


# --- thresholds -------------------------------------------------------------------------------------------------------


def best_thresholds(detector: Detector, free: Sequence[Sequence[Recording]]) -> Detector:
    """The lowest thresholds with no more than `PER_SECOND` false alarms on all free recordings together."""
    # free: recordings by pretension. Constant and per newton: a line through what each joint's residual exceeds in
    # `TAIL` of the samples of each pretension. Both times the lowest factor, searched from where a third of the alarms
    # would be given without any detection: the first lower one with too many alarms, or more than `MOST_SHARE` of the
    # time in alarm, ends the search.
    groups = [[detector.inputs(recording) for recording in group] for group in free]
    sizes = [[np.abs(detector.residual(inputs)) for inputs in group] for group in groups]
    tails = np.array([np.quantile(np.concatenate(group), 1 - TAIL, axis=0) for group in sizes])
    force = np.array([np.mean([np.abs(inputs["tendon_force"]).mean() for inputs in group]) for group in groups])
    ones = np.ones_like(force)
    lines = [nnls(np.column_stack([ones, force]) / tail[:, None], ones)[0] for tail in tails.T]
    constant, per_force = np.array(lines).T
    recordings, residuals = list(itertools.chain(*groups)), list(itertools.chain(*sizes))
    excess = [
        (size / (constant + per_force * np.abs(inputs["tendon_force"]).mean(axis=1)[:, None])).max(axis=1)
        for inputs, size in zip(recordings, residuals, strict=True)
    ]
    allowed = int(PER_SECOND * sum(inputs["time"][-1] - inputs["time"][0] for inputs in recordings) + 1e-6)

    def at(factor: float) -> Detector:
        return detector.with_thresholds(factor * constant, factor * per_force)

    factor = max(float(values.max()) for values in excess)
    while _begins(recordings, excess, factor) < allowed / 3:
        factor *= FINER
    while not _holds(at(factor), recordings, allowed):
        factor /= FINER
    while _holds(at(factor * FINER), recordings, allowed):
        factor *= FINER
    return at(factor)


def _begins(recordings: Sequence[Mapping[str, Numbers]], excess: Sequence[Numbers], factor: float) -> int:
    """How often the residuals, in thresholds, rise above the factor."""
    return sum(
        len(stretches(inputs["time"], values > factor)) for inputs, values in zip(recordings, excess, strict=True)
    )


def _holds(detector: Detector, recordings: Sequence[Mapping[str, Numbers]], allowed: int) -> bool:
    alarms, seconds, duration = 0, 0.0, 0.0
    for inputs in recordings:
        score = score_detection(inputs["time"], np.zeros(len(inputs["time"]), dtype=bool), detector.alarm(inputs))
        alarms += len(score.false_alarms)
        seconds += score.free_alarm_share * score.free_seconds
        duration += inputs["time"][-1] - inputs["time"][0]
        if alarms > allowed:
            return False
    return seconds <= MOST_SHARE * duration


# --- kept -------------------------------------------------------------------------------------------------------------


def to_json(detectors: Sequence[Detector]) -> list[dict[str, Any]]:
    return [
        plain(vars(detector) | {"predictor": detector.predictor and vars(detector.predictor)}) for detector in detectors
    ]


def from_json(file: Path) -> list[Detector]:
    detectors = []
    for kept in json.loads(file.read_text(encoding="utf-8")):
        if kept["predictor"] is not None:
            coefficients = [np.array(values) for values in kept["predictor"]["coefficients"]]
            kept["predictor"] = Predictor(**kept["predictor"] | {"coefficients": coefficients})
        detectors.append(Detector(**kept))
    return detectors
