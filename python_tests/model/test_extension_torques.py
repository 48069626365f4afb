"""Torques of `extensions` in a running finger, against docs/reference/semantics.md#torques-of-extensions in numpy."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from extension_cases import ROWS, name_of
from fmu_binary import FINGER
from tendonfmu.model.native import Instance

Numbers = NDArray[np.float64]
V_MIN = {"tendon": 0.002, "joint": 0.2}
REST = np.array([0.1, -0.3])
ARMS = np.array([tendon["moment_arms"] for tendon in FINGER["tendons"]])  # [m, n]
FIRST_SIGNAL = next(k for k, row in enumerate(ROWS) if row["effect"] == "presliding")
TORQUES = ROWS[:FIRST_SIGNAL]


def bare(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Routing and rest angles alone, and the extensions."""
    finger = copy.deepcopy(FINGER)
    finger["joints"] = [{"cover": {"stiffness": 0.0, "rest_angle": rest}} for rest in REST.tolist()]
    keys = ("name", "stiffness", "moment_arms", "bidirectional")
    finger["tendons"] = [{key: tendon[key] for key in keys if key in tendon} for tendon in finger["tendons"]]
    return finger | {"extensions": rows, "velocity_threshold": V_MIN, "bias": None}


def motion(samples: int = 400) -> dict[str, Numbers]:
    """Back and forth through rest, with pauses; one tendon pushes and pulls."""
    time = np.cumsum(np.random.default_rng(4).uniform(0.5e-3, 1.5e-3, samples))
    phase = np.array([9.0, 14.0]) * time[:, None] * 2.0
    velocity = np.where(np.sin(3.0 * phase) > -0.6, np.sin(phase), 0.0)
    force = 20.0 + 10.0 * np.cos(np.array([5.0, 7.0, 4.0]) * time[:, None] * 6.0)
    force[:, 2] -= 20.0  # the cable loop
    angle = REST + np.array([0.8, -1.1]) * np.sin(phase / 2)
    return {
        "time": time,
        "joint_position": angle,
        "joint_velocity": velocity,
        "tendon_force": force,
        "tendon_position": np.zeros((samples, len(ARMS))),
    }


def held_sign(velocity: Numbers, threshold: float) -> Numbers:
    """[N] sign of the last sample that moved, 0 before."""
    found, last = [], 0.0
    for v in velocity:
        last = float(np.sign(v)) if abs(v) > threshold else last
        found.append(last)
    return np.array(found)


def by_the_text(row: dict[str, Any], m: dict[str, Numbers]) -> Numbers:
    """[N, n] what one row adds to T."""
    q, v, f, effect = m["joint_position"], m["joint_velocity"], m["tendon_force"], row["effect"]
    j, i = (row.get("joint") or 1) - 1, (row.get("tendon") or 1) - 1
    torque = np.zeros_like(q)
    match effect:
        case "cover_hardening":
            torque[:, j] = row["stiffness"] * (q - REST)[:, j] ** 3
        case "gravity":
            theta = q[:, : j + 1].sum(axis=1)
            weight = row.get("sine", 0.0) * np.sin(theta) + row.get("cosine", 0.0) * np.cos(theta)
            torque[:, : j + 1] = weight[:, None]
        case "inertia":
            torque[1:, j] = row["inertia"] * np.diff(v[:, j]) / np.diff(m["time"])
        case "joint_coupling":
            spring = row["stiffness"] * ((q - REST)[:, j] - (q - REST)[:, j + 1])
            torque[:, j], torque[:, j + 1] = spring, -row.get("reaction", 1.0) * spring
        case "preload_friction":
            for before in [j] if "joint" in row else range(len(REST)):
                side = held_sign(v[:, before:] @ ARMS[i, before:], V_MIN["tendon"])
                share = np.where(np.arange(before, len(REST)) == before, 1.0, row.get("beyond", 1.0))
                torque[:, before:] += row["coulomb"] * side[:, None] * share * ARMS[i, before:]
        case "load_friction":
            torque[:, j] = row["coulomb"] * np.abs(f[:, i]) * held_sign(v[:, j], V_MIN["joint"])
        case "force_gain":
            torque = -row["correction"] * f[:, i : i + 1] * ARMS[i]
        case "force_offset":
            torque[:] = -row["correction"] * ARMS[i]
        case "moment_arm":
            torque[:, j] = -row["correction"] * f[:, i]
        case "moment_arm_variation":
            torque[:, j] = -row["slope"] * q[:, j] * f[:, i]
        case "pulley_eccentricity":
            turned = row.get("turns", 1.0) * q[:, j]
            torque[:, j] = -(row["sine"] * np.sin(turned) + row["cosine"] * np.cos(turned)) * f[:, i]
    return np.asarray(torque)


def modelled(rows: list[dict[str, Any]], m: dict[str, Numbers], parts: int = 1) -> Numbers:
    """[N, n] T of step 4, the recording in `parts` with a saved and restored state between them."""
    finger, found = Instance.from_description(bare(rows), 3), []
    for part in np.array_split(np.arange(len(m["time"])), parts):
        outputs = finger.run({name: values[part] for name, values in m.items()})
        found.append(outputs["friction_torque"] - outputs["bias_torque"])
        state = finger.save_state()
        finger = Instance.from_description(bare(rows), 3)
        finger.restore_state(state)
    return np.concatenate(found)


@pytest.mark.parametrize("row", TORQUES, ids=name_of)
def test_a_torque_is_that_of_the_text(row: dict[str, Any]) -> None:
    m = motion()
    expected = by_the_text(row, m)
    assert np.ptp(expected[100:], axis=0).max() > 1e-6 or row["effect"] == "force_offset"
    np.testing.assert_allclose(modelled([row], m), expected, rtol=1e-9, atol=1e-12)


def test_torques_add_up_and_outlive_a_saved_state() -> None:
    m, rows = motion(), [*TORQUES, *TORQUES]
    expected = 2.0 * sum(by_the_text(row, m) for row in TORQUES)
    np.testing.assert_allclose(modelled(rows, m, parts=7), expected, rtol=1e-9, atol=1e-12)


def test_the_axes_of_links_weigh_gravity() -> None:
    """Axes opposite to each other turn the link by the difference of the angles, axes across leave it as it is."""
    m = motion()
    row = {"effect": "gravity", "joint": 2, "sine": 0.02, "cosine": -0.03}
    for axis, w in (([0.0, 0.0, -2.0], -1.0), ([1.0, 0.0, 0.0], 0.0), ([0.0, 3.0, 3.0], np.sqrt(0.5))):
        links = {"links": [{"axis": [0.0, 0.0, 1.0]}, {"axis": axis}], "tip": [0.1, 0.0, 0.0]}
        finger = Instance.from_description(bare([row]) | links, 3)
        outputs = finger.run(m)
        theta = w * m["joint_position"][:, 0] + m["joint_position"][:, 1]
        weight = 0.02 * np.sin(theta) - 0.03 * np.cos(theta)
        expected = np.stack([w * weight, weight], axis=1)
        found = outputs["friction_torque"] - outputs["bias_torque"]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
