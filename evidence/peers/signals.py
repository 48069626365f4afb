"""The recordings that all tools share, and what the others read of them: the same signals behind one filter."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import signal

import tendonfmu as tf
from evidence import machines
from evidence.cases import ROOT
from evidence.families import cases
from tendonfmu.arrays import Numbers

CUTOFF = 20.0  # Hz, of a causal filter of second order: all signals are as late
RATE = 50.0  # Hz, at which the tools learn and are judged
SETTLE = 0.5  # s from the first sample that nobody is judged on
LAGS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5)  # s of history
DEMO = ROOT / "examples" / "demo_recording"


@dataclasses.dataclass(frozen=True)
class Case:
    """A machine, what is learned of it, and the unseen motion that judges."""

    finger: Mapping[str, Any]  # rough description
    learned: Sequence[tf.Recording]
    unseen: Sequence[tf.Recording]
    kinematics: int = 2  # of TendonFMU: 1 without measured angles
    chain: bool = True  # weights of links act on all joints before them
    calibrated: bool = True  # by `tendonfmu calibrate`; else by `diagnose`: a machine without pretension

    @property
    def arms(self) -> Numbers:
        """[m, n] moment arms, m."""
        return np.array([tendon["moment_arms"] for tendon in self.finger["tendons"]], dtype=float)

    @property
    def stiffness(self) -> Numbers:
        """[m] N/m."""
        return np.array([tendon["stiffness"] for tendon in self.finger["tendons"]], dtype=float)


@dataclasses.dataclass(frozen=True)
class Signals:
    """One recording, or several in a row, as the other tools read it."""

    time: Numbers  # [N] s
    angle: Numbers  # [N, n] rad
    velocity: Numbers  # [N, n] rad/s
    acceleration: Numbers  # [N, n] rad/s²
    force: Numbers  # [N, m] N
    motor: Numbers  # [N, m] m
    torque: Numbers  # [N, n] N·m, of the measured forces, less the known load: what a tool predicts
    history: Numbers  # [N, 2·n·lags] angles and velocities at LAGS before

    @classmethod
    def joined(cls, parts: Sequence[Signals]) -> Signals:
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in dataclasses.fields(cls)))

    def rows(self, which: slice) -> Signals:
        return Signals(*(getattr(self, f.name)[which] for f in dataclasses.fields(self)))


def signals_of(case: Case, recording: tf.Recording, rate: float = RATE) -> Signals:
    """Filtered, with derivatives, at a rate; an angle that was not measured follows from motors and springs."""
    groups, step = recording.groups, float(np.median(np.diff(recording.time)))
    force = groups["tendon_force"]
    motor = groups.get("tendon_position", np.zeros_like(force))
    angle = groups.get("joint_position")
    if angle is None:
        angle = np.linalg.lstsq(case.arms, (motor - force / case.stiffness).T, rcond=None)[0].T
    angle, force, motor = (filtered(values, step) for values in (angle, force, motor))
    measured = groups.get("joint_velocity")
    velocity = np.gradient(angle, step, axis=0) if measured is None else filtered(measured, step)
    torque = force @ case.arms - filtered(known_load(recording, angle), step)
    late = [round(lag / step) for lag in LAGS]
    history = np.hstack([delayed(values, rows) for values in (angle, velocity) for rows in late])
    acceleration = np.gradient(velocity, step, axis=0)
    kept = rows_at(recording, rate)
    columns = (recording.time, angle, velocity, acceleration, force, motor, torque, history)
    return Signals(*(column[kept] for column in columns))


def filtered(values: Numbers, step: float) -> Numbers:
    """Low-passed, from the first value on."""
    form = signal.butter(2, min(2 * step * CUTOFF, 0.99), output="sos")
    start = signal.sosfilt_zi(form)[:, :, None] * values[0]
    return np.asarray(signal.sosfilt(form, values, axis=0, zi=start)[0])


def known_load(recording: tf.Recording, like: Numbers) -> Numbers:
    """[N, n] N·m from outside, as a sensor of the test rig measured it."""
    return np.asarray(recording.groups.get("external_torque", np.zeros_like(like)))


def delayed(values: Numbers, rows: int) -> Numbers:
    return np.concatenate([np.repeat(values[:1], rows, axis=0), values])[: len(values)]


def rows_at(recording: tf.Recording, rate: float) -> slice:
    """Rows from SETTLE on, at a rate at most."""
    step = float(np.median(np.diff(recording.time)))
    return slice(round(SETTLE / step), None, max(round(1.0 / (rate * step)), 1))


def recording_of(frame: pd.DataFrame, name: str) -> tf.Recording:
    groups: dict[str, Numbers] = {}
    for group in ("tendon_force", "tendon_position", "joint_position"):
        columns = [column for column in frame if str(column).startswith(f"{group}[")]
        if columns:
            groups[group] = frame[columns].to_numpy()
    return tf.Recording(Path(name), frame["time"].to_numpy(), groups)


# --- cases ------------------------------------------------------------------------------------------------------------

SEED = 3  # odd, and hides nothing


def by_seed(folder: Path, family: str) -> Case:
    """A finger of evidence/families: 100 s, and 60 s of another motion."""
    made = cases.kept(folder, family, SEED)
    learned, unseen = (recording_of(made.recordings[name], name) for name in ("train", "test"))
    return Case(made.nominal, [learned], [unseen])


def demo() -> Case:
    """The finger of `tendonfmu demo`, which hides a weight; it measures no angle: 60 s, and 40 s."""
    finger = json.loads((DEMO / "two_joints.json").read_text(encoding="utf-8"))
    learned, unseen = (tf.read_recording(DEMO / f"two_joints_{name}.parquet") for name in ("training", "unseen"))
    return Case(finger, [learned], [unseen], kinematics=1)


def measured(machine: machines.Machine, unseen: str) -> Case:
    finger = machine.finger
    data = finger if isinstance(finger, Mapping) else json.loads(Path(finger).read_text(encoding="utf-8"))
    return Case(data, machine.learned, machine.judged[unseen], machine.kinematics, chain=False, calibrated=False)


def make(folder: Path, name: str) -> Case:
    if name in FAMILIES:
        return by_seed(folder, FAMILIES[name])
    if name == "demo finger":
        return demo()
    return measured(
        *((machines.jaw(), "odd loads") if name == "da Vinci jaw" else (machines.psm(1, 2), "other excitations"))
    )


FAMILIES = {"MuJoCo finger": "elastic", "Maxwell-slip finger": "maxwell"}
NAMES = (*FAMILIES, "demo finger", "da Vinci jaw", "PSM joints 1 and 2")
