"""`tendonfmu import mjcf`: numbers against MuJoCo's own, and refusals by name."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from optional_parts import require

require("mujoco")

import mujoco

from command import Call
from mjcf_models import ARMS, BOWSTRING, fixed_model
from tendonfmu.mjcf.finger_import import ImportedFinger, import_finger
from tendonfmu.options import ImportOptions

BOTH = ("mcp", "pip")


def written(folder: Path, text: str, name: str = "model.xml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def imported(folder: Path, text: str, **settings: Any) -> ImportedFinger:
    return import_finger(written(folder, text), ImportOptions(**({"joints": BOTH} | settings)))


def rows(finger: ImportedFinger, effect: str) -> list[dict[str, Any]]:
    return [row for row in finger.data.get("extensions", []) if row["effect"] == effect]


# --- numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_arms_springs_and_friction_are_those_of_the_model(tmp_path: Path, angle: str) -> None:
    unit = {"radian": 1.0, "degree": 180 / np.pi}[angle]
    text = fixed_model(angle=angle, low=-0.5 * unit, high=1.2 * unit, rest=0.1 * unit)
    finger = imported(tmp_path, text)
    data = finger.data
    assert [tendon["name"] for tendon in data["tendons"]] == ["deep", "long", "short", "back"]
    assert [tendon["moment_arms"] for tendon in data["tendons"]] == ARMS
    assert [tendon["stiffness"] for tendon in data["tendons"]] == [4000.0] * 4
    first, second = data["joints"]
    assert first["cover"]["stiffness"] == 0.02 and first["cover"]["rest_angle"] == pytest.approx(0.1)
    assert "cover" not in second
    assert [joint["friction"]["coulomb"] for joint in data["joints"]] == [0.006, 0.004]
    assert [joint["friction"]["viscous"] for joint in data["joints"]] == [0.002, 0.002]
    assert rows(finger, "preload_friction") == [{"effect": "preload_friction", "joint": 1, "tendon": 2, "coulomb": 0.4}]
    # the armature, and the second link about its own joint: m·c² + I
    assert rows(finger, "inertia")[1]["inertia"] == pytest.approx(3e-5 + 0.01 * 0.015**2 + 2e-6)
    assert finger.warnings == []


def test_all_that_is_left_out_is_named(tmp_path: Path) -> None:
    sprung = fixed_model(gravity=-9.81).replace('<fixed name="short"', '<fixed name="short" stiffness="50"')
    text = "\n".join(imported(tmp_path, sprung).left_out)
    for words in (
        "tendon spring: without a drive",
        "tendon short: spring 50 N/m; moves the joints beside the drive",
        "tendon back: damping 3 N·s/m, armature 0.01 kg; moves the joints beside the drive",
        "actuator direct: drives joint pip without a tendon",
        "constraint coupled: couples joint pip and mcp",
        "weight of the links, at most (mN·m): mcp ",
        "--tip",
        "inertia that couples the joints",
    ):
        assert words in text, text
    assert "tendon deep" not in text and "elsewhere" not in text and "thumb" not in text  # of another finger


def test_constant_arms_are_those_of_mujoco_s_lengths(tmp_path: Path) -> None:
    """x1 = R q is the shortening of the tendons, at any angles: here by mj_forward alone."""
    finger = imported(tmp_path, fixed_model())
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    arms = np.array([tendon["moment_arms"] for tendon in finger.data["tendons"]])
    mujoco.mj_forward(model, data)
    before = data.ten_length[:4].copy()
    for angles in np.random.default_rng(1).uniform(-0.5, 1.2, (5, 2)):
        data.qpos[:2] = angles
        mujoco.mj_forward(model, data)
        assert np.allclose(before - data.ten_length[:4], arms @ angles, atol=1e-12)


def test_an_arm_that_varies_is_warned_of_with_its_figures_and_its_slope(tmp_path: Path) -> None:
    """A string between two sites: its arm in closed form; beside it a pulley, whose arm is constant."""
    finger = imported(tmp_path, BOWSTRING, joints=["hinge"])
    bow, pulley = finger.data["tendons"]
    angles = np.linspace(-0.5, 0.5, 201)
    after = np.array([0.01 * np.cos(angles) - 0.01 * np.sin(angles), 0.01 * np.sin(angles) + 0.01 * np.cos(angles)])
    length = np.hypot(after[0] + 0.02, after[1] - 0.01)
    arm = -np.gradient(length, angles)[1:-1]
    (row,) = rows(finger, "moment_arm_variation")
    assert (row["joint"], row["tendon"]) == (1, 1)
    slope, constant = np.polyfit(angles[1:-1], arm, 1)
    assert bow["moment_arms"][0] == pytest.approx(constant, rel=0.02)
    assert row["slope"] == pytest.approx(slope, rel=0.05)
    assert pulley["moment_arms"][0] == pytest.approx(-0.008, abs=1e-11)  # it runs below the axis
    (warning, advice) = finger.warnings
    assert "tendon bow, joint hinge" in warning and "--kinematics 2" in advice
    told = re.search(r"moment arm ([\d.]+) to ([\d.]+) mm", warning)
    assert told and [float(told[1]), float(told[2])] == pytest.approx([1e3 * arm.min(), 1e3 * arm.max()], rel=0.02)
    assert imported(tmp_path, BOWSTRING, joints=["hinge"], arm_tolerance=0.9).warnings == []


def test_the_pull_of_an_actuator_is_the_tendon_force_of_the_description(tmp_path: Path) -> None:
    """MuJoCo's joint torque by the actuators is Rᵀ f0, with the signs that the notes tell."""
    finger = imported(tmp_path, fixed_model())
    assert any("tendon_force is -1 times the force of actuator pull_deep" in note for note in finger.notes)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    data.ctrl[:4] = [-0.003, -0.002, -0.001, -0.004]
    mujoco.mj_forward(model, data)
    arms = np.array([tendon["moment_arms"] for tendon in finger.data["tendons"]])
    assert np.allclose(arms.T @ -data.actuator_force[:4], data.qfrc_actuator[:2], atol=1e-12)
    assert (data.actuator_force[:4] < 0).all()


