"""Limits of friction with a memory, which hold whatever its numbers (docs/reference/semantics/presliding.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from runners import product

Array = NDArray[np.float64]
Row = dict[str, Any]

LAW = {"static": 0.06, "coulomb": 0.05, "stribeck_velocity": 0.3, "viscous": 0.01}
TENDON_LAW = {"static": 0.06, "coulomb": 0.05, "stribeck_velocity": 0.003, "viscous": 0.2}
STRETCH = {"effect": "cord_stretch", "stiffness": 3e4}


def joint(extensions: list[Row], law: Row = LAW, load: Row | None = None) -> Row:
    """A joint with friction of its own, turned by a tendon without any."""
    return {
        "format": "tendonfmu-finger-1",
        "name": "one joint",
        "joints": [{"friction": law, "load_friction": load}],
        "tendons": [{"moment_arms": [0.01], "stiffness": 1e4}],
        "contact": {"threshold": [1e6]},
        "extensions": extensions,
    }


def finger(extensions: list[Row]) -> Row:
    """Two joints, four tendons, friction everywhere."""
    arms = [[0.01, 0.008], [-0.01, 0.009], [0.011, -0.008], [-0.009, -0.007]]
    tendons = [
        {
            "moment_arms": row,
            "stiffness": 5e3,
            "pulley_friction": [TENDON_LAW],
            "edge_friction": [{"angles": [-0.5, 0.5], "laws": [TENDON_LAW, LAW | {"static": 0.1, "coulomb": 0.1}]}] * 2,
        }
        for row in arms
    ]
    joints = [{"friction": LAW, "load_friction": {"static": 1e-4, "coulomb": 1e-4, "stribeck_velocity": 0.1}}] * 2
    return {
        "format": "tendonfmu-finger-1",
        "name": "two joints",
        "joints": joints,
        "tendons": tendons,
        "contact": {"threshold": [1e6, 1e6]},
        "extensions": extensions,
    }


def friction(description: Row, time: Array, speed: Array, force: Array) -> Array:
    """[N, n] N·m: T of eq. (10), by measured velocities [N, n] and forces [N, m]."""
    angle = np.vstack([np.zeros(speed.shape[1]), np.cumsum(np.diff(time)[:, None] * speed[1:], axis=0)])
    recording = {"time": time, "tendon_force": force, "joint_position": angle, "joint_velocity": speed}
    out = product("model.native").Instance.from_description(description, 3).run(recording)
    return np.asarray(out["friction_torque"] - out["bias_torque"])


def of_joint(extensions: list[Row], time: Array, speed: Array, force: float | Array = 10.0, **more: Any) -> Array:
    forces = np.broadcast_to(np.asarray(force, dtype=float), time.shape)[:, None]
    return friction(joint(extensions, **more), time, speed[:, None], np.array(forces))[:, 0]


def motion(seed: int, samples: int = 2000) -> tuple[Array, Array, Array]:
    """Time, smooth velocities of two joints that turn round, and forces of four tendons."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) * 1e-3
    phase, rate = rng.uniform(0.0, 6.0, (6, 2)), rng.uniform(1.0, 12.0, (6, 2))
    speed = sum(np.sin(rate[k] * time[:, None] + phase[k]) for k in range(6))
    force = 10.0 + 3.0 * np.sin(5.0 * time[:, None] + np.arange(4.0))
    return time, np.asarray(speed), force


