"""The simulated finger against physics done by hand: closed forms of LuGre, energy, balance, convergence.

Nothing here comes from the numpy twin.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from plant_rigs import ARM, STIFFNESS, TWO_JOINTS, balance, dry, grid, make, needs_plant, run, small_rig
from plant_rigs import strokes as legs_of
from random_plants import random_plant
from repetitions import repeated

Array = NDArray[Any]
pytestmark = needs_plant

# --- LuGre on one contact ---------------------------------------------------------------------------------------


def one_contact(law: dict[str, float], distance: float, damping: float, legs: Any, **other: Any) -> dict[str, Any]:
    """One joint, friction in the joint alone; the tendons pull hard enough to hold it to the wanted motion."""
    friction = {"presliding": {"joint": distance}, "bristle_damping": damping}
    rig = small_rig(motion=legs_of(legs, [0.0]), joints=[{"friction": law}], friction=friction, **other)
    rig["physics"]["tendons"] = [{"damping": 20.0}] * 2  # calms the springs, and is no part of friction_torque
    return rig


def test_steady_sliding_force() -> None:
    """Far beyond the presliding distance: λ = g(v) + viscous v, for both exponents and both directions."""
    law, distance = dry(0.006, static=0.009, stribeck=0.1, viscous=0.002), 0.002
    for exponent in (1, 2):
        for speed in (0.05, -0.2):
            rig = one_contact(law, distance, 0.003, [[0.8, speed]])
            rig["physics"]["friction"]["stribeck_exponent"] = exponent
            found = run(rig, grid(0.85, 1e-3))
            v = found["joint_velocity"][-1, 0]
            assert v == pytest.approx(speed, rel=0.01)
            level = 0.006 + 0.003 * np.exp(-((abs(v) / 0.1) ** exponent))
            expected = np.sign(v) * level + 0.002 * v
            assert found["friction_torque"][-1, 0] == pytest.approx(expected, rel=1e-4)


def test_presliding_stiffness_and_exponential_approach() -> None:
    """With ĝ = 1: w(x) = 1 − (1 − w0) exp(−x/d): slope level/d where the bristle is straight, and level in the end."""
    level, distance = 0.008, 0.01
    found = run(one_contact(dry(level), distance, 0.0, [[0.5, 0.12]]), grid(0.65, 5e-4))
    travelled = found["joint_position"][:, 0] - found["joint_position"][0, 0]
    first = found["friction_torque"][0, 0] / level
    rising = found["joint_velocity"][:, 0] >= 0.0
    assert np.all(np.diff(travelled) >= -1e-9) and travelled[-1] > 5.0 * distance and rising.mean() > 0.95
    expected = level * (1.0 - (1.0 - first) * np.exp(-travelled / distance))
    np.testing.assert_allclose(found["friction_torque"][:, 0], expected, atol=1e-5 * level)
    straight = np.abs(found["friction_torque"][:, 0]) < 0.05 * level
    assert straight.sum() > 3 and first < -0.9  # settling left it bent the other way
    slope = np.polyfit(travelled[straight], found["friction_torque"][straight, 0], 1)[0]
    assert slope == pytest.approx(level / distance, rel=0.02)


def test_break_away_level_and_distance() -> None:
    """Driven far slower than the Stribeck velocity (ĝ -> 1): the torque reaches `static`, 95 % of the way after 3 d."""
    law, distance = dry(0.006, static=0.009, stribeck=5.0), 0.005
    found = run(one_contact(law, distance, 0.0, [[1.5, 0.03]]), grid(1.6, 1e-3))
    torque = found["friction_torque"][:, 0]
    travelled = found["joint_position"][:, 0] - found["joint_position"][0, 0]
    assert torque.max() == pytest.approx(0.009, rel=0.005)
    reached = (np.interp(3.0 * distance, travelled, torque) - torque[0]) / (0.009 - torque[0])
    assert reached == pytest.approx(1.0 - np.exp(-3.0), rel=0.005)


def test_contact_against_scipy() -> None:
    """The joint's own motion, with reversals, put through a LuGre equation written here and solved by Radau."""
    static, coulomb, stribeck, viscous, distance, damping = 0.009, 0.006, 0.1, 0.002, 0.004, 0.003
    law = dry(coulomb, static=static, stribeck=stribeck, viscous=viscous)
    rig = one_contact(law, distance, damping, [[0.1, 0.4], [0.1, -0.3], [0.1, 0.02], [0.15, 0.0], [0.1, -0.5]])
    rig["integration"]["relative_tolerance"] = 1e-9
    time = grid(1.0, 2e-4)
    found = run(rig, time)
    q, v = found["joint_position"][:, 0], found["joint_velocity"][:, 0]
    speed = CubicHermiteSpline(time, q, v).derivative()

    def bend_rate(t: float, w: Array) -> Array:
        u = float(speed(t))
        ratio = (coulomb + (static - coulomb) * np.exp(-abs(u) / stribeck)) / static
        return np.asarray(u / distance * (1.0 - np.sign(u) * w / ratio))

    w0 = [found["friction_torque"][0, 0] / static]
    w = solve_ivp(bend_rate, (0.0, 1.0), w0, "Radau", t_eval=time, rtol=1e-9, atol=1e-11, max_step=1e-3).y[0]
    rate = np.array([bend_rate(t, np.array([w[k]]))[0] for k, t in enumerate(time)])
    part = damping / (1.0 + np.abs(v) * damping / distance)
    expected = static * (w + part * rate) + viscous * v
    assert np.abs(w).max() > 0.7 and np.sign(w).min() < 0
    np.testing.assert_allclose(found["friction_torque"][:, 0], expected, atol=2e-4 * static)


