"""The foreign fingers: same seed same bits, sound mechanics, hidden effects of the stated size; and a run on them."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from functools import partial
from importlib import import_module
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from evidence.diagnosis import case as diagnosis_case
from evidence.diagnosis import foreign_cases, seen
from evidence.fingers import numpy_cases, recorded
from evidence.fingers.families import cases_of
from evidence.fingers.foreign import Array, Truth
from optional_parts import is_there, needs
from repetitions import repeated
from repository_paths import ROOT

if is_there("mujoco"):
    from evidence.fingers import mujoco_cases, mujoco_run

FOLDER = ROOT / "evidence" / "fingers"
SECONDS = 6.0  # of the training recordings that are made here
NEEDS_MUJOCO = needs("mujoco")
# every numpy case, and the MuJoCo cases that use different parts of its model
MUJOCO_NUMBERS = (3, 11, 14)
BEDS = [pytest.param("numpy_cases", number, id=f"numpy_{number:02d}") for number in numpy_cases.NUMBERS]
BEDS += [
    pytest.param("mujoco_cases", number, id=f"mujoco_{number:02d}", marks=NEEDS_MUJOCO) for number in MUJOCO_NUMBERS
]
# Effects that alter what the sensors say of a position, so that R⁺ x1 is not the joint angle.
BENT = {"time_delay", "pulley_eccentricity", "moment_arm_variation", "force_gain", "force_offset"}
# Effects whose hidden torque is not what makes them visible: a delay turns friction around too late, a constant offset
# and a gain go into the bias and the laws.
UNSIZED = {"none", "time_delay", "force_gain", "force_offset"}


def bed(module: str) -> ModuleType:
    return import_module(f"evidence.fingers.{module}")


def columns(data: pd.DataFrame, name: str) -> Array:
    return data[[column for column in data if column.startswith(name)]].to_numpy()


@pytest.mark.parametrize(
    ("module", "number"),
    [
        ("numpy_cases", 1),
        ("numpy_cases", 2),
        pytest.param("mujoco_cases", 1, marks=NEEDS_MUJOCO),
    ],
)
def test_the_same_seed_gives_the_same_case(module: str, number: int) -> None:
    first, second = (bed(module).make(number, 1.0, 0.5) for _ in range(2))
    pd.testing.assert_frame_equal(first.train, second.train, check_exact=True)
    pd.testing.assert_frame_equal(first.test, second.test, check_exact=True)
    assert first.nominal == second.nominal
    assert not np.array_equal(
        columns(first.train, "tendon_position")[:100], columns(first.test, "tendon_position")[:100]
    )


@pytest.mark.parametrize(("module", "number"), repeated(BEDS, 0, 4, 6, 8, 11, 16, 17))
def test_a_case_is_sound(module: str, number: int) -> None:
    case = bed(module).make(number, SECONDS, 1.0)
    truth, inside, arms = case.truth, case.inside, np.array([row["moment_arms"] for row in case.nominal["tendons"]])
    m, n = arms.shape

    # the description has the right form, and recordings have the columns of the contract
    assert truth.joints == len(case.nominal["joints"]) == n == np.linalg.matrix_rank(arms)
    for tendon in case.nominal["tendons"]:
        assert len(tendon.get("edge_friction", [None])) <= n and tendon.get("pulley_friction", [None])[-1] is None
    assert truth.joint is None or 1 <= truth.joint <= n
    assert truth.tendon is None or 1 <= truth.tendon <= m
    expected = ["time", *(f"tendon_{kind}[{i}]" for kind in ("force", "position") for i in range(1, m + 1))]
    if "joint_position[1]" in case.train:
        expected += [f"joint_position[{j}]" for j in range(1, n + 1)]
    for data in (case.train, case.test):
        assert list(data) == expected
        assert np.isfinite(data.to_numpy()).all() and data["time"].iloc[0] == 0.0
        rate = 1 / np.diff(data["time"])
        assert rate.min() > 249.0 and rate.max() < 1001.0
        assert columns(data, "tendon_force").min() > 2.0  # no tendon is slack
    assert case.train["time"].iloc[-1] == pytest.approx(SECONDS, abs=0.03)

    # positions and forces give the true angle: 50 mN through 3000 N/m on an arm of 7 mm are 2.4 mrad of one tendon
    stiffness = np.array([tendon["stiffness"] for tendon in case.nominal["tendons"]])
    x1 = columns(case.train, "tendon_position") - columns(case.train, "tendon_force") / stiffness
    error = x1 @ np.linalg.pinv(arms).T - inside.angle
    assert error.std(axis=0).max() < 0.003 or truth.hidden in BENT
    if "joint_position[1]" in case.train:
        assert np.abs(columns(case.train, "joint_position") - inside.angle).max() < 2e-4

    # torques balance; MuJoCo solves for its constraints' forces to a tolerance
    assert np.abs(inside.measured - inside.described - inside.hidden).max() < 1e-5
    noise = columns(case.train, "tendon_force") @ arms - inside.measured
    assert noise.std(axis=0).max() < 0.05 * 0.01 * 6**0.5

    # hidden torques have their size: of the first seconds; the whole recordings have 8 to 30 mN·m
    if truth.hidden == "none":
        assert truth.rms < 1e-9
    elif truth.hidden not in UNSIZED:
        assert 0.004 < truth.rms < 0.05


@NEEDS_MUJOCO
def test_spatial_and_fixed_tendons_make_the_same_finger() -> None:
    """Wrapped around cylinders on the joints' axes, tendons have constant arms: the two routings must agree."""
    plan = mujoco_cases.Plan("none", 3)
    physics = mujoco_cases.finger(plan, np.random.default_rng(1))
    motion = mujoco_run.random_motion(3, np.random.default_rng(2))
    fixed, spatial = (
        mujoco_run.run(dataclasses.replace(physics, spatial=each), Truth("none", 3), motion, 0.5, 250.0)
        for each in (False, True)
    )
    assert np.abs(fixed.angle - spatial.angle).max() < 1e-9
    assert np.abs(fixed.force - spatial.force).max() < 1e-6