@pytest.mark.parametrize("row", [{"stiffness": 1e12}, {"displacement": 1e-140}], ids=["absolute", "relative"])
def test_without_an_end_of_stiffness_it_is_the_model_of_the_paper(row: Row) -> None:
    time, speed, force = motion(1)
    rows = [{"effect": "presliding", **row}]
    plain, stiff = (friction(finger(each), time, speed, force) for each in ([], rows))
    arms = np.array([tendon["moment_arms"] for tendon in finger([])["tendons"]])
    cords = np.stack([speed @ arms.T, speed[:, 1:] * arms[:, 1]])
    moves = (np.abs(speed) > 0.011).all(axis=1) & (np.abs(cords) > 0.00055).all(axis=(0, 2))
    moves[0] = False
    assert moves.sum() > 1000
    np.testing.assert_allclose(stiff[moves], plain[moves], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("stretch", [[], [STRETCH]], ids=["rigid", "stretching"])
@pytest.mark.parametrize("numbers", [{"stiffness": 2e4}, {"displacement": 0.2}, {"displacement": 0.2, "share": 2.0}])
def test_constant_speed_ends_at_the_law(numbers: Row, stretch: list[Row]) -> None:
    time = np.arange(3000) * 1e-3
    speed, force = np.tile([0.7, -0.4], (3000, 1)), np.full((3000, 4), 12.0)
    rows = [{"effect": "presliding", **numbers}, *stretch]
    second = [{"effect": "presliding", **{key: 3.0 * value for key, value in numbers.items()}}]
    expected = friction(finger([]), time, speed, force)[-1]
    for extensions in (rows, rows + second):
        np.testing.assert_allclose(friction(finger(extensions), time, speed, force)[-1], expected, rtol=1e-9)


@pytest.mark.parametrize("relaxation", [{}, {"relaxation_time": 0.2}], ids=["lasting", "relaxing"])
def test_energy_is_never_made(relaxation: Row) -> None:
    stiffness = 2.0
    rows = [{"effect": "presliding", "joint": 1, "stiffness": stiffness, **relaxation}]
    load = {"static": 5e-3, "coulomb": 5e-3, "stribeck_velocity": 1.0}
    for seed in range(5):
        time, speed, force = motion(seed)
        held = of_joint(rows, time, 0.2 * speed[:, 0], force[:, 0], load=load)
        work = np.cumsum(held[1:] * 0.2 * speed[1:, 0] * np.diff(time))
        assert (work >= held[1:] ** 2 / (2.0 * stiffness) - 1e-9).all()
        assert np.abs(held).max() > 0.05


def test_the_step_does_not_matter_where_nothing_slips() -> None:
    rows = [{"effect": "presliding", "joint": 1, "stiffness": 2.0, "relaxation_time": 0.05}]
    coarse, fine = np.linspace(0.0, 0.2, 3), np.linspace(0.0, 0.2, 2001)
    ends = []
    for time in (coarse, fine):
        speed = np.where(time <= 0.1 + 1e-9, 0.1, -0.2)
        ends.append(of_joint(rows, time, speed)[[time.size // 2, -1]])
    assert np.abs(ends[0]).max() < 0.05
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9)


def test_a_small_loop_inside_a_larger_one_closes() -> None:
    rows = [{"effect": "presliding", "joint": 1, "displacement": 0.1, "share": 2.0},
            {"effect": "presliding", "joint": 1, "displacement": 0.01}]  # fmt: skip
    law = {"static": 0.05, "coulomb": 0.05, "stribeck_velocity": 1.0}
    there_and_back = np.repeat([1.0, -1.0, 1.0], [40, 20, 20])
    time = np.arange(81) * 1e-3
    torque = of_joint(rows, time, np.concatenate([[0.0], there_and_back]), law=law)
    assert abs(torque[60] - torque[40]) > 0.02
    assert torque[80] == pytest.approx(torque[40], rel=1e-12)


def test_what_is_held_decays_at_rest() -> None:
    rows = [{"effect": "presliding", "joint": 1, "stiffness": 1.0, "relaxation_time": 0.5}]
    time = np.arange(1100) * 1e-3
    torque = of_joint(rows, time, np.where(time < 0.1, 0.3, 0.0))
    np.testing.assert_allclose(torque[1099], torque[99] * np.exp(-1.0 / 0.5), rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_travel_is_that_of_the_filtered_velocity_as_far_as_it_is_told(share: float) -> None:
    rows = [{"effect": "presliding", "joint": 1, "stiffness": 0.5, "filtered_travel": share}]
    time = np.arange(200) * 2e-3
    angle = 0.01 * np.sin(20.0 * time)
    recording = {"time": time, "tendon_force": np.full((200, 1), 10.0), "joint_position": angle[:, None]}
    out = product("model.native").Instance.from_description(joint(rows), 2).run(recording)
    late = lfilter([gain := -np.expm1(-2.0 * np.pi * 20.0 * 2e-3)], [1.0, gain - 1.0], angle)
    held = 0.5 * (share * late + (1.0 - share) * angle)
    np.testing.assert_allclose((out["friction_torque"] - out["bias_torque"])[:, 0], held, rtol=1e-9, atol=1e-12)


def test_the_most_specific_rows_hold() -> None:
    time, speed, force = motion(3, 800)

    def run(*rows: Row) -> Array:
        return friction(finger([{"effect": "presliding", **row} for row in rows]), time, speed, force)

    everywhere = run({"displacement": 0.25})
    joints = [{"joint": j, "displacement": 0.25 * 0.01} for j in (1, 2)]
    tendons = [{"tendon": i, "displacement": 0.25 * 0.0005} for i in (1, 2, 3, 4)]
    levels = [{"level": j, "displacement": 0.25 * 0.0005} for j in (1, 2)]
    places = [{"tendon": i, "joint": j, "displacement": 0.25 * 0.0005} for i in (1, 2, 3, 4) for j in (1, 2)]
    for rows in (tendons, levels, places):
        np.testing.assert_allclose(run(*joints, *rows), everywhere, rtol=1e-9, atol=1e-12)
    other = {"displacement": 0.001}
    assert not np.allclose(run({"displacement": 0.25}, {"tendon": 2} | other), everywhere)
    np.testing.assert_allclose(
        run({"displacement": 0.25}, {"level": 1} | other, *tendons), run({"displacement": 0.25}), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(run({"tendon": 2} | other, *places), run(*places), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_friction_held_at_rest_follows_the_limit_as_far_as_it_is_told(share: float) -> None:
    rows = [{"effect": "presliding", "joint": 1, "displacement": 0.1, "follows_limit": share}]
    time = np.arange(40) * 1e-2
    force = np.where(time < 0.2, 10.0, 25.0)
    speed = np.where(time < 0.1, 0.5, 0.0)
    speed[0] = 0.0
    load = {"static": 5e-3, "coulomb": 5e-3, "stribeck_velocity": 1.0}
    held = of_joint(rows, time, speed, force, law={"static": 0.0, "coulomb": 0.0, "stribeck_velocity": 1.0}, load=load)
    before, after = held[15], held[-1]
    assert before == pytest.approx(0.45 * 5e-3 * 10.0, rel=1e-9)
    assert after == pytest.approx(before * (1.0 + 1.5 * share), rel=1e-9)
