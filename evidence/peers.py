"""What simpler models, and the field's own, make of the same recordings.

Contact on the virtual hand: each rival has the product's bias filter and the paper's rule in the C core, and the lowest
thresholds with one false alarm in 10 min of free motion. It is a description without friction that takes tendon forces
from which the rival's own prediction p has been removed: f' = f − R (Rᵀ R)⁻¹ p carries the torque Rᵀ f − p.

- no model: the joint torque itself, with a constant bias, the mean over the free recordings
- bias alone: the product's finger without friction, its bias filter and covers
- joint Coulomb: per joint s, q̇, q, where s = tanh(q̇/v0)
- tension-proportional: per joint |r_ij| f_i s for every tendon, s, q̇, q
- paper's rule: the product's fitted description
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import nnls
from scipy.signal import butter, lfilter, sosfiltfilt

import tendonfmu as tf
from evidence import table
from evidence.cases import DATA, run_cases
from evidence.contact import found_table, free_rms, hand, scored, summary
from evidence.machines import ANOTHER, FIRST, SECOND
from evidence.part import Figures, Part
from evidence.table import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect import score_detection
from tendonfmu.model import moment_arms, number_of, without_friction
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import run_parts

Description = dict[str, Any]

SCALES = (0.01, 0.03, 0.1, 0.2, 0.4)  # rad/s, v0
PER_SECOND = 1.0 / 600.0  # false alarms, 1 in 10 min
TAIL = 1e-3  # part of the free samples beyond the thresholds whose shape over the pretension is taken
MOST_SHARE = 0.01  # of free time in alarm: few alarms that never end are no low rate
ROUNDS = 12  # of halving the range of the thresholds


@dataclass(frozen=True)
class Rival:
    """A description for the C core, and what is removed from the tendon forces before it sees them."""

    description: Description
    tensions: bool = False  # the predictor has a column for each tendon
    scale: float = 0.0  # v0 of the predictor
    coefficients: tuple[Numbers, ...] = ()  # by joint; none: no predictor

    def inputs(self, recording: tf.Recording) -> dict[str, Numbers]:
        given = recording.arrays()
        if not self.coefficients:
            return given
        kinematics = _kinematics(self.description, given)
        columns = [
            _columns(self.description, given, kinematics, j, self.tensions, self.scale) @ coefficients
            for j, coefficients in enumerate(self.coefficients)
        ]
        removed = np.column_stack(columns) @ np.linalg.pinv(moment_arms(self.description))
        return {**given, "tendon_force": given["tendon_force"] - removed}

    def alarm(self, inputs: Mapping[str, Numbers]) -> Flags:
        return run_recording(self.description, inputs)["contact"].ravel().astype(bool)

    def with_thresholds(self, constant: Numbers, per_force: Numbers) -> Rival:
        contact = {"threshold": constant.tolist(), "threshold_per_force": per_force.tolist()}
        return replace(self, description={**self.description, "contact": contact})


# --- predictors -------------------------------------------------------------------------------------------------------


def _kinematics(description: Description, inputs: Mapping[str, Numbers]) -> tuple[Numbers, Numbers]:
    """Angles and speeds as the C core takes them from tendon positions and forces."""
    outputs = run_recording(without_friction(description, "cover"), inputs)
    return outputs["joint_angle"], outputs["joint_speed"]


def _columns(
    description: Description,
    inputs: Mapping[str, Numbers],
    kinematics: tuple[Numbers, Numbers],
    joint: int,
    tensions: bool,
    scale: float,
) -> Numbers:
    """[N, c]: what resists motion first, the angle last."""
    angle, speed = (values[:, joint] for values in kinematics)
    direction = np.tanh(speed / scale)
    columns = [direction, speed]
    if tensions:
        arms = moment_arms(description)[:, joint]
        columns += [abs(arm) * inputs["tendon_force"][:, i] * direction for i, arm in enumerate(arms) if arm]
    return np.column_stack([*columns, angle])


def fitted_rival(bare: Description, product: Description, training: tf.Recording, tensions: bool) -> Rival:
    """The predictor of the least residual behind the bias filter; friction coefficients are not negative."""
    inputs = training.arrays()
    kinematics = _kinematics(bare, inputs)
    gain = _bias_gain(product, inputs)
    torque = _passed(inputs["tendon_force"] @ moment_arms(bare), gain)
    tried: list[tuple[float, Rival]] = []
    for scale in SCALES:
        coefficients, left = [], 0.0
        for j in range(torque.shape[1]):
            columns = _passed(_columns(bare, inputs, kinematics, j, tensions, scale), gain)
            both = np.column_stack([columns, -columns[:, -1:]])  # the angle's coefficient may have either sign
            solved = nnls(both.T @ both, both.T @ torque[:, j])[0]
            coefficients.append(np.append(solved[:-2], solved[-2] - solved[-1]))
            left += float(np.mean((torque[:, j] - columns @ coefficients[-1]) ** 2))
        tried.append((left, Rival(bare, tensions, scale, tuple(coefficients))))
    return min(tried, key=lambda one: one[0])[1]


def _bias_gain(description: Description, inputs: Mapping[str, Numbers]) -> float:
    """Steady gain of the bias filter at a recording's mean force: the root of P² = q (P + R)."""
    step = float(np.median(np.diff(inputs["time"])))
    base, per_force = (number_of(description, f"bias.{key}") for key in ("noise_std", "noise_std_per_force"))
    noise = (base + per_force * float(np.abs(inputs["tendon_force"]).mean())) ** 2
    noise *= float(description["bias"].get("noise_time") or step) / step
    drift = number_of(description, "bias.drift_variance") * step
    known = 0.5 * (drift + np.sqrt(drift**2 + 4 * drift * noise))
    return float(known / (known + noise))


