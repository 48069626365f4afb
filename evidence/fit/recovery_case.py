"""A finger with 472 known numbers that makes its own recording, and which of the numbers that recording can tell.

The motion and the noise are described in docs/evidence/fit.md. Tendons carry the model's friction and covers alone:
the wander of the bias adds up to 1 N·m in 400 s, which would pull them slack. It comes as `external_torque`.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evidence.cases import INDEX_FINGER
from evidence.table import Row
from fit_data import model_alone, noise_scale
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.estimate import Estimator
from tendonfmu.estimate.estimation import Learner
from tendonfmu.excite import read_subject
from tendonfmu.excite.excitation import Excitation, Plan, Variation, plan_excitation
from tendonfmu.excite.training_motion import as_array, find_ranges
from tendonfmu.model import balanced_forces, moment_arms, native, read_finger
from tendonfmu.model.description_numbers import with_values_at

Description = dict[str, Any]

START_BIAS = (0.004, -0.003, 0.003, -0.002)  # N·m
BIAS_DRIFT = 1e-8  # (N·m)²/s
BIAS: dict[str, Any] = {
    "noise_std": 5e-4,  # N·m, in each
    "noise_time": 1e-3,  # s
    "drift_variance": BIAS_DRIFT,
    "initial_variance": 1e-8,  # (N·m)²; beside it the bias at the start is an unknown
    "initial_torque": list(START_BIAS),
    "forget_rate": 0.5,  # 1/s
}
TENSIONS = Variation(15.0, 60.0)  # N
MAX_SPEED = 3.0  # rad/s
MAX_ACCELERATION = 20.0  # rad/s²
DURATION, RATE = 400.0, 1000.0  # s, 1/s

LIMIT = 0.3  # relative standard error up to which a number counts as identifiable
NEARLY_NOTHING = 10.0  # scales, known beforehand when this is judged: every information can then be inverted
START_SPREAD = 0.25  # of the logarithm of start over truth


@dataclass(frozen=True)
class Case:
    truth: Description  # with the true numbers
    start: Description  # with those that a fit starts from
    recording: dict[str, Numbers]  # as a fit takes it


def true_finger() -> Description:
    """The description with the true numbers."""
    finger = copy.deepcopy(read_finger(INDEX_FINGER).data)
    return dict(finger) | {"bias": BIAS}


def training_motion(truth: Description, seed: int, duration: float, rate: float, **changes: Any) -> Excitation:
    """The motion, a row for each sample; changes: of the plan."""
    ranges = as_array(find_ranges(read_subject(INDEX_FINGER), []))
    usual = Plan(ranges, MAX_SPEED, duration, (10.0,), None, rate, seed, TENSIONS, MAX_ACCELERATION)
    return plan_excitation(truth, replace(usual, **changes))


def carried(truth: Description, motion: Excitation) -> dict[str, Numbers]:
    """The recording of a motion whose tendons carry what the model makes of friction and covers alone."""
    angles = {name: getattr(motion, name) for name in ("time", "joint_position", "joint_velocity")}
    force = balanced_forces(truth, angles, motion.tension)
    stiffness = np.array([tendon["stiffness"] for tendon in truth["tendons"]])
    position = motion.joint_position @ moment_arms(truth).T + force / stiffness
    return {"time": motion.time, "tendon_force": force, "tendon_position": position}


def make_case(seed: int, duration: float = DURATION, rate: float = RATE) -> Case:
    """A recording of `duration` s at `rate` samples per second, and where the fit starts."""
    truth = true_finger()
    motion = training_motion(truth, seed, duration, rate)
    recording = carried(truth, motion)
    force = recording["tendon_force"]
    made = native.run_recording(model_alone(truth), recording, 1)
    friction, jumps = made["friction_torque"] - made["bias_torque"], made["bias_torque"]
    random = np.random.default_rng([seed, 1])
    noise = random.standard_normal(friction.shape) * noise_scale(truth, motion.time, force)
    steps = np.sqrt(BIAS_DRIFT * np.diff(motion.time, prepend=motion.time[0]))
    wander = np.cumsum(random.standard_normal(friction.shape) * steps[:, None], axis=0)
    first = random.standard_normal(len(START_BIAS)) * np.sqrt(BIAS["initial_variance"])
    bias = np.array(START_BIAS) + first + wander + jumps
    recording["external_torque"] = force @ moment_arms(truth) - (friction + bias + noise)
    return Case(truth, _start(truth, seed), recording)


def _start(truth: Description, seed: int) -> Description:
    """Every unknown times a factor of its own."""
    known = Estimator(image(truth))
    factors = np.exp(np.random.default_rng([seed, 2]).normal(0.0, START_SPREAD, len(known.unknowns)))
    values = known.values(known.start * factors)
    instance = native.Instance(image(truth))
    parameters = instance.parameters()
    moved = {index for unknown in known.unknowns for index in unknown.parameters}
    return with_values_at(
        copy.deepcopy(truth), {parameters[index].path: float(values[index]) for index in moved}, instance
    )


def image(description: Mapping[str, Any]) -> bytes:
    """As the runtime takes it."""
    return native.image_from_json(json.dumps(description))


# --- what can be told -------------------------------------------------------------------------------------------------


class Scale:
    """The numbers of a description as linear functions of the unknowns: each as it is, but 1/v_s for the Stribeck
    velocity, which is what behaves (the relative standard error of both is the same).

    paths: [q], of the numbers that the unknowns move; kinds: [q], the last word of each.
    """

    def __init__(self, truth: Description) -> None:
        known = Estimator(image(truth))
        moved = sorted({index for unknown in known.unknowns for index in unknown.parameters})
        paths = [parameter.path for parameter in native.Instance(image(truth)).parameters()]
        self._moved, self.paths = np.array(moved), [paths[index] for index in moved]
        self.kinds = np.array([path.rsplit(".", 1)[-1].split("[")[0] for path in self.paths])
        self.unknowns = known.start
        self.value = self._numbers(known, known.start)
        steps = 1e-3 * known.scale
        moves = [self._numbers(known, known.start + step) - self.value for step in np.diag(steps)]
        self._slopes = np.array(moves).T / steps

    def _numbers(self, known: Estimator, z: Numbers) -> Numbers:
        values = known.values(z)[self._moved]
        return np.asarray(np.where(self.kinds == "stribeck_velocity", 1.0 / values, values))

    def standard_errors(self, covariance: Numbers) -> Numbers:
        """[q] from the covariance of the unknowns."""
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", self._slopes, covariance, self._slopes)))

    def difference(self, z: Numbers, other: Numbers) -> Numbers:
        """[q] numbers of the unknowns z minus those of others."""
        return np.asarray(self._slopes @ (z - other))


def identifiable(case: Case, scale: Scale) -> Flags:
    """[q] decided from the Fisher information at the truth alone: standard error below 30 % of the value."""
    known = Estimator(image(case.truth))
    known.add_recording(case.recording, external_torque=case.recording["external_torque"])
    _, _, information = known.evaluate(known.start)
    covariance = np.asarray(np.linalg.inv(information + np.diag((NEARLY_NOTHING * known.scale) ** -2.0)), dtype=float)
    return np.asarray(scale.standard_errors(covariance) < LIMIT * np.abs(scale.value))


# --- both fits of a case ---------------------------------------------------------------------------------------------

FAR = 3.0  # standard errors
PRIOR = 0.3  # of a number's size: about as far as the starts are off
EKF_PASSES = 3  # each but the first linearised where the one before arrived; the first is the paper's filter


def run_seed(seed: int, duration: float = DURATION, rate: float = RATE, prior: float = PRIOR) -> Row:
    """One case: made, judged, fitted both ways."""
    made = make_case(seed, duration, rate)
    scale = Scale(made.truth)
    known = identifiable(made, scale)
    row: Row = {
        "seed": seed,
        "samples": len(made.recording["time"]),
        "numbers": len(known),
        "identifiable": int(known.sum()),
    }
    estimator = Estimator(image(made.start))
    estimator.add_recording(made.recording, external_torque=made.recording["external_torque"])
    fit = estimator.fit(prior_std=prior)
    row["converged"] = int(fit.converged)
    row |= {f"batch_{key}": value for key, value in judge(scale, known, fit.z, fit.covariance).items()}
    passes = list(_ekf(made, prior))
    row |= {f"ekf_first_{key}": value for key, value in judge(scale, known, *passes[0]).items()}
    row |= {f"ekf_{key}": value for key, value in judge(scale, known, *passes[-1]).items()}
    return row


def _ekf(made: Case, prior: float) -> Iterator[tuple[Numbers, Numbers]]:
    """What each pass finds."""
    learner = Learner(image(made.start), prior_std=prior)
    for number in range(EKF_PASSES):
        if number > 0:
            learner.begin_pass()
        learner.run(made.recording, external_torque=made.recording["external_torque"])
        yield learner.z, learner.covariance


def judge(scale: Scale, known: Flags, z: Numbers, covariance: Numbers) -> dict[str, Any]:
    """Of the identifiable numbers: how many lie beyond 3 standard errors of the fit, and the mean square."""
    distance = (scale.difference(z, scale.unknowns) / scale.standard_errors(covariance))[known]
    return {"far": int(np.sum(np.abs(distance) > FAR)), "variance": float(np.mean(distance**2))}