# --- The whole finger -------------------------------------------------------------------------------------------


def smooth() -> dict[str, Any]:
    """A rig with friction whose solution has no kink: no reversal, no slack."""
    return small_rig(
        TWO_JOINTS,
        motion=legs_of([[0.3, 0.5, 0.3]], [0.0, 0.0]),
        joints=[{"friction": dry(0.004, 0.006, 0.1, 0.002)}] * 2,
        links=[{"damping": 0.002}] * 2,
        friction={"presliding": {"joint": 0.02}, "bristle_damping": 0.0},
    )


@pytest.mark.parametrize("seed", repeated([6, 12, 17, 20, 21, 26, 35], 0, 1, 2))
def test_tolerances_agree_on_random_fingers(seed: int) -> None:
    """Slack, stops, pushes, obstacles, wrists, every friction switch: a tight and a rough tolerance, energies kept."""
    rig, time = random_plant(seed) | {"settle": 1.0}, grid(2.0, 5e-3)
    tight = run(rig, time, relative_tolerance=1e-7)
    rough = run(rig, time, relative_tolerance=1e-5)
    np.testing.assert_allclose(rough["joint_position"], tight["joint_position"], atol=1e-3)
    np.testing.assert_allclose(rough["tendon_force"], tight["tendon_force"], atol=5e-2)
    for found, tolerance in ((tight, 1e-5), (rough, 1e-3)):
        works = np.ptp(found["energy"], axis=0)[2:].sum()
        assert np.ptp(balance(found["energy"])) < tolerance * works


def test_cvode_error_falls_with_its_tolerance() -> None:
    rig, end = smooth(), grid(0.5, 0.05)
    tight = run(rig, end, relative_tolerance=1e-10)["joint_position"]
    errors = []
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7):
        coarse = run(rig, end, relative_tolerance=tolerance)["joint_position"]
        halved = run(rig, end, relative_tolerance=tolerance / 2.0)["joint_position"]
        errors.append(float(np.abs(coarse - tight).max()))
        assert np.abs(halved - tight).max() < 1.5 * errors[-1] + 1e-9
        assert np.abs(coarse - halved).max() < 2.5 * errors[-1] + 1e-9
    assert errors[0] < 1e-2 and errors[-1] < errors[0] / 30.0, errors