def _passed(signals: Numbers, gain: float) -> Numbers:
    """[N, c] what the bias filter lets through: r_k = y_k − y_k−1 + (1 − K) r_k−1, from rest."""
    return np.asarray(lfilter([1.0, -1.0], [1.0, gain - 1.0], signals - signals[0], axis=0))


def rivals(folder: Path) -> dict[str, Rival]:
    """Without thresholds of their own yet."""
    product = hand.fitted(folder).to_dict()
    training = tf.read_recording(hand.training_file(folder))
    bare = without_friction(product)
    arms = moment_arms(product)
    free = [hand.recording(folder, take).groups["tendon_force"] for take in hand.takes("free")]
    mean = np.mean([(force @ arms).mean(axis=0) for force in free], axis=0)
    constant = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": mean.tolist()}
    return {
        "paper's rule": Rival(product),
        "tension-proportional": fitted_rival(bare, product, training, tensions=True),
        "joint Coulomb": fitted_rival(bare, product, training, tensions=False),
        "no model": Rival({**bare, "bias": constant}),
        "bias alone": Rival(without_friction(product, "cover")),
    }


# --- thresholds -------------------------------------------------------------------------------------------------------


def with_best_thresholds(rival: Rival, folder: Path) -> Rival:
    """The lowest thresholds that keep the rate of false alarms on all free recordings together.

    Constant and per newton: a line through what each joint's residual exceeds in `TAIL` of the samples of each
    pretension, times one factor.
    """
    inputs = [rival.inputs(hand.recording(folder, take)) for take in hand.takes("free")]
    tails, forces = [], []
    for one in inputs:
        every = np.ones(len(one["time"]), dtype=bool)
        residual = run_parts(rival.description, one, [slice(0, len(every))], every, 1).residual
        tails.append(np.quantile(np.abs(np.nan_to_num(residual)), 1 - TAIL, axis=0))
        forces.append(float(np.abs(one["tendon_force"]).mean()))
    ones = np.ones(len(forces))
    lines = [nnls(np.column_stack([ones, forces]) / tail[:, None], ones)[0] for tail in np.transpose(tails)]
    constant, per_force = np.transpose(lines)
    low, high = np.log(0.3), np.log(30.0)
    for _ in range(ROUNDS):
        middle = float(np.exp(0.5 * (low + high)))
        if _keeps_the_rate(rival.with_thresholds(middle * constant, middle * per_force), inputs):
            high = np.log(middle)
        else:
            low = np.log(middle)
    return rival.with_thresholds(np.exp(high) * constant, np.exp(high) * per_force)


