"""One case of the recovery campaign: a finger whose numbers are known, a recording that it made itself, what of the
numbers that recording can tell, and how far a fit is from them.

The finger is examples/fingers/index_finger.json: 4 joints, 8 tendons, 468 numbers of friction and covers, and the bias
of each joint at the start, 472 in all. Its noise is replaced, since its own stands for errors of the model too:

- 0.5 mN·m of white noise in each joint torque at 1 kHz. With the finger's moment arms (root of their squares 14, 24, 13
  and 7 mm by joint) that is 20 to 75 mN in each tendon force, as strain gauges for 100 N have.
- a bias that wanders by 0.1 mN·m in 1 s, 2 mN·m in 400 s: 0.1 N of drift in each force sensor.

The motion is `tendonfmu excite --vary-tension 15:60 --max-speed 3 --max-acceleration 20 --rate 1000`, another seed in
each case. The recording holds time, tendon forces and positions, as a robot does, from which the fit takes angles and
velocities (kinematics source 1), and `external_torque`: a reference sensor, whose noise and wander these are. Tendons
carry what the model makes of friction and covers alone. If they carried the bias too, it would pull them slack: what
fig. 5's jumps leave in it, where a load or an angle changes while something rests, adds up to 1 N·m in 400 s.
"""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.estimate.estimation import Estimator
from tendonfmu.excite.excitation import Excitation, Plan, Variation, plan_excitation
from tendonfmu.excite.training_motion import as_array, find_ranges, read_subject
from tendonfmu.model import native
from tendonfmu.model.balance import balanced_forces, moment_arms
from tendonfmu.model.description import read_finger

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python_tests" / "support"))
from fit_data import model_alone, noise_scale  # noqa: E402

Numbers = NDArray[np.float64]
Description = dict[str, Any]

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
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
    """truth, start: descriptions with the true numbers and those that a fit starts from. recording: as a fit takes it.
    least_force: N, of any tendon.
    """

    truth: Description
    start: Description
    recording: dict[str, Numbers]
    least_force: float


def true_finger() -> Description:
    """The description with the true numbers."""
    finger = copy.deepcopy(read_finger(FINGER).data)
    return dict(finger) | {"bias": BIAS}


def training_motion(truth: Description, seed: int, duration: float, rate: float) -> Excitation:
    """The motion, a row for each sample."""
    ranges = as_array(find_ranges(read_subject(FINGER), []))
    plan = Plan(
        ranges,
        max_speed=MAX_SPEED,
        duration=duration,
        rate=rate,
        seed=seed,
        vary=TENSIONS,
        max_acceleration=MAX_ACCELERATION,
    )
    return plan_excitation(truth, plan)


def make_case(seed: int, duration: float = DURATION, rate: float = RATE) -> Case:
    """A recording of `duration` s at `rate` samples per second, and where the fit starts."""
    truth = true_finger()
    motion = training_motion(truth, seed, duration, rate)
    arms = moment_arms(truth)
    stiffness = np.array([tendon["stiffness"] for tendon in truth["tendons"]])
    angles = {name: getattr(motion, name) for name in ("time", "joint_position", "joint_velocity")}
    force = balanced_forces(truth, angles, motion.tension)
    position = motion.joint_position @ arms.T + force / stiffness
    recording = {"time": motion.time, "tendon_force": force, "tendon_position": position}
    made = native.run_recording(model_alone(truth), recording, 1)
    friction, jumps = made["friction_torque"] - made["bias_torque"], made["bias_torque"]
    random = np.random.default_rng([seed, 1])
    noise = random.standard_normal(friction.shape) * noise_scale(truth, motion.time, force)
    steps = np.sqrt(BIAS_DRIFT * np.diff(motion.time, prepend=motion.time[0]))
    wander = np.cumsum(random.standard_normal(friction.shape) * steps[:, None], axis=0)
    first = random.standard_normal(len(START_BIAS)) * np.sqrt(BIAS["initial_variance"])
    bias = np.array(START_BIAS) + first + wander + jumps
    recording["external_torque"] = force @ arms - (friction + bias + noise)
    return Case(truth, _start(truth, seed), recording, float(force.min()))


def _start(truth: Description, seed: int) -> Description:
    """Every unknown times a factor of its own."""
    known = Estimator(image(truth))
    factors = np.exp(np.random.default_rng([seed, 2]).normal(0.0, START_SPREAD, len(known.unknowns)))
    values = known.values(known.start * factors)
    parameters = native.Instance(image(truth)).parameters()
    start = copy.deepcopy(truth)
    for index in {index for unknown in known.unknowns for index in unknown.parameters}:
        _put(start, parameters[index].path, float(values[index]))
    return start


def _put(description: Description, path: str, value: float) -> None:
    *way, last = path.replace("]", "").replace("[", ".").split(".")
    place: Any = description
    for key in way:
        place = place[int(key) - 1] if key.isdigit() else place[key]
    place[int(last) - 1 if last.isdigit() else last] = value


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
        return np.where(self.kinds == "stribeck_velocity", 1.0 / values, values)

    def standard_errors(self, covariance: Numbers) -> Numbers:
        """[q] from the covariance of the unknowns."""
        return np.sqrt(np.einsum("ij,jk,ik->i", self._slopes, covariance, self._slopes))

    def difference(self, z: Numbers, other: Numbers) -> Numbers:
        """[q] numbers of the unknowns z minus those of others."""
        return np.asarray(self._slopes @ (z - other))


def identifiable(case: Case, scale: Scale) -> NDArray[np.bool_]:
    """[q] decided from the Fisher information at the truth alone: standard error below 30 % of the value."""
    known = Estimator(image(case.truth))
    known.add_recording(case.recording, external_torque=case.recording["external_torque"])
    _, _, information = known.evaluate(known.start)
    covariance = np.linalg.inv(information + np.diag((NEARLY_NOTHING * known.scale) ** -2.0))
    return np.asarray(scale.standard_errors(covariance) < LIMIT * np.abs(scale.value))