@pytest.mark.parametrize("pulley_torque", ["beyond_joint", "at_joint"])
@pytest.mark.parametrize("loss", ["linear", "capstan"])
def test_energy_balance_closes(pulley_torque: str, loss: str) -> None:
    """Everything on: pushes, an obstacle, stops, friction, damping, hardening springs, gravity, a wrist."""
    law = dry(0.02, 0.03, 0.005, 0.2)
    rig = small_rig(
        TWO_JOINTS,
        motion=legs_of([[0.3, 1.0, 0.7], [0.4, -1.0, -0.9], [0.2, 0.5, 0.5]], [0.0, 0.1]),
        joints=[
            {"friction": dry(0.004, 0.006, 0.1), "load_friction": dry(3e-5), "cover": {"stiffness": 0.02}} for _ in "12"
        ],
        tendons=[{"pulley_friction": [law], "edge_friction": [law, law]}] * 4,
        links=[{"damping": 0.001, "limits": {"lower": -0.2, "upper": 0.25}, "cover_hardening": 0.1}] * 2,
        gravity=[0.0, 0.0, -9.81],
        joint_coupling=[0.02],
        friction={"bristle_damping": 0.002, "pulley_torque": pulley_torque, "tension_loss": loss, "preload": 0.5},
        obstacle={"centre": [0.07, 0.0, -0.05], "radius": 0.04, "stiffness": 300.0, "damping": 2.0},
        pushes=[{"start": 0.3, "rise": 0.1, "hold": 0.2, "fall": 0.1, "force": 1.0, "direction": [0.0, 0.0, 1.0]}],
        wrist={"amplitude": 0.2, "period": 2.0, "arms": [0.005, -0.005, 0.004, 0.003], "friction": law},
    )
    rig["physics"]["tendons"] = [{"hardening": 1e6, "damping": 2.0}] * 4
    found = run(rig, grid(1.3, 2e-3), relative_tolerance=1e-7)
    energy = found["energy"]
    moved = np.ptp(energy, axis=0)
    assert np.all(moved[2:] > 1e-5), moved  # every work takes part
    assert found["contact"].any() and np.abs(found["stop_torque"]).max() > 0.01
    assert np.ptp(balance(energy)) < 2e-5 * moved[2:].sum(), (np.ptp(balance(energy)), moved)


# --- Contact ----------------------------------------------------------------------------------------------------


def planar_jacobian(q: Array, along: float) -> Array:
    """[3, 2] of a point of the second link, `along` from its joint; axis y: positive angles turn x towards −z."""
    first, both = q[0], q[0] + q[1]
    elbow = np.array([-0.04 * np.sin(first), 0.0, -0.04 * np.cos(first)])
    hand = np.array([-along * np.sin(both), 0.0, -along * np.cos(both)])
    return np.stack([elbow + hand, hand], axis=1)


def test_push_appears_in_the_external_torque() -> None:
    """τ_ext = −Jᵀ F for a push fixed in the base and one that turns with the link."""
    shared = {"start": 0.0, "rise": 0.05, "hold": 0.5, "fall": 0.05, "force": 1.5, "direction": [0.6, 0.3, 0.8]}
    for frame in ("base", "link"):
        push = shared | {"frame": frame, "link": 2, "point": [0.03, 0.0, 0.0]}
        rig = small_rig(TWO_JOINTS, motion=legs_of([[0.2, 0.8, -0.5]], [0.2, 0.3]), pushes=[push])
        rig["physics"]["links"] = [link | {"damping": 0.002} for link in rig["physics"]["links"]]
        found = run(rig, np.array([0.0, 0.2, 0.3]))
        np.testing.assert_allclose(found["external_torque"][0], 0.0, atol=1e-15)
        direction = np.array([0.6, 0.3, 0.8]) / np.linalg.norm([0.6, 0.3, 0.8])
        for k in (1, 2):
            q = found["joint_position"][k]
            force = 1.5 * direction
            if frame == "link":
                turn, (x, y, z) = q.sum(), force
                force = np.array([x * np.cos(turn) + z * np.sin(turn), y, -x * np.sin(turn) + z * np.cos(turn)])
            np.testing.assert_allclose(found["contact_force"][k], force, rtol=1e-9)
            expected = -planar_jacobian(q, 0.03).T @ force
            np.testing.assert_allclose(found["external_torque"][k], expected, rtol=1e-9)
            place = [0.04 * np.cos(q[0]) + 0.03 * np.cos(turn) for turn in [q.sum()]]
            assert found["contact_point"][k, 0] == pytest.approx(place[0], rel=1e-9)
            assert bool(found["contact"][k])


