"""Friction fitted on recordings made in MuJoCo and written back into a model, against the model that moved."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjcf_models import ARMS, fixed_model
from tendonfmu.estimate import FitWarning, FrictionFit
from tendonfmu.files import write_table
from tendonfmu.mjcf import export_numbers, import_finger
from tendonfmu.options import ImportOptions

SECONDS, EVERY, SETTLE = 25.0, 4, 1.0  # s, steps a sample, s
STIFFNESS = 6000.0  # N/m
PLACES = (
    ("joints[1].friction.coulomb", "frictionloss", "mcp"),
    ("joints[2].friction.coulomb", "frictionloss", "pip"),
    ("joints[1].friction.viscous", "damping", "mcp"),
    ("joints[2].friction.viscous", "damping", "pip"),
)


@dataclass(frozen=True)
class Recovered:
    """A number of the exported model, in SI units."""

    attribute: str
    joint: str
    value: float
    error: float  # standard error of the fit
    true: float


def machine() -> str:
    """The model that moves: friction in the joints alone, damped drives, no constraint, no drive beside the tendons."""
    text = fixed_model().replace('kp="4000"', f'kp="{STIFFNESS:g}" kv="{STIFFNESS / 100:g}"')
    text = text.replace('<motor name="direct" joint="pip"/>', "").replace(' frictionloss="0.4"', "")
    return text.replace('<equality><joint name="coupled" joint1="pip" joint2="mcp"/></equality>', "")


def guess() -> str:
    """The user's model: the same drawing, other friction."""
    text = machine().replace('damping="0.002" frictionloss="0.006"', 'damping="0.001" frictionloss="0.01"')
    return text.replace('frictionloss="0.004"', 'frictionloss="0.01"')


def record(text: str, file: Path, seed: int) -> None:
    """A recording of 25 s: two sines a joint, two pretensions between 5 and 15 N, 10 mN of noise."""
    model = mujoco.MjModel.from_xml_string(text)
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    arms, step = np.array(ARMS), model.opt.timestep
    phases = random.uniform(0.0, 2 * np.pi, (2, 2))
    preload = np.array([[1.0, 9 / 7, 0.0, 0.0], [0.0, 0.0, 1.0, 16 / 15]]) / STIFFNESS
    rows = []
    for k in range(round((SETTLE + SECONDS) / step)):
        t = k * step
        turns = 2 * np.pi * t * np.array([[0.37, 0.71], [0.53, 0.83]]) + phases
        angles = 0.35 + 0.4 * np.sin(turns).sum(axis=1)
        pull = 10.0 + 5.0 * np.sin(2 * np.pi * np.array([0.11, 0.17]) * t)
        motors = arms @ angles + pull @ preload
        data.ctrl[:4] = -motors
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        if k % EVERY == 0 and t > SETTLE:
            force = -data.actuator_force[:4] + random.normal(0.0, 0.01, 4)
            rows.append(np.concatenate([[t], force, motors, data.qpos[:2], data.qvel[:2]]))
    names = ["time"]
    for group, count in (("tendon_force", 4), ("tendon_position", 4), ("joint_position", 2), ("joint_velocity", 2)):
        names += [f"{group}[{i}]" for i in range(1, count + 1)]
    write_table(file, dict(zip(names, np.array(rows).T, strict=True)))


def recover(folder: Path, seed: int) -> list[Recovered]:
    """What import, fit and export make of a recording; leaves its files in the folder."""
    record(machine(), folder / "free.parquet", seed)
    (folder / "guess.xml").write_text(guess(), encoding="utf-8")
    start = import_finger(folder / "guess.xml", ImportOptions(joints=("mcp", "pip"))).data
    start["bias"] = {"drift_variance": 1e-8, "noise_std": 0.001, "noise_time": 0.01}
    (folder / "start.json").write_text(json.dumps(start), encoding="utf-8")
    fitting = FrictionFit(folder / "start.json", kinematics=3, effective_samples=True, fix=["*.inertia"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)  # sticking is no white noise: effective_samples counts it as less
        fitting.fit([folder / "free.parquet"])
    fitting.description_.write(folder / "fitted.json")
    export_numbers(folder / "fitted.json", folder / "guess.xml", folder / "fitted.xml")
    fitted = mujoco.MjModel.from_xml_path(str(folder / "fitted.xml"))
    true = mujoco.MjModel.from_xml_string(machine())
    errors = {row["path"]: row["standard_error"] for row in fitting.report_["parameters"]}
    return [
        Recovered(attribute, joint, number(fitted, attribute, joint), errors[path], number(true, attribute, joint))
        for path, attribute, joint in PLACES
    ]


def number(model: Any, attribute: str, joint: str) -> float:
    """A number of a joint as MuJoCo has compiled it."""
    return float(getattr(model, f"dof_{attribute}")[model.joint(joint).dofadr[0]])