def test_gravity_is_what_holds_the_links_at_any_angles(tmp_path: Path) -> None:
    finger = imported(tmp_path, fixed_model(gravity=-9.81), gravity=True, tip="tip")
    assert [row["joint"] for row in rows(finger, "gravity")] == [1, 2] and finger.warnings == []
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    data.qpos[:2] = 0.7, -0.4
    mujoco.mj_forward(model, data)
    theta = np.cumsum([0.7, -0.4])
    own = [
        row.get("sine", 0.0) * np.sin(t) + row.get("cosine", 0.0) * np.cos(t)
        for row, t in zip(rows(finger, "gravity"), theta, strict=True)
    ]
    assert np.allclose([own[0] + own[1], own[1]], data.qfrc_bias[:2], atol=1e-10)


def test_links_place_the_tip_where_mujoco_has_it(tmp_path: Path) -> None:
    """The product of rotations of docs/reference/semantics/contact_place.md#link-geometry, at angles that are not 0."""
    finger = imported(tmp_path, fixed_model(), tip="tip")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    angles = np.array([0.6, 0.9])
    data.qpos[:2] = angles
    mujoco.mj_forward(model, data)
    place, turned = np.zeros(3), np.eye(3)
    for link, angle in zip(finger.data["links"], angles, strict=True):
        place = place + turned @ np.array(link["offset"])
        x, y, z = link["axis"]
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turned = turned @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
    assert np.allclose(place + turned @ np.array(finger.data["tip"]), data.site("tip").xpos, atol=1e-12)


def no_friction(text: str) -> str:
    return text.replace('damping="0.002" frictionloss="0.006"', "")


def damping_alone(text: str) -> str:
    return no_friction(text).replace('frictionloss="0.004"', 'damping="0.003"')


def coefficients_of_1(text: str) -> str:
    """As of hands whose fixed tendons couple joints."""
    return text.replace('coef="-0.009"', 'coef="1"').replace('coef="-0.006"', 'coef="1"')