def test_obstacle_appears_in_the_external_torque() -> None:
    """The tip pressed into a sphere: F = k δ (1 + c δ') along the normal, τ_ext = −Jᵀ F."""
    centre, radius, stiffness, damping = np.array([0.07, 0.0, -0.06]), 0.04, 400.0, 3.0
    obstacle = {"centre": centre.tolist(), "radius": radius, "stiffness": stiffness, "damping": damping}
    rig = small_rig(TWO_JOINTS, motion=legs_of([[0.5, 0.6, 0.6]], [0.0, 0.0]), obstacle=obstacle)
    rig["physics"]["links"] = [link | {"damping": 0.002} for link in rig["physics"]["links"]]
    found = run(rig, grid(0.6, 2e-3))
    seen = 0
    for k, (q, v) in enumerate(zip(found["joint_position"], found["joint_velocity"], strict=True)):
        both = q.sum()
        tip = 0.04 * np.array([np.cos(q[0]) + np.cos(both), 0.0, -np.sin(q[0]) - np.sin(both)])
        np.testing.assert_allclose(found["tip_position"][k], tip, atol=1e-12)
        away = tip - centre
        depth, normal = radius - np.linalg.norm(away), away / np.linalg.norm(away)
        jacobian = planar_jacobian(q, 0.04)
        force = np.zeros(3)
        if depth > 0.0:
            seen += depth > 1e-4
            force = max(0.0, stiffness * depth * (1.0 - damping * float(normal @ jacobian @ v))) * normal
        np.testing.assert_allclose(found["contact_force"][k], force, atol=1e-9)
        np.testing.assert_allclose(found["external_torque"][k], -jacobian.T @ force, atol=1e-11)
        assert bool(found["contact"][k]) == (np.linalg.norm(force) > 0.05)
    assert seen > 30


def test_push_of_the_inputs() -> None:
    """A force given from outside acts in the base frame at push_point, beside the rig's own motion."""
    rig = small_rig(TWO_JOINTS, motion=legs_of([[0.2, 0.8, -0.5]], [0.2, 0.3]), links=[{"damping": 0.002}] * 2)
    plant = make(rig, push_point=(0.01, 0.0, 0.0), push_link=2)
    force = np.array([0.5, -0.2, 0.7])
    plant.set_inputs(push_force=force.tolist())
    found = plant.run(np.array([0.1, 0.2]))
    for q, torque in zip(found["joint_position"], found["external_torque"], strict=True):
        np.testing.assert_allclose(torque, -planar_jacobian(q, 0.01).T @ force, rtol=1e-9)
    np.testing.assert_allclose(found["contact_force"], [force, force], rtol=1e-12)
    plant.set_inputs()
    assert np.all(plant.run(np.array([0.21]))["external_torque"] == 0.0)


def test_commands_and_pretension_of_the_inputs() -> None:
    """With the rig's motion inputs are added to it; without it the command is the motors' absolute position."""
    rig = small_rig(links=[{"damping": 0.005}])
    shift = np.array([ARM, -ARM]) * 0.1  # turns the joint by 0.1 rad
    added = make(rig)
    added.set_inputs(shift.tolist(), pretension=5.0)
    alone = make(rig, scheduled_motion=False)
    hold = alone.hold_command()
    np.testing.assert_allclose(hold, 10.0 / STIFFNESS, rtol=1e-12)
    alone.set_inputs((hold + shift).tolist(), pretension=5.0)
    for plant in (added, alone):
        found = plant.run(np.array([1.5]))
        np.testing.assert_allclose(found["joint_position"], 0.1, rtol=1e-6)
        np.testing.assert_allclose(found["tendon_force"], 15.0, rtol=1e-6)


@pytest.mark.parametrize(("where", "drives"), [("beyond_joint", False), ("at_joint", True)])
def test_power_of_pulleys(where: str, drives: bool) -> None:
    """Sliding pulleys of joint 1 rub by q̇_2. Beyond the joint the loss turns joint 2 alone: power λ f |r_2 q̇_2|. At the
    joint, as eq. (10) has it, it turns joint 1 as well, which may then be driven."""
    rub: dict[str, Any] = {"pulley_friction": [dry(0.03)]}
    pulley = {"pulley_torque": where}
    plant = make(small_rig(TWO_JOINTS, tendons=[rub, {}, {}, rub], friction=pulley, pretension=15.0))
    arms = np.array(TWO_JOINTS)
    rubbing = arms[[0, 3]]
    for speeds in ([2.0, -0.3], [-2.0, 0.3], [0.0, 0.5]):
        state = plant.continuous_state()
        state[2:4] = speeds
        slides = rubbing[:, 1] * speeds[1]
        state[4 + 2 * len(arms) : 6 + 2 * len(arms)] = np.sign(slides)
        power = plant.derivative(0.0, state)[-3]
        turned = rubbing @ speeds if where == "at_joint" else slides
        assert power == pytest.approx(np.sum(0.03 * 15.0 * np.sign(slides) * turned), rel=1e-6)
        if speeds[0] != 0.0:
            assert (power < 0.0) == drives
