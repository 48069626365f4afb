"""Draws figures 2b, 5, 6, 7 and 8 of the paper again, on data whose truth is known: docs/reference/paper.md."""

from __future__ import annotations

import json
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from evidence.cases import EXAMPLES, INDEX_FINGER, tendonfmu
from evidence.part import Figures
from evidence.table import rms
from tendonfmu.arrays import Numbers
from tendonfmu.detect.counting import stretches
from tendonfmu.drawing import ORANGE, SILVER, series_figure
from tendonfmu.estimate import FrictionFit
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import Recording, flagged_stretches, read_recording

CALIBRATED = EXAMPLES / "demo_recording" / "index_finger_calibrated.json"
JOINTS = (0, 1)  # the paper shows the first two
SHOWN = (20.0, 36.0)  # s
REST = ("|v| ≤ v_min: the bias holds the friction", SILVER)

LAW = {"static": 0.020, "coulomb": 0.014, "stribeck_velocity": 0.1, "viscous": 0.006}  # N·m, rad/s, N·m·s/rad
THRESHOLD = 0.05  # rad/s; wide enough to be seen
FORGET = 5.0  # 1/s, α of the paper's fig. 5
RATE = 1000  # Hz


# --- figures 2b and 5: one joint, by the core and by the formula ------------------------------------------------------


def one_joint() -> dict[str, Any]:
    """A joint with friction and a bias that learns nothing, so that fig. 5 stands alone."""
    return {
        "format": "tendonfmu-finger-1",
        "name": "one_joint",
        "joints": [{"friction": LAW}],
        "tendons": [{"stiffness": 1e6, "moment_arms": [0.01], "bidirectional": True}],
        "velocity_threshold": {"joint": THRESHOLD},
        "bias": {"drift_variance": 0.0, "initial_variance": 0.0, "forget_rate": FORGET, "noise_std": 0.01},
        "contact": {"threshold": [1e6]},
    }


def law(speed: Numbers) -> Numbers:
    """Eq. (1), N·m."""
    rest = LAW["static"] - LAW["coulomb"]
    drop = rest * np.exp(-np.abs(speed) / LAW["stribeck_velocity"])
    return np.asarray(np.sign(speed) * (LAW["coulomb"] + drop + LAW["viscous"] * np.abs(speed)))


def run_joint(speed: Numbers) -> dict[str, Numbers]:
    """The core's outputs for a joint that moves with these velocities, no tendon pulling."""
    time = np.arange(len(speed)) / RATE
    position = np.cumsum(speed)[:, None] / RATE
    nothing = np.zeros((len(speed), 1))
    signals = {"time": time, "tendon_force": nothing, "tendon_position": nothing.copy()}
    joint = {"joint_position": position, "joint_velocity": speed[:, None]}
    return run_recording(one_joint(), signals | joint, 3)


def figure_2b(folder: Path) -> Figures:
    """T = T_eff − b_eff over the velocity: 0 up to v_min, eq. (1) beyond; the largest difference, N·m."""
    speed = np.linspace(-0.6, 0.6, 1201)
    outputs = run_joint(speed)
    friction = (outputs["friction_torque"] - outputs["bias_torque"])[:, 0]
    expected = np.where(np.abs(speed) > THRESHOLD, law(speed), 0.0)
    rows = {"friction (mN·m)": {"eq. (1)": 1e3 * law(speed), "the core": 1e3 * friction}}
    draw(folder / "paper_2b.html", "joint velocity (rad/s)", speed, rows, {REST: [(-THRESHOLD, THRESHOLD)]})
    return {"largest_difference": float(np.abs(friction - expected).max())}


def figure_5(folder: Path) -> Figures:
    """A fast reversal, and one with a rest of 0.5 s: the first is undone, the second forgotten by e^(−αt); N·m."""
    fast = np.concatenate([np.full(200, 0.3), np.linspace(0.3, -0.3, 20), np.full(280, -0.3)])
    rest = np.concatenate([np.linspace(-0.3, 0.0, 20), np.zeros(500), np.linspace(0.0, 0.3, 20), np.full(260, 0.3)])
    speed = np.concatenate([fast, rest])
    outputs = run_joint(speed)
    total, bias = outputs["friction_torque"][:, 0], outputs["bias_torque"][:, 0]
    time = np.arange(len(speed)) / RATE
    slow = np.abs(speed) <= THRESHOLD
    torques = {"bias b_eff": 1e3 * bias, "friction T by eq. (1)": 1e3 * (total - bias), "both, T_eff": 1e3 * total}
    rows = {"velocity (rad/s)": {"velocity": speed}, "torque (mN·m)": torques}
    draw(folder / "paper_5.html", "time (s)", time, rows, {REST: flagged_stretches(time, slow)})
    steps = np.abs(np.diff(total))
    enters, leaves = np.flatnonzero(~slow[:-1] & slow[1:]), np.flatnonzero(slow[:-1] & ~slow[1:])
    twice = 2.0 * float(law(np.array([THRESHOLD]))[0])
    figures: Figures = {"steps_to_rest": steps[enters].tolist()}
    for name, enter, leave, change in (
        ("fast", enters[0], leaves[0], bias[450] - bias[150]),
        ("with_rest", enters[1], leaves[1], bias[-1] - bias[450]),
    ):
        span = (leave - enter - 1) / RATE  # s between the first and the last sample at rest
        figures[name] = {"at_rest": span, "change": abs(change), "formula": twice * (1.0 - np.exp(-FORGET * span))}
    return figures