def crossed_axes(text: str) -> str:
    """At right angles, taken as parallel without links."""
    crossed = text.replace('<joint name="pip"', '<joint name="pip" axis="1 0 0"')
    return crossed.replace('pos="0.015 0 0"', 'pos="0.015 0.02 0"')


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (no_friction, "joint mcp: neither frictionloss nor damping"),
        (damping_alone, "joint pip: damping without frictionloss"),
        (coefficients_of_1, "tendon deep: a fixed tendon with coefficients up to 1"),
        (crossed_axes, "gravity: the rows miss up to"),
    ],
)
def test_what_model_and_description_do_not_share_is_said(
    tmp_path: Path, change: Callable[[str], str], words: str
) -> None:
    found = imported(tmp_path, change(fixed_model(gravity=-9.81)), gravity=True)
    assert words in "\n".join([*found.notes, *found.warnings])


# --- the command ------------------------------------------------------------------------------------------------------


def test_the_command_writes_a_finger_that_check_accepts(tmp_path: Path, call: Call) -> None:
    written(tmp_path, fixed_model(gravity=-9.81))
    options = ("--joints", "mcp,pip", "--tip", "tip", "--gravity", "-o", "finger.json")
    answer = call("import", "mjcf", "model.xml", *options)
    assert answer.status == 0 and answer.out == "" and "left out: limits, terms of higher order" in answer.err
    assert call("check", "finger.json").status == 0
    assert json.loads(Path("finger.json").read_text())["name"] == "pair"
    written(tmp_path, BOWSTRING)
    assert call("import", "mjcf", "model.xml", "-o", "bow.json").status == 0  # the only chain needs no names


def without_motors(text: str) -> str:
    return re.sub("<actuator>.*</actuator>", "", text, flags=re.DOTALL)


def misspelt(text: str) -> str:
    return text.replace('stiffness="0.02"', 'stifness="0.02"')


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--joints mcp,ring", ["joint ring", "it has mcp, pip, thumb"]),
        ("--joints pip,mcp", ["joint mcp", "carries joint pip", "base first"]),
        ("--joints mcp,thumb", ["joint thumb", "not carried by joint mcp"]),
        ("--joints mcp,mcp", ["joint mcp", "twice"]),
        ("--joints thrown", ["joint thrown", "free", "hinge"]),
        ("--joints shoulder", ["joint shoulder", "ball", "hinge"]),
        ("", ["2 chains of joints: mcp,pip; thumb", "--joints"]),
        ("--joints mcp,pip --tendons deep,elsewhere", ["tendon elsewhere", "none of the joints mcp, pip"]),
        ("--joints mcp,pip --tendons deep,nerve", ["tendon nerve", "it has deep"]),
        ("--joints mcp,pip --tendons short,back", ["joint pip", "none of the tendons"]),
        ("--joints mcp,pip --tendons deep", ["column rank", "moment_arms"]),
        ("--joints slider", ["no tendon", "slider"]),
        ("--joints mcp,pip --bidirectional spring", ["--bidirectional spring"]),
        ("--joints mcp,pip --tip nail", ["nail", "no site, geom or body"]),
        ("--joints mcp,pip --tip first", ["first", "beyond joint pip"]),
        ("--joints mcp,pip --range mcp=1:0", ["--range mcp=1:0", "LOW below HIGH"]),
        ("--joints mcp,pip --range ring=0:1", ["--range ring", "mcp, pip"]),
        (without_motors, ["model.xml: ", " tendons, none with an actuator or a motor on a slide"]),
        (misspelt, ["model.xml", "MuJoCo refuses", "stifness"]),
        (None, ["pip install mujoco"]),
    ],
)
def test_refusals_name_what_is_wrong(
    tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch, options: Any, words: list[str]
) -> None:
    """options: of the command; or a change of the model; or None where MuJoCo is not installed."""
    written(tmp_path, options(fixed_model()) if callable(options) else fixed_model())
    if options is None:
        monkeypatch.setitem(sys.modules, "mujoco", None)
    chosen = options.split() if isinstance(options, str) else [] if options is without_motors else ["--joints", "mcp"]
    answer = call("import", "mjcf", "model.xml", *chosen, "-o", "finger.json")
    assert answer.status == 2 and answer.out == "" and answer.err.count("\n") == 1, answer
    assert all(word in answer.err for word in words), answer.err
    assert not Path("finger.json").exists()
