"""Makers of the foreign cases of a campaign: the plans of both families with another seed, and other joints in MuJoCo.

In MuJoCo finger, starting numbers, motion and noise are the seed's; the five numpy fingers are what they are, with
starting numbers, motion and noise by the seed.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

import fingers_in_numpy
from foreign_case import Case, Nominal, Truth, rough

FRICTION = ("friction", "load_friction")
SIZES = ("static", "coulomb", "viscous")


def numpy_finger(folder: Path, number: int, seed: int, seconds: float, gain_recordings: int) -> dict[str, Any]:
    """A case of fingers_in_numpy.py. The test and the recordings for the true gain are as long as the first one."""
    case = fingers_in_numpy.make(number, seconds, seconds, seed)
    simulator = fingers_in_numpy.PLANS[number - 1].simulator
    random = np.random.default_rng((seed, number, 3))
    found = written(folder, dataclasses.replace(case, nominal=rougher(case.nominal, random)), "numpy")
    case.test.to_parquet(folder / "test.parquet", index=False)
    names = [f"gain_{k + 1}.parquet" for k in range(gain_recordings)]
    for name in names:
        made = simulator.simulate(case.truth.hidden, seconds, random)
        fingers_in_numpy.recording(made).to_parquet(folder / name, index=False)
    found["facts"]["simulator"] = simulator.__name__
    return found | {"test": ["test.parquet"], "gain_recordings": names}


def mujoco_finger(folder: Path, number: int, seed: int, joints: int, seconds: float, rate: float) -> dict[str, Any]:
    """A case of fingers_in_mujoco.py with as many joints. rate: Hz, at most."""
    import fingers_in_mujoco  # mujoco need not be there for the other family

    plan = fingers_in_mujoco.PLANS[number - 1]
    plan = dataclasses.replace(plan, joints=joints, rate=min(plan.rate, rate))
    return written(folder, fingers_in_mujoco.of_plan(plan, number, seed, seconds, 1.0), "mujoco")


def rougher(nominal: Nominal, random: np.random.Generator) -> Nominal:
    """The description with starting numbers of its own: each size of friction and each cover times 0.6 to 1.6."""
    found: Nominal = json.loads(json.dumps(nominal))  # joints may share a law

    def move(law: dict[str, Any] | None) -> None:
        for each in [] if law is None else law.get("laws", [law]):
            factor = rough(1.0, random)
            each |= {key: each[key] * factor for key in SIZES if key in each}

    for joint in found["joints"]:
        for key in FRICTION:
            move(joint.get(key))
        if joint.get("cover"):
            joint["cover"]["stiffness"] = rough(joint["cover"]["stiffness"], random)
    for tendon in found["tendons"]:
        for law in [*(tendon.get("edge_friction") or ()), *(tendon.get("pulley_friction") or ())]:
            move(law)
    return found


def written(folder: Path, case: Case, family: str) -> dict[str, Any]:
    """The case's files and the keys of a campaign's case."""
    (folder / "finger.json").write_text(json.dumps(case.nominal), encoding="utf-8")
    case.train.to_parquet(folder / "recording.parquet", index=False)
    truth = case.truth
    facts: dict[str, Any] = {"joints": truth.joints, "hidden": truth.hidden, "hidden_rms": truth.rms or 0.0}
    return {
        "finger": "finger.json",
        "recordings": ["recording.parquet"],
        "kinematics": 2 if any(name.startswith("joint_position") for name in case.train.columns) else 1,
        "rig": family,
        "truth": hidden_in(truth),
        "also": ["presliding", *truth.also],
        "facts": facts,
    }


def hidden_in(truth: Truth) -> list[dict[str, Any]]:
    if truth.hidden == "none":
        return []
    if truth.hidden.startswith("unknown"):
        return [{"effect": "unknown"}]
    place = {"joint": truth.joint, "tendon": truth.tendon}
    return [{"effect": truth.hidden} | {key: value for key, value in place.items() if value is not None}]
