"""The extended model beside two models that name no cause, on motion that none has seen.

    python bench/diagnosis_models.py --cases 3

Each case is a finger of the matched rig (python_tests/hidden_effects) with one hidden effect at strength 1: 60 s to
learn from, 60 s of another motion to be judged on. All models predict the torque of every sample; r of
docs/reference/semantics.md#contact-detector is then what the same bias filter leaves (rms over all joints, mN·m).

- nominal, extended: the description as refitted, and as `diagnose` extends it;
- learner: gradient-boosted trees from angles, velocities, tendon forces, travel since the reversal and the side of the
  last motion to the torque, no model at all: the way of reference [18] of the paper, next values from data;
- two-step LuGre: for each joint as if it stood alone, first the static curve from samples that move, then the bristles'
  stiffness with that curve held (reference [3] of the paper), a spring and an offset beside it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from sklearn.ensemble import HistGradientBoostingRegressor

from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.gain import residual_of
from tendonfmu.model.balance import moment_arms
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import read_recording

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python_tests" / "hidden_effects"))
import cases as hidden_cases  # noqa: E402

Numbers = NDArray[np.float64]
Data = Mapping[str, Any]

EFFECTS = ("load_friction", "presliding", "gravity", "friction_drift", "force_gain", "edge_friction")
LEARNED_EVERY = 4  # samples; neighbours say the same
MOVES = 5.0  # times the joint's threshold: samples for the static curve


def kinematics(data: Data, recording: FitRecording) -> tuple[Numbers, Numbers, Numbers]:
    """[N, n] angle, velocity, joint torque as the finger sees them."""
    out = Instance.from_description(data, recording.kinematics).run(recording.recording.arrays())
    return out["joint_angle"], out["joint_speed"], out["joint_torque"]


def filtered(data: Data, time: Numbers, error: Numbers) -> Numbers:
    """[N, n] r of what a model leaves, by the bias filter (docs/reference/semantics.md#bias-tracker)."""
    bias = data["bias"]
    noise, variance = float(bias["noise_std"]) ** 2, float(bias["initial_variance"])
    b, r = error[0].copy(), np.zeros_like(error)
    for k in range(1, len(time)):
        r[k] = error[k] - b
        variance += float(bias["drift_variance"]) * (time[k] - time[k - 1])
        gain = variance / (variance + noise)
        b = b + gain * r[k]
        variance *= 1.0 - gain
    return r


# --- a data-driven learner alone --------------------------------------------------------------------------------------


def features(data: Data, recording: FitRecording) -> Numbers:
    """[N, 4 n + m]"""
    angle, velocity, _ = kinematics(data, recording)
    moving = np.abs(velocity) > float(data["velocity_threshold"]["joint"])
    last = np.maximum.accumulate(np.where(moving, np.arange(len(angle))[:, None], 0), axis=0)
    side = np.sign(np.take_along_axis(velocity, last, axis=0))
    travel = np.zeros_like(angle)
    for j in range(angle.shape[1]):
        turns = np.flatnonzero(np.diff(side[:, j], prepend=side[0, j]))
        starts = np.concatenate([[0], turns])
        begin = starts[np.searchsorted(starts, np.arange(len(angle)), side="right") - 1]
        travel[:, j] = angle[:, j] - angle[begin, j]
    return np.hstack([angle, velocity, side, travel, recording.recording.groups["tendon_force"]])


def learner(data: Data, training: FitRecording, test: FitRecording) -> Numbers:
    """[N, n] predicted torque of the test. The tendon forces that make up the torque are inputs as pretension only:
    with all of them the torque itself would be given, so they enter as their mean."""
    joints = len(data["joints"])
    split = 4 * joints
    inside, outside = (features(data, each) for each in (training, test))
    inside, outside = (np.column_stack([each[:, :split], each[:, split:].mean(axis=1)]) for each in (inside, outside))
    torque = kinematics(data, training)[2]
    found = []
    for j in range(joints):
        trees = HistGradientBoostingRegressor(max_iter=200, early_stopping=False, random_state=0)
        trees.fit(inside[::LEARNED_EVERY], torque[::LEARNED_EVERY, j])
        found.append(trees.predict(outside))
    return np.column_stack(found)


# --- two-step LuGre, joint by joint -----------------------------------------------------------------------------------


def static_curve(numbers: Numbers, velocity: Numbers) -> Numbers:
    """Level g(v) of the bristles; numbers: Fc, Fs − Fc, vs."""
    return np.asarray(numbers[0] + numbers[1] * np.exp(-((velocity / numbers[2]) ** 2)))


def bristles(velocity: Numbers, time: Numbers, level: Numbers, stiffness: float) -> Numbers:
    """σ0·z of dz/dt = v − σ0·|v|/g(v)·z, exact over each step with v and g held."""
    force, at = np.zeros(len(time)), 0.0
    step = np.diff(time, prepend=time[0])
    decay = np.exp(-stiffness * np.abs(velocity) / level * step)
    target = np.sign(velocity) * level
    for k in range(len(time)):
        at = target[k] + (at - target[k]) * decay[k]
        force[k] = at
    return force


def whole_curve(p: Numbers, angle: Numbers, velocity: Numbers) -> Numbers:
    """Static torque; numbers: those of `static_curve`, viscous friction, spring, offset."""
    rest = p[3] * velocity + p[4] * angle + p[5]
    return np.asarray(np.sign(velocity) * static_curve(p[:3], velocity) + rest)


def static_numbers(angle: Numbers, velocity: Numbers, torque: Numbers) -> Numbers:
    """First step: by samples that move."""
    size = float(np.std(torque)) or 1e-3
    start = np.array([size, 0.3 * size, 0.3, 0.01 * size, 0.01, float(np.mean(torque))])
    bounds = ([0.0, 0.0, 1e-3, 0.0, -10.0, -10.0], [10.0] * 6)
    found = least_squares(lambda p: (whole_curve(p, angle, velocity) - torque) / size, start, bounds=bounds)
    return np.asarray(found.x)


def dynamic_curve(p: Numbers, stiffness: float, angle: Numbers, velocity: Numbers, time: Numbers) -> Numbers:
    level = np.maximum(static_curve(p[:3], velocity), 1e-9)
    return bristles(velocity, time, level, stiffness) + p[3] * velocity + p[4] * angle + p[5]


def two_step_lugre(data: Data, training: FitRecording, test: FitRecording) -> Numbers:
    """[N, n] predicted torque of the test."""
    angle, velocity, torque = kinematics(data, training)
    angle_test, velocity_test, _ = kinematics(data, test)
    threshold = MOVES * float(data["velocity_threshold"]["joint"])
    found = []
    for j in range(angle.shape[1]):
        q, v, tau = angle[:, j], velocity[:, j], torque[:, j]
        moves = np.abs(v) > threshold
        p = static_numbers(q[moves], v[moves], tau[moves])
        choices = np.geomspace(1.0, 1000.0, 25) * max(p[0], 1e-6)
        errors = [np.mean((dynamic_curve(p, choice, q, v, training.time) - tau) ** 2) for choice in choices]
        best = float(choices[int(np.argmin(errors))])
        found.append(dynamic_curve(p, best, angle_test[:, j], velocity_test[:, j], test.time))
    return np.column_stack(found)


# --- the table --------------------------------------------------------------------------------------------------------


def compare(effect: str, seed: int) -> dict[str, float]:
    """rms of r on the test recording, mN·m, by model."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = hidden_cases.single(folder, effect, 1.0, seed, presliding=seed % 2 == 1, test=60.0, rate=250.0)
        finger = read_finger(folder / made["finger"])
        training, test = (
            prepare(finger, read_recording(folder / made[key][0]), made["kinematics"], Held())
            for key in ("recordings", "test")
        )
        found = diagnose(
            folder / made["finger"], [training.path], tests=[test.path], kinematics=made["kinematics"], seed=seed
        )
    data = finger.data
    torque = test.recording.groups["tendon_force"] @ moment_arms(data)
    return {
        "nominal": rms(residual_of(found.nominal_data, test)),
        "extended": rms(residual_of(found.extended_data, test)),
        "learner": rms(filtered(data, test.time, torque - learner(data, training, test))),
        "two-step LuGre": rms(filtered(data, test.time, torque - two_step_lugre(data, training, test))),
        "noise": 1e3 * float(data["bias"]["noise_std"]),
    }


def rms(residual: Numbers) -> float:
    """mN·m over all joints, the first sample left out."""
    return 1e3 * float(np.sqrt(np.nanmean(residual[1:] ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cases", type=int, default=2, help="fingers for each effect")
    parser.add_argument("--effects", nargs="+", default=list(EFFECTS))
    given = parser.parse_args()
    names = ["nominal", "extended", "learner", "two-step LuGre", "noise"]
    print("| hidden at strength 1 | " + " | ".join(names) + " |\n| --- |" + " ---: |" * len(names))
    for effect in given.effects:
        rows = [compare(effect, seed) for seed in range(given.cases)]
        print(
            f"| {effect} | " + " | ".join(f"{np.mean([row[n] for row in rows]):.2f}" for n in names) + " |", flush=True
        )


if __name__ == "__main__":
    main()