@NEEDS_MUJOCO
def test_the_probe_touches_while_it_pushes() -> None:
    number = next(k for k in mujoco_cases.NUMBERS if mujoco_cases.PLANS[k - 1].hidden == "contact")
    plan = mujoco_cases.PLANS[number - 1]
    rng = np.random.default_rng(3)
    physics = mujoco_cases.finger(plan, rng)
    physics = dataclasses.replace(physics, pushes=((1.0, 2.0, 0.8),))
    motion = mujoco_run.random_motion(plan.joints, rng)
    trace = mujoco_run.run(physics, Truth("contact", plan.joints), motion, 2.5, 250.0)
    touched = np.abs(trace.hidden).max(axis=1)
    assert touched[trace.time < 1.0].max() < 1e-9
    assert touched[(trace.time > 1.5) & (trace.time < 2.0)].min() > 0.01


@needs("foreign data")
def test_recorded_cases_are_read() -> None:
    numbers = recorded.numbers()
    assert len(numbers) == 26
    case = recorded.make(numbers[-1])
    assert case.name == "recorded_26" and case.truth.hidden == "force_gain"
    assert case.train["time"].iloc[-1] > 59.0 and case.test["time"].iloc[-1] > 29.0


def test_foreign_fingers_share_nothing_with_the_product() -> None:
    paths = [
        path
        for path in FOLDER.glob("*.py")
        if path.name.startswith(("numpy_", "mujoco_", "foreign", "sticking", "common"))
    ]
    assert len(paths) >= 11
    for path in paths:
        imported = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert not [name for name in imported if name.startswith("tendonfmu") or "matched" in name], path.name
        if path.name.startswith("numpy_") and path.stem != "numpy_cases":
            shared = {name.removeprefix("evidence.fingers.") for name in imported if name.startswith("evidence")}
            assert "foreign" in shared and shared <= {"foreign", "common_finger"}


# --- a run of the command, with a program in its place that writes what a test wants ----------------------------------

REPORT = {
    "verdict": "explained",
    "nominal": {"test_rms": [0.02, 0.01]},
    "extended": {"test_rms": [0.01, 0.005]},
    "too_small": [],
    "unexplained": {"share": 0.0},
    "gain": {"value": 0.5, "interval": [0.4, 0.6]},
    "causes": [{"effect": "gravity", "joint": 1, "tendon": None, "gain": {"value": 0.5, "interval": [0.4, 0.6]}}],
}
ARGUMENTS = "diagnose finger.json recording_1.parquet --test test_1.parquet --kinematics 1 -o report --no-progress"
WRITES = f"""
import os, sys
assert sys.argv[1:] == {ARGUMENTS!r}.split()
spent = sum(k * k for k in range(2_000_000))
os.mkdir("report")
open("report/diagnosis.json", "w").write({json.dumps(REPORT)!r})
for name in ("nominal", "extended"):
    open(f"report/{{name}}.json", "w").write("{{}}")
"""
FAILS = "import sys\nprint('some words', file=sys.stderr)\nsys.exit('internal error: x | y')"
SLEEPS = "import time\ntime.sleep(60)"


def test_the_table_has_a_row_for_each_end_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    made = foreign_cases.make("numpy", 6, 1.0, 0.5)
    monkeypatch.setattr(foreign_cases, "make", lambda *given: made)
    rows = []
    for k, (program, limit) in enumerate(((WRITES, 60.0), (FAILS, 60.0), (SLEEPS, 0.5))):
        monkeypatch.setattr(diagnosis_case, "PROGRAM", (sys.executable, "-c", program))
        monkeypatch.setattr(seen, "run_command", partial(diagnosis_case.run_command, limit=limit))
        row = seen.run_case("numpy", None, 6)
        rows.append(json.loads(json.dumps(row | {"name": f"made_0{k}"})))
    assert [row["exit"] for row in rows] == [0, 1, None] and rows[2]["message"] == "ended after 0.5 s"
    assert rows[0]["seconds"] > 0.02 and rows[0]["peak_megabytes"] > 3.0
    assert rows[0]["first"] and rows[0]["false"] == [] and rows[0]["left"] == [0.01, 0.005]
    text = seen.markdown(rows)
    assert "gravity j1 50 %" in text and "internal error: x / y" in text and "| 10.00, 5.00 |" in text
    assert "| runs that end with a report | 100 % | 33.3 % | 1/3 |" in text
    assert "| false causes a case | ≤ 0.15 | 0.00 | 0/1 |" in text


def test_halves_are_by_number() -> None:
    odd, even = (cases_of(half) for half in ("odd", "even"))
    assert all(number % 2 for _, number in odd.values()) and not set(odd) & set(even)
    assert cases_of("all").keys() == odd.keys() | even.keys()
