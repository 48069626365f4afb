"""Draws figures 2b, 5, 6, 7 and 8 of the paper again, on data whose truth is known: docs/reference/paper.md."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from evidence.cases import EXAMPLES, INDEX_FINGER
from evidence.part import Figures
from evidence.table import rms
from tendonfmu.arrays import Numbers
from tendonfmu.detect.counting import stretches
from tendonfmu.estimate import FrictionFit
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import Recording, read_recording

CALIBRATED = EXAMPLES / "demo_recording" / "index_finger_calibrated.json"
JOINTS = (0, 1)  # the paper shows the first two
SHOWN = (20.0, 36.0)  # s
MEASURED, PREDICTED, SENSED, FOUND = "#222222", "#56b4e9", "#009e73", "#e69f00"

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
    figure, axis = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axis.plot(speed, 1e3 * law(speed), color="#bbbbbb", linestyle="--", label="eq. (1)")
    axis.plot(speed, 1e3 * friction, color=PREDICTED, label="the core")
    axis.axvspan(-THRESHOLD, THRESHOLD, color="#f0e6d0", label="|v| ≤ v_min: the bias holds the friction")
    axis.set(xlabel="joint velocity (rad/s)", ylabel="friction (mN·m)")
    finish(figure, [axis], folder / "paper_2b.png")
    return {"largest_difference": float(np.abs(friction - expected).max())}


def figure_5(folder: Path) -> Figures:
    """A fast reversal, and one with a rest of 0.5 s: the first is undone, the second forgotten by e^(−αt); N·m."""
    fast = np.concatenate([np.full(200, 0.3), np.linspace(0.3, -0.3, 20), np.full(280, -0.3)])
    rest = np.concatenate([np.linspace(-0.3, 0.0, 20), np.zeros(500), np.linspace(0.0, 0.3, 20), np.full(260, 0.3)])
    speed = np.concatenate([fast, rest])
    outputs = run_joint(speed)
    total, bias = outputs["friction_torque"][:, 0], outputs["bias_torque"][:, 0]
    time = np.arange(len(speed)) / RATE
    figure, axes = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
    axes[0].plot(time, speed, color=MEASURED)
    axes[0].axhspan(-THRESHOLD, THRESHOLD, color="#f0e6d0")
    axes[0].set(ylabel="velocity (rad/s)")
    axes[1].plot(time, 1e3 * bias, color=FOUND, label="bias b_eff")
    axes[1].plot(time, 1e3 * (total - bias), color=MEASURED, linewidth=1, label="friction T by eq. (1)")
    axes[1].plot(time, 1e3 * total, color=PREDICTED, label="both, T_eff")
    axes[1].set(xlabel="time (s)", ylabel="torque (mN·m)")
    finish(figure, axes, folder / "paper_5.png")
    slow = np.abs(speed) <= THRESHOLD
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
    words = ["simulate", str(EXAMPLES / "rigs" / f"{rig}.json"), "-o", str(recording), "--truth", str(truth)]
    subprocess.run([sys.executable, "-m", "tendonfmu.cli", *words], check=True, stdout=subprocess.DEVNULL)
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
    figure, axes = plt.subplots(2, 1, figsize=(8, 4.6), sharex=True, layout="constrained")
    for axis, joint in zip(axes, JOINTS, strict=True):
        axis.plot(time[show], 1e3 * torque[show, joint], color=MEASURED, label=f"τ{joint + 1} of the tendons")
        axis.plot(time[show], 1e3 * friction[show, joint], color=SENSED, linewidth=1, label="true friction")
        axis.plot(time[show], 1e3 * predicted[show, joint], color=PREDICTED, label=f"T{joint + 1} predicted")
        axis.set(ylabel="torque (mN·m)")
    axes[-1].set(xlabel="time (s)")
    finish(figure, axes, folder / f"paper_{number}.png")
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
    figure, axes = plt.subplots(4, 1, figsize=(8, 7), sharex=True, layout="constrained", height_ratios=[3, 3, 2, 1])
    for joint, colour in zip(JOINTS, (MEASURED, PREDICTED), strict=True):
        axes[0].plot(time[show], 1e3 * torque[show, joint], color=colour, label=f"τ{joint + 1}")
        compensated = 1e3 * outputs["compensated_torque"][show, joint]
        axes[1].plot(time[show], compensated, color=colour, label=f"τ{joint + 1} − T{joint + 1}")
        axes[1].plot(time[show], 1e3 * external[show, joint], color=SENSED, linestyle="--", linewidth=1)
    axes[1].plot([], [], color=SENSED, linestyle="--", linewidth=1, label="true external torque")
    axes[2].plot(time[show], force[show], color=SENSED, label="|F| of the push")
    axes[3].fill_between(time[show], outputs["contact"].reshape(-1)[show], color=FOUND, step="post", label="contact")
    for axis, unit in zip(axes, ("torque (mN·m)", "compensated (mN·m)", "force (N)", ""), strict=True):
        axis.set(ylabel=unit)
    axes[3].set(xlabel="time (s)", yticks=[])
    finish(figure, axes, folder / "paper_8.png")


# --- all --------------------------------------------------------------------------------------------------------------


def finish(figure: Any, axes: Any, file: Path) -> None:
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(axis="y", color="#e5e5e5")
        if axis.get_legend_handles_labels()[0]:
            axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, ncols=3, frameon=False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def measure(folder: Path, workers: int) -> Figures:
    """The figures as paper_*.png in the folder, and their numbers."""
    low, high, pushes = (simulated(rig, folder) for rig in ("index_finger", "index_finger_x4", "index_finger_pushes"))
    fit = FrictionFit(INDEX_FINGER, uncertainty=False).fit([low[0]])
    return {
        "2b": figure_2b(folder),
        "5": figure_5(folder),
        "6": prediction(6, fit, low, folder),
        "7": prediction(7, fit, high, folder),
        "8": figure_8(fit, pushes, folder),
    }