def _keeps_the_rate(rival: Rival, inputs: Sequence[Mapping[str, Numbers]]) -> bool:
    duration = sum(float(one["time"][-1] - one["time"][0]) for one in inputs)
    alarms, seconds = 0, 0.0
    for one in inputs:
        score = score_detection(one["time"], np.zeros(len(one["time"]), dtype=bool), rival.alarm(one))
        alarms += len(score.false_alarms)
        seconds += score.free_alarm_share * score.free_seconds
        if alarms > PER_SECOND * duration + 1e-6:
            return False
    return seconds <= MOST_SHARE * duration


def rival_case(folder: Path, name: str) -> Row:
    rival = with_best_thresholds(rivals(folder)[name], folder)
    every = hand.takes("free", *hand.PUSHED)
    rows = [scored(folder, take, rival.alarm(rival.inputs(hand.recording(folder, take)))) for take in every]
    return {"rival": name, "summary": summary(rows, free_rms(folder))}


def contact(folder: Path, workers: int) -> Figures:
    """Simpler models on the recordings of contact.hand."""
    every = hand.takes("free", *hand.PUSHED)
    run_cases(hand.made, {f"made_{take.name}": (folder, take) for take in every}, folder, workers)
    names = list(rivals(folder))
    rows = run_cases(rival_case, {f"rival_{k}": (folder, name) for k, name in enumerate(names)}, folder, workers)
    return {row["rival"]: row["summary"] for row in rows}


# --- the regression of a rigid body -----------------------------------------------------------------------------------

CUTOFF, RATE = 8.0, 200.0  # Hz; of the low pass as in the maps
SIGN = 0.01  # of the largest speed, over which the sign turns


def regression(joint: int, learned: Sequence[str]) -> Callable[[Sequence[str]], float]:
    """Least squares over inertia, coupled inertia, weight and friction; the rms error on recordings [N·m].

    What the field identifies such an arm with: 17 numbers in base parameters, of all three joints.
    """
    logs = {name: pd.read_parquet(DATA / "psm" / f"{name}.parquet").astype(float) for name in learned}
    fastest = max(float(log[f"joint_velocity_{joint}"].abs().max()) for log in logs.values())
    low_pass = butter(2, CUTOFF, fs=RATE, output="sos")

    def columns(log: Any) -> Numbers:
        angle = [log[f"joint_position_{k}"].to_numpy() for k in (1, 2, 3)]
        speed = [sosfiltfilt(low_pass, log[f"joint_velocity_{k}"]) for k in (1, 2, 3)]
        turn = [np.gradient(values) * RATE for values in speed]
        own, at = turn[joint - 1], speed[joint - 1] / fastest
        sine, cosine = np.sin(angle[:2]), np.cos(angle[:2])
        weight = [sine[0] * cosine[1], cosine[0] * sine[1], cosine[0] * cosine[1], sine[1], sine[0]]
        inertia = [own, own * angle[2], own * angle[2] ** 2, own * cosine[1] ** 2]
        coupled = [turn[k] for k in range(3) if k != joint - 1]
        by_insertion = [values * angle[2] for values in weight[:3]]
        return np.column_stack([np.ones_like(own), *inertia, *coupled, *weight, *by_insertion, np.tanh(at / SIGN), at])

    design = np.vstack([columns(log) for log in logs.values()])
    effort = np.concatenate([log[f"effort_{joint}"] for log in logs.values()])
    scale = np.maximum(np.sqrt((design**2).mean(axis=0)), 1e-12)
    numbers = np.linalg.lstsq(design / scale, effort, rcond=1e-6)[0] / scale

    def error(names: Sequence[str]) -> float:
        judged = [pd.read_parquet(DATA / "psm" / f"{name}.parquet").astype(float) for name in names]
        return table.rms(np.concatenate([log[f"effort_{joint}"] - columns(log) @ numbers for log in judged]))

    return error


def rigid_body(_folder: Path, _workers: int) -> Figures:
    lines = []
    for joint in (1, 2, 3):
        error = regression(joint, FIRST)
        lines.append([f"{joint}", *(f"{1e3 * error(names):.0f}" for names in (SECOND, ANOTHER))])
    return {"lines": lines}


PARTS = {
    "contact": Part(contact, minutes=15.0, tables={"found": found_table}),
    "rigid_body": Part(
        rigid_body,
        minutes=0.1,
        needs=("../shared/data",),
        tables={
            "errors": table.of_cells(
                "lines", ["PSM joint, error in mN·m (3: mN)", "other excitations", "another identification"]
            )
        },
    ),
}