# --- figures 6 to 8: the simulated index finger -----------------------------------------------------------------------


def simulated(rig: str, folder: Path) -> tuple[Path, Recording, pd.DataFrame]:
    """The recording's file, itself, and the truth at the same times."""
    recording, truth = folder / f"{rig}.parquet", folder / f"{rig}_truth.parquet"
    tendonfmu("simulate", EXAMPLES / "rigs" / f"{rig}.json", "-o", recording, "--truth", truth)
    return recording, read_recording(recording), pd.read_parquet(truth)


def joints_of(truth: pd.DataFrame, name: str) -> Numbers:
    """[N, n] of a signal of the truth."""
    return np.asarray(truth[[column for column in truth.columns if column.startswith(f"{name}[")]])


def prediction(number: int, fit: FrictionFit, case: tuple[Path, Recording, pd.DataFrame], folder: Path) -> Figures:
    """Joint torques and predicted friction of the first two joints, as figs. 6 and 7; mN·m rms of each joint."""
    file, recording, truth = case
    predicted = fit.predict(file)
    torque = joints_of(truth, "joint_torque")
    friction = joints_of(truth, "friction_torque")
    time = recording.time
    show = (time >= SHOWN[0]) & (time <= SHOWN[1])
    rows = {}
    for joint in JOINTS:
        curves = {
            f"τ{joint + 1} of the tendons": torque,
            "true friction": friction,
            f"T{joint + 1} predicted": predicted,
        }
        label = f"joint {joint + 1}, torque (mN·m)"
        rows[label] = {name: 1e3 * values[show, joint] for name, values in curves.items()}
    draw(folder / f"paper_{number}.html", "time (s)", time[show], rows)
    known = ~np.isnan(predicted).any(axis=1)
    return {
        "torque": [1e3 * rms(torque[known, joint]) for joint in JOINTS],
        "residual": [1e3 * rms((predicted - torque)[known, joint]) for joint in JOINTS],
        "error": [1e3 * rms((predicted - friction)[known, joint]) for joint in JOINTS],
    }


def figure_8(fit: FrictionFit, case: tuple[Path, Recording, pd.DataFrame], folder: Path) -> Figures:
    """Joint torques, compensated torques, sensed force and detected contact during motion with pushes."""
    _, recording, truth = case
    external, force = joints_of(truth, "external_torque"), np.linalg.norm(joints_of(truth, "contact_force"), axis=1)
    pushed = truth["contact"].to_numpy() > 0
    described = {"fitted": fit.description_.data, "calibrated": json.loads(CALIBRATED.read_text(encoding="utf-8"))}
    runs = {name: run_recording(data, recording.arrays()) for name, data in described.items()}
    draw_8(recording.time, joints_of(truth, "joint_torque"), runs["calibrated"], external, force, folder)
    figures: Figures = {}
    for name, outputs in runs.items():
        missed = (outputs["compensated_torque"] - external)[pushed]
        alarm = outputs["contact"].astype(bool).reshape(-1)
        reported = [bool(alarm[first : last + 1].any()) for first, last in stretches(recording.time, pushed)]
        figures[name] = {
            "error": [1e3 * rms(column) for column in missed.T],  # mN·m rms in contact
            "reported": sum(reported),
            "pushes": len(reported),
            "false_share": float(np.mean(alarm[~pushed])),
        }
    return figures


def draw_8(
    time: Numbers, torque: Numbers, outputs: dict[str, Numbers], external: Numbers, force: Numbers, folder: Path
) -> None:
    show = (time >= SHOWN[0]) & (time <= SHOWN[1])
    felt = {f"τ{joint + 1} − T{joint + 1}": outputs["compensated_torque"][:, joint] for joint in JOINTS}
    felt |= {f"true external torque {joint + 1}": external[:, joint] for joint in JOINTS}
    rows = {
        "torque (mN·m)": {f"τ{joint + 1}": 1e3 * torque[show, joint] for joint in JOINTS},
        "compensated (mN·m)": {name: 1e3 * values[show] for name, values in felt.items()},
        "force (N)": {"|F| of the push": force[show]},
    }
    contact = flagged_stretches(time[show], outputs["contact"].reshape(-1)[show])
    draw(folder / "paper_8.html", "time (s)", time[show], rows, {("contact", ORANGE): contact})


# --- all --------------------------------------------------------------------------------------------------------------


def draw(file: Path, x_label: str, x: Numbers, rows: Any, shaded: Any = MappingProxyType({})) -> None:
    series_figure("", x_label, x, rows, shaded).write_html(file)


def measure(folder: Path, workers: int) -> Figures:
    """The figures as paper_*.html in the folder, and their numbers."""
    low, high, pushes = (simulated(rig, folder) for rig in ("index_finger", "index_finger_x4", "index_finger_pushes"))
    fit = FrictionFit(INDEX_FINGER).fit([low[0]])
    return {
        "2b": figure_2b(folder),
        "5": figure_5(folder),
        "6": prediction(6, fit, low, folder),
        "7": prediction(7, fit, high, folder),
        "8": figure_8(fit, pushes, folder),
    }
