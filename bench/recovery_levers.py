"""What makes numbers identifiable: the recovery campaign's case (recovery_case.py) with one thing changed at a time.

    python bench/recovery_levers.py

Counts numbers with a standard error below 30 % of their value, from the Fisher information at the truth; 400 s at
100 Hz, with as much noise per second as at 1 kHz. Nothing is fitted.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import recovery_case as case
from tendonfmu.excite.excitation import Plan, plan_excitation
from tendonfmu.excite.training_motion import as_array, find_ranges, read_subject
from tendonfmu.model.balance import balanced_forces, moment_arms

RATE = 100.0
OWN = {"noise_std": 0.004, "noise_std_per_force": 0.0006, "noise_time": 0.002, "drift_variance": 1e-6}
QUIETER = {"noise_std": 2.5e-4}
NOISIER = {"noise_std": 1e-3}
DRIFTING = {"drift_variance": 1e-7}


def identifiable(bias: dict[str, float], **motion: Any) -> tuple[int, int]:
    """(how many, of how many). bias: other noise than the case's; motion: of the plan, other than the case's."""
    truth = case.true_finger()
    truth["bias"] = truth["bias"] | bias
    ranges = as_array(find_ranges(read_subject(case.FINGER), []))
    usual = Plan(ranges, case.MAX_SPEED, case.DURATION, (10.0,), None, RATE, 0, case.TENSIONS, case.MAX_ACCELERATION)
    made = plan_excitation(truth, replace(usual, **motion))
    angles = {name: getattr(made, name) for name in ("time", "joint_position", "joint_velocity")}
    force = balanced_forces(truth, angles, made.tension)
    stiffness = np.array([tendon["stiffness"] for tendon in truth["tendons"]])
    position = made.joint_position @ moment_arms(truth).T + force / stiffness
    recording = {"time": made.time, "tendon_force": force, "tendon_position": position}
    recording["external_torque"] = np.zeros_like(made.joint_position)  # what is measured does not matter here
    found = case.identifiable(case.Case(truth, truth, recording, float(force.min())), case.Scale(truth))
    return int(found.sum()), len(found)


def main() -> None:
    slow = {"max_speed": 1.0, "max_acceleration": 10.0}
    even = {"vary": None, "pretensions": (35.0,)}
    variants: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
        "the campaign's case": ({}, {}),
        "noise 0.25 mN·m instead of 0.5": (QUIETER, {}),
        "noise 1 mN·m": (NOISIER, {}),
        "drift of 0.3 mN·m in 1 s instead of 0.1": (DRIFTING, {}),
        "--max-speed 2, --max-acceleration 10": ({}, {"max_speed": 2.0, "max_acceleration": 10.0}),
        "--max-speed 1, --max-acceleration 10": ({}, slow),
        "--pretension 35 instead of --vary-tension": ({}, even),
        "--pretension 10": ({}, even | {"pretensions": (10.0,)}),
        "--pretension 10 and slow: excite's default": ({}, even | slow | {"pretensions": (10.0,)}),
        "the finger's own noise (with errors of the model)": (OWN, {}),
        "the finger's own noise, excite's default": (OWN, even | slow | {"pretensions": (10.0,)}),
        "100 s": ({}, {"duration": 100.0}),
    }
    table = Table(title="numbers identifiable")
    for heading in ("", "numbers", "share"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, (bias, motion) in variants.items():
        count, of = identifiable(bias, **motion)
        table.add_row(name, f"{count} of {of}", f"{count / of:.0%}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
