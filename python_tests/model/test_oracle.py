"""The analytic cases and the general properties, on the oracle and on every other runner."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

import analytic_extension_cases  # noqa: F401  adds cases
import analytic_force_cases  # noqa: F401
from analytic_cases import CASES, DRY, finger, one_edge, recording
from random_fingers import random_law, random_moment_arms
from repetitions import repeated
from runners import RUNNERS, SLOW, Runner


@pytest.fixture(params=RUNNERS, ids=lambda runner: runner.name)
def runner(request: pytest.FixtureRequest) -> Runner:
    chosen: Runner = request.param
    return chosen


# Calls from Python for each sample, and packed FMUs, take their time.
RUNS = [
    pytest.param(runner, name, id=f"{runner.name}-{name}", marks=pytest.mark.long if k % 4 and runner in SLOW else [])
    for runner in RUNNERS
    for k, name in enumerate(CASES)
]


@pytest.mark.parametrize(("runner", "name"), RUNS)
def test_case(runner: Runner, name: str) -> None:
    if name == "same_time_step" and not runner.repeated_time:
        pytest.skip(f"{runner.name} takes recordings of strictly increasing time only")

    def run(description: Any, samples: Any, source: int = 3) -> Any:
        return runner(description, samples, source)

    check = CASES[name]
    check(run)


def test_the_step_does_not_matter_while_moving(runner: Runner) -> None:
    """No entry, no exit and no filter: the rate of sampling leaves no trace at all."""
    time = np.linspace(0.0, 2.0, 401)
    fine = recording(time, 10.0 + np.sin(time), 0.2 + 0.1 * np.sin(5.0 * time))
    coarse = {name: values[::4] for name, values in fine.items()}
    runs = [runner(one_edge(), each, 3) for each in (fine, coarse)]
    for name in ("friction_torque", "compensated_torque", "bias_torque"):
        np.testing.assert_array_equal(runs[0][name][::4], runs[1][name])


def dissipative_finger(rng: np.random.Generator) -> dict[str, Any]:
    """Edges and joint friction everywhere, no cover, no pulley."""
    n = int(rng.integers(1, 5))
    arms = random_moment_arms(rng, n + 2, n)
    tendons = [
        {
            "moment_arms": row.tolist(),
            "edge_friction": [random_law(rng, 0.05, 0.005) for _ in range(n)],
            "bidirectional": bool(rng.random() < 0.3),
        }
        for row in arms
    ]
    joints = [
        {"name": f"j{j}", "friction": random_law(rng, 0.01, 0.1), "load_friction": random_law(rng, 1e-4, 0.1)}
        for j in range(n)
    ]
    return finger(tendons, joints)


@pytest.mark.parametrize("seed", repeated(range(20), 0, 1, 2))
def test_friction_never_drives(runner: Runner, seed: int) -> None:
    """At constant velocity the friction of edges and joints takes power out: Σ_j T_j q̇_j ≥ 0."""
    rng = np.random.default_rng(seed)
    description = dissipative_finger(rng)
    m, n = len(description["tendons"]), len(description["joints"])
    forces = rng.uniform(0.0, 20.0, (50, m))
    for i, tendon in enumerate(description["tendons"]):
        forces[:, i] *= -1.0 if tendon["bidirectional"] and rng.random() < 0.5 else 1.0
    speed = rng.uniform(-2.0, 2.0, n)
    out = runner(description, recording(np.arange(50) * 0.01, forces, speed, tendons=m, joints=n), 3)
    power = (out["friction_torque"] - out["bias_torque"]) @ speed
    assert (power > 0.0).all()


def test_defaults_are_those_of_the_contract(runner: Runner) -> None:
    """A finger with the required keys only equals one with every default written out."""
    short: dict[str, Any] = {
        "format": "tendonfmu-finger-1",
        "name": "short",
        "joints": [{"name": "a"}, {"name": "b"}],
        "tendons": [
            {"name": "t1", "stiffness": 2000.0, "moment_arms": [0.01, 0.008], "edge_friction": [DRY]},
            {"name": "t2", "stiffness": 2000.0, "moment_arms": [0.01, -0.008]},
        ],
        "contact": {"threshold": [0.02, 0.02]},
    }
    short["joints"][0]["cover"] = {"stiffness": 0.1}
    short["joints"][1]["friction"] = {"static": 0.01, "coulomb": 0.01, "stribeck_velocity": 0.1}
    written: dict[str, Any] = copy.deepcopy(short)
    written["joints"][0]["cover"]["rest_angle"] = 0.0
    written["joints"][1]["friction"]["viscous"] = 0.0
    written["joints"][1] |= {"cover": None, "load_friction": None}
    written["tendons"][0] |= {"edge_friction": [DRY, None], "pulley_friction": [None, None], "bidirectional": False}
    written |= {
        "velocity_threshold": {"tendon": 0.0005, "joint": 0.01},
        "velocity_filter_cutoff": 20.0,
        "bias": {"drift_variance": 1e-6, "noise_std": 0.01, "noise_std_per_force": 0.0, "forget_rate": 5.0},
        "extensions": [],
    }
    written["bias"]["initial_variance"] = 0.01**2
    written["contact"]["threshold_per_force"] = [0.0, 0.0]
    time = np.arange(400) * 0.005
    angle = 0.3 * np.sin(np.stack([2.0 * time, 3.0 * time], axis=1))
    force = 10.0 + np.sin(np.stack([time, 5.0 * time], axis=1))
    inputs = recording(time, force, 0.0, angle, tendons=2, joints=2)
    runs = [runner(description, inputs, 2) for description in (short, written)]
    assert runs[0]["contact"].any()
    for name, series in runs[0].items():
        np.testing.assert_array_equal(series, runs[1][name], err_msg=name)
