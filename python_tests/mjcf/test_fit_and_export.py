"""From a recording made in MuJoCo to its frictionloss: import, fit, export, against the model that moved."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("tendonfmu._estimation", reason="SKIPPED: tendonfmu is not installed with its estimation")
pytest.importorskip("mujoco", reason="SKIPPED: mujoco is not installed (requirements-foreign.lock)")

import mujoco

from mjcf_models import ARMS, fixed_model
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.files.tables import write_table
from tendonfmu.mjcf.finger_import import ImportSettings, import_finger
from tendonfmu.mjcf.number_export import export_numbers

SECONDS, EVERY, SETTLE = 25.0, 4, 1.0  # s, steps a sample, s
STIFFNESS = 6000.0  # N/m
INTERVAL = 1.96  # standard errors; 95 %


def machine() -> str:
    """The model that moves: friction in the joints alone, damped drives, no constraint, no drive beside the tendons."""
    text = (
        fixed_model()
        .replace('kp="4000"', f'kp="{STIFFNESS:g}" kv="{STIFFNESS / 100:g}"')
        .replace('<motor name="direct" joint="pip"/>', "")
    )
    text = text.replace(' frictionloss="0.4"', "")
    return text.replace('<equality><joint name="coupled" joint1="pip" joint2="mcp"/></equality>', "")


def record(text: str, file: Path) -> None:
    """A recording of 25 s: two fast sines a joint, the pretension between 5 and 15 N, 10 mN of noise."""
    model = mujoco.MjModel.from_xml_string(text)
    data, random = mujoco.MjData(model), np.random.default_rng(5)
    arms, step = np.array(ARMS), model.opt.timestep
    preload = np.array([1.0, 1.2857, 0.0, 0.0]) / STIFFNESS, np.array([0.0, 0.0, 1.0, 1.0667]) / STIFFNESS
    rows = []
    for k in range(round((SETTLE + SECONDS) / step)):
        t = k * step
        turns = 2 * np.pi * t * np.array([[0.37, 0.71], [0.53, 0.83]]) + np.array([[0.0, 1.0], [2.0, 3.0]])
        angles = 0.35 + 0.4 * np.sin(turns).sum(axis=1)
        pull = 10.0 + 5.0 * np.sin(2 * np.pi * np.array([0.11, 0.17]) * t)
        motors = arms @ angles + pull[0] * preload[0] + pull[1] * preload[1]
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


@pytest.mark.slow
def test_fitted_friction_is_that_of_the_model_that_moved(tmp_path: Path) -> None:
    record(machine(), tmp_path / "free.parquet")
    # The user's model has other numbers; its drawing is right.
    guessed = machine().replace('damping="0.002" frictionloss="0.006"', 'damping="0.001" frictionloss="0.01"')
    guessed = guessed.replace('frictionloss="0.004"', 'frictionloss="0.01"')
    (tmp_path / "guessed.xml").write_text(guessed, encoding="utf-8")
    start = import_finger(tmp_path / "guessed.xml", ImportSettings(joints=("mcp", "pip"))).data
    start["bias"] = {"drift_variance": 1e-8, "noise_std": 0.001, "noise_time": 0.01}
    (tmp_path / "start.json").write_text(json.dumps(start), encoding="utf-8")
    fitting = FrictionFit(tmp_path / "start.json", kinematics=3, effective_samples=True, fix=["*.inertia"])
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", FitWarning
        )  # sticking is no white noise; effective_samples takes it into account
        fitting.fit([tmp_path / "free.parquet"])
    (tmp_path / "fitted.json").write_text(fitting.description_text(), encoding="utf-8")
    export_numbers(tmp_path / "fitted.json", tmp_path / "guessed.xml", tmp_path / "out.xml")
    found, true = (mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml")), mujoco.MjModel.from_xml_string(machine()))
    errors = standard_errors(fitting.report_)
    for path, name, index in (
        ("joints[1].friction.coulomb", "dof_frictionloss", 0),
        ("joints[2].friction.coulomb", "dof_frictionloss", 1),
        ("joints[1].friction.viscous", "dof_damping", 0),
        ("joints[2].friction.viscous", "dof_damping", 1),
    ):
        value, truth = getattr(found, name)[index], getattr(true, name)[index]
        assert abs(value - truth) <= INTERVAL * errors[path], path
        assert errors[path] < 0.2 * truth, path


def standard_errors(report: dict[str, Any]) -> dict[str, float]:
    return {row["path"]: row["standard_error"] for row in report["parameters"]}
