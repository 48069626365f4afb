"""Every switch of the rig changes the signals as its equation says. One small rig and one number for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant_rigs import (
    ANTAGONISTS,
    ARM,
    CALM,
    STIFFNESS,
    TWO_JOINTS,
    calm,
    dry,
    grid,
    make,
    needs_plant,
    run,
    small_rig,
    still,
)
from plant_rigs import strokes as legs_of

Array = NDArray[Any]
pytestmark = needs_plant

SPEED = 0.4  # rad/s of the steady strokes below
SLIDE = grid(0.5, 1e-2)


def sliding(speed: float = SPEED, **other: Any) -> dict[str, Any]:
    """One joint in a steady stroke."""
    return calm(small_rig(motion=legs_of([[0.5, speed]], [0.0]), **other))


def tendon_sliding(speed: float, edge: dict[str, Any], **friction: Any) -> dict[str, Any]:
    """One joint in a steady stroke, an edge before it on both tendons."""
    tendons = [{"edge_friction": [edge]}] * 2
    return calm(small_rig(motion=legs_of([[0.5, speed]], [0.0]), tendons=tendons, friction=friction))


def last(found: dict[str, Array], name: str) -> Array:
    return np.asarray(found[name][-1])


# --- Bodies and springs -----------------------------------------------------------------------------------------


def test_gravity() -> None:
    """G = −m g·∂(centre of mass)/∂q, in any direction of g."""
    for gravity in ([0.0, 0.0, -9.81], [3.0, 1.0, 0.0], [0.0, 0.0, 0.0]):
        found = run(calm(small_rig(motion=still([0.3]), gravity=gravity)), np.array([0.1]))
        q = last(found, "joint_position")[0]
        expected = -0.01 * 0.02 * (-gravity[0] * np.sin(q) - gravity[2] * np.cos(q))
        assert last(found, "inertial_torque")[0] == pytest.approx(expected, abs=1e-8)
        assert last(found, "joint_torque")[0] == pytest.approx(expected, abs=1e-7)


def test_cover_and_cover_hardening() -> None:
    """k (q − rest) + hardening (q − rest)³."""
    joints = [{"cover": {"stiffness": 0.02, "rest_angle": -0.3}}]
    for hardening in (0.0, 0.2):
        rig = calm(small_rig(motion=still([0.4]), joints=joints, links=[{"cover_hardening": hardening}]))
        found = run(rig, np.array([0.1]))
        bend = last(found, "joint_position")[0] + 0.3
        assert last(found, "friction_torque")[0] == pytest.approx(0.02 * bend + hardening * bend**3, rel=1e-6)


def test_damping() -> None:
    found = run(sliding(links=[{"damping": 0.003}]), SLIDE)
    np.testing.assert_allclose(found["friction_torque"], 0.003 * found["joint_velocity"], atol=1e-10)
    assert last(found, "joint_velocity")[0] == pytest.approx(SPEED, rel=1e-3)


def test_limits() -> None:
    """Beyond the limit: stiffness × depth + damping × velocity, never pulling; nothing inside."""
    limits = {"lower": -0.2, "upper": 0.05, "stiffness": 8.0, "damping": 0.05}
    rig = calm(small_rig(motion=legs_of([[0.1, 0.8], [0.1, -0.8]], [0.0]), links=[{"limits": limits}]))
    found = run(rig, grid(0.6, 1e-3))
    q, v, torque = (found[name][:, 0] for name in ("joint_position", "joint_velocity", "stop_torque"))
    beyond = np.maximum(0.0, q - 0.05)
    expected = np.where(beyond > 0.0, np.maximum(0.0, 8.0 * beyond + 0.05 * v), 0.0)
    np.testing.assert_allclose(torque, expected, atol=1e-9)
    assert torque.max() > 0.05 and (beyond == 0.0).any()


def test_joint_coupling() -> None:
    """−k (q1 − q2 − (rest1 − rest2)) on joint 1, the opposite on joint 2."""
    joints = [{"cover": {"stiffness": 0.0, "rest_angle": 0.1}}, {"cover": {"stiffness": 0.0, "rest_angle": -0.2}}]
    rig = calm(small_rig(TWO_JOINTS, motion=still([0.5, -0.1]), joints=joints, joint_coupling=[0.04]))
    found = run(rig, np.array([0.1]))
    q = last(found, "joint_position")
    torque = 0.04 * (q[0] - q[1] - 0.3)
    np.testing.assert_allclose(last(found, "friction_torque"), [torque, -torque], rtol=1e-6)
    assert torque > 0.005


def test_hardening() -> None:
    """f = k e + hardening e²; at rest in the middle the tension is the pretension."""
    rig = calm(small_rig(tendons=[{}] * 2, pretension=20.0))
    rig["physics"]["tendons"] = [CALM | {"hardening": 2e6}, CALM]
    found = run(rig, np.array([0.1]))
    np.testing.assert_allclose(last(found, "tendon_force"), 20.0, rtol=1e-7)
    e = last(found, "tendon_position")
    assert STIFFNESS * e[0] + 2e6 * e[0] ** 2 == pytest.approx(20.0, rel=1e-7)
    assert e[1] == pytest.approx(20.0 / STIFFNESS, rel=1e-7)
    assert e[0] < 0.8 * e[1]


def test_tendon_damping() -> None:
    """f = k e + damping e'."""
    pushes = [{"start": 0.0, "rise": 0.01, "hold": 0.01, "fall": 0.01, "force": 1.0, "direction": [0.0, 0.0, 1.0]}]
    found = run(calm(small_rig(pushes=pushes, links=[{"damping": 0.001}])), grid(0.05, 1e-4))
    e = found["tendon_position"] - found["joint_position"] * np.array(ANTAGONISTS)[:, 0]
    rate = -found["joint_velocity"] * np.array(ANTAGONISTS)[:, 0]  # the motors stand
    np.testing.assert_allclose(found["tendon_force"], STIFFNESS * e + 20.0 * rate, rtol=1e-7)
    assert np.abs(20.0 * rate).max() > 0.02


def arm_case(tendon: dict[str, Any], q: float) -> tuple[Array, Array, Array, float]:
    """Tension, elongation + path (motor position), joint torque at rest with gravity as load, and the angle."""
    rig = small_rig(motion=still([q]), gravity=[0.0, 0.0, -9.81])
    rig["physics"]["tendons"] = [CALM | tendon, CALM]
    found = run(rig, np.array([0.1]))
    names = ("tendon_force", "tendon_position", "joint_torque")
    f, x, torque = (last(found, name) for name in names)
    return f, x, torque, float(last(found, "joint_position")[0])


def test_moment_arm_scale() -> None:
    f, x, torque, q = arm_case({"moment_arm_scale": 1.2}, 0.3)
    assert torque[0] == pytest.approx(1.2 * ARM * f[0] - ARM * f[1], rel=1e-9)
    assert x[0] == pytest.approx(1.2 * ARM * q + f[0] / STIFFNESS, rel=1e-9)


def test_moment_arm_slope() -> None:
    """r(q) = r + slope q; its path is the integral."""
    f, x, torque, q = arm_case({"moment_arm_slope": [0.004]}, 0.5)
    assert torque[0] == pytest.approx((ARM + 0.004 * q) * f[0] - ARM * f[1], rel=1e-9)
    assert x[0] == pytest.approx(ARM * q + 0.002 * q * q + f[0] / STIFFNESS, rel=1e-9)


def test_eccentricity() -> None:
    """r(q) = r + eccentricity sin(q + phase)."""
    f, x, torque, q = arm_case({"eccentricity": [0.001], "phase": [0.7]}, 0.5)
    assert torque[0] == pytest.approx((ARM + 0.001 * np.sin(q + 0.7)) * f[0] - ARM * f[1], rel=1e-9)
    path = ARM * q - 0.001 * (np.cos(q + 0.7) - np.cos(0.7))
    assert x[0] == pytest.approx(path + f[0] / STIFFNESS, rel=1e-9)


def test_servo() -> None:
    """x'' = w² (command − x) − 2 ζ w x', the command being a rise of pretension from 10 N to 20 N in 0.1 s."""
    rig = calm(small_rig(servo={"frequency": 6.0, "damping_ratio": 0.4}, settle=4.0))
    rig["motion"]["pretension"] = {"time": [0.05, 0.15], "value": [10.0, 20.0]}
    time, w = grid(0.4, 5e-3), 2.0 * np.pi * 6.0

    def rates(t: float, y: Array) -> list[float]:
        s = min(1.0, max(0.0, (t - 0.05) / 0.1))
        command = (10.0 + 10.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)) / STIFFNESS
        return [y[1], w * w * (command - y[0]) - 2.0 * 0.4 * w * y[1]]

    expected = solve_ivp(rates, (0.0, 0.4), [10.0 / STIFFNESS, 0.0], t_eval=time, rtol=1e-9, atol=1e-13, max_step=0.01)
    found = run(rig, time)
    np.testing.assert_allclose(found["tendon_position"][:, 0], expected.y[0], atol=1e-8)
    assert found["tendon_position"][:, 0].max() > 21.0 / STIFFNESS  # overshoots


# --- Friction ---------------------------------------------------------------------------------------------------


def test_presliding_distances() -> None:
    """Each kind of contact bends by its own distance: f = level (1 − (1 − w0) exp(−x/d)) with ĝ = 1."""
    cases = {"joint": 0.01, "edge": 1e-4, "pulley": 8e-5}
    for kind, distance in cases.items():
        friction = {"presliding": {kind: distance}}
        law, motion = dry(0.01), legs_of([[0.15, 0.0, 0.3]], [0.0, 0.0], soft=0.05)
        extra: dict[str, Any] = {"joints": [{}, {"friction": law}]}
        if kind == "edge":
            extra = {"tendons": [{"edge_friction": [None, law]}] * 4}
        elif kind == "pulley":
            extra = {"tendons": [{"pulley_friction": [law]}] * 4}
        found = run(calm(small_rig(TWO_JOINTS, motion=motion, friction=friction, **extra)), grid(0.2, 1e-3))
        moved = found["joint_position"][:, 1] - found["joint_position"][0, 1]
        if kind == "joint":
            w = found["friction_torque"][:, 1] / 0.01
        else:  # the loss of each tendon is its tension times ± level w, so the signed losses add up
            w = found["friction_torque"][:, 1] / (0.01 * ARM * found["tendon_force"].sum(axis=1))
            moved = ARM * moved
        expected = 1.0 - (1.0 - w[0]) * np.exp(-moved / distance)
        assert expected.max() > 0.95 and expected.min() < 0.2, kind
        np.testing.assert_allclose(w, expected, atol=2e-3, err_msg=kind)


def test_bristle_damping() -> None:
    """With ĝ = 1: λ = level (w + a (1 − w)), a = |v| T/d / (1 + |v| T/d), and w from the way travelled."""
    distance, damping, level = 0.02, 0.05, 0.008
    friction = {"presliding": {"joint": distance}, "bristle_damping": damping}
    found = run(sliding(joints=[{"friction": dry(level)}], friction=friction), grid(0.15, 1e-3))
    q, v = found["joint_position"][:, 0], found["joint_velocity"][:, 0]
    w0 = found["friction_torque"][0, 0] / level
    w = 1.0 - (1.0 - w0) * np.exp(-(q - q[0]) / distance)
    a = (np.abs(v) * damping / distance) / (1.0 + np.abs(v) * damping / distance)
    np.testing.assert_allclose(found["friction_torque"][:, 0], level * (w + a * (1.0 - w)), atol=1e-4 * level)
    assert np.abs(a * (1.0 - w)).max() > 0.1


def test_stribeck_exponent() -> None:
    law, torque = dry(0.005, static=0.01, stribeck=0.3), {}
    for exponent in (1, 2):
        found = run(sliding(joints=[{"friction": law}], friction={"stribeck_exponent": exponent}), SLIDE)
        v = last(found, "joint_velocity")[0]
        torque[exponent] = last(found, "friction_torque")[0]
        assert torque[exponent] == pytest.approx(0.005 * (1.0 + np.exp(-((v / 0.3) ** exponent))), rel=1e-4)
    assert torque[1] > 1.03 * torque[2]


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
def test_tension_loss(speed: float) -> None:
    """linear f (1 − λ), capstan f e^−λ; the tendon that is paid out loses with λ < 0."""
    level, torque = 0.3, {}
    for loss in ("linear", "capstan"):
        found = run(tendon_sliding(speed, dry(level), tension_loss=loss), SLIDE)
        f = last(found, "tendon_force")
        coefficient = level * np.sign(speed * np.array([ARM, -ARM]))
        lost = f * (coefficient if loss == "linear" else 1.0 - np.exp(-coefficient))
        torque[loss] = last(found, "friction_torque")[0]
        assert torque[loss] == pytest.approx(ARM * (lost[0] - lost[1]), rel=1e-5)
    assert abs(torque["linear"] - torque["capstan"]) > 1e-3 * abs(torque["linear"])


def test_pulley_torque() -> None:
    """Joint 2 moves: the pulley on link 1 takes the same from joint 2, and from joint 1 only by eq. (10)."""
    arms = [[ARM, ARM], [-ARM, -ARM]]  # pulls of both tendons add up on joint 1
    arms += [[ARM, -ARM], [-ARM, ARM]]
    tendons = [{"pulley_friction": [dry(0.1)]}, {"pulley_friction": [dry(0.1)]}, {}, {}]
    for where in ("at_joint", "beyond_joint"):
        motion = legs_of([[0.5, 0.0, SPEED]], [0.0, 0.0])
        rig = calm(small_rig(arms, motion=motion, tendons=tendons, friction={"pulley_torque": where}))
        found = run(rig, SLIDE)
        f, torque = last(found, "tendon_force"), last(found, "friction_torque")
        assert torque[1] == pytest.approx(0.1 * ARM * (f[0] + f[1]), rel=1e-5)
        expected = 0.1 * ARM * (f[0] + f[1]) if where == "at_joint" else 0.0
        assert torque[0] == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_joint_load() -> None:
    """λ_load Σ f_B over all tendons, or over those with a moment arm at the joint or beyond."""
    arms = [[ARM, 0.0], [-ARM, 0.0], [0.5 * ARM, ARM], [-0.5 * ARM, -ARM]]
    joints = [{"load_friction": dry(2e-4)}, {"load_friction": dry(1e-4)}]
    for load in ("all", "passing"):
        motion = legs_of([[0.5, SPEED, -SPEED]], [0.0, 0.0])
        found = run(calm(small_rig(arms, motion=motion, joints=joints, friction={"joint_load": load})), SLIDE)
        f, torque = last(found, "tendon_force"), last(found, "friction_torque")
        assert torque[0] == pytest.approx(2e-4 * f.sum(), rel=1e-5)
        assert torque[1] == pytest.approx(-1e-4 * (f[2:] if load == "passing" else f).sum(), rel=1e-5)


@pytest.mark.parametrize("loss", ["linear", "capstan"])
def test_preload(loss: str) -> None:
    """A part of the loss that the tension does not scale: P (1 − exp(−f/P)) λ."""
    level, P = 0.05, 6.0
    found = run(tendon_sliding(SPEED, dry(level), tension_loss=loss, preload=P), SLIDE)
    f = last(found, "tendon_force")
    coefficient = np.array([level, -level])
    lost = f * coefficient if loss == "linear" else f * (1.0 - np.exp(-coefficient))
    lost = lost + P * (1.0 - np.exp(-f / P)) * coefficient
    assert last(found, "friction_torque")[0] == pytest.approx(ARM * (lost[0] - lost[1]), rel=1e-5)


def test_asymmetry() -> None:
    """× (1 + a) forwards, × (1 − a) backwards, also the viscous part."""
    law = dry(0.006, viscous=0.002)
    for speed in (SPEED, -SPEED):
        found = run(sliding(speed, joints=[{"friction": law}], friction={"asymmetry": 0.2}), SLIDE)
        v = last(found, "joint_velocity")[0]
        factor = 1.0 + 0.2 * np.sign(speed)
        assert last(found, "friction_torque")[0] == pytest.approx(factor * (0.006 * np.sign(v) + 0.002 * v), rel=1e-5)


def edge_loss(shape: str, posture: float, **more: Any) -> float:
    """λ of the edge before joint 2 in steady sliding, joint 1 held at a posture: friction torque / Σ f r."""
    entries = [
        {"tendon": i, "joint": 2, "shape": shape, "rest": 0.1, "slope": 0.9, "centre": 0.2, "coefficient": 0.08}
        | {"negative_coefficient": 0.03}
        for i in (1, 2, 3, 4)
    ]
    rig = calm(
        small_rig(
            TWO_JOINTS,
            motion=legs_of([[0.5, 0.0, SPEED]], [posture, 0.0]),
            tendons=[{"edge_friction": [None, dry(0.5, static=0.75, stribeck=0.005)]}] * 4,
            friction={"edges": entries} | more,
        )
    )
    found = run(rig, SLIDE)
    assert last(found, "joint_position")[0] == pytest.approx(posture, abs=1e-3)
    f, torque = last(found, "tendon_force"), last(found, "friction_torque")[1]
    if more.get("tension_loss") == "capstan":
        return float(np.arcsinh(torque / (ARM * f.sum())))  # equal tensions: Σ ± f (1 − e^∓λ) = 2 f sinh λ
    return float(torque / (ARM * f.sum()))


STRIBECK = 1.0 + 0.5 * np.exp(-SPEED * ARM / 0.005)  # what the law adds to its own coulomb level at this speed


@pytest.mark.parametrize("posture", [0.5, -0.4])
def test_edges_sine(posture: float) -> None:
    """coefficient of the sign of θ × |sin θ|, θ = rest + slope (q − centre), instead of the law's own level."""
    theta = 0.1 + 0.9 * (posture - 0.2)
    expected = (0.08 if theta > 0.0 else 0.03) * abs(np.sin(theta)) * STRIBECK
    assert edge_loss("sine", posture) == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("posture", [0.5, -0.4])
@pytest.mark.parametrize("loss", ["linear", "capstan"])
def test_edges_capstan(posture: float, loss: str) -> None:
    """1 − exp(−coefficient |θ|) lost linearly, or the exponent coefficient |θ| itself."""
    theta = 0.1 + 0.9 * (posture - 0.2)
    exponent = (0.08 if theta > 0.0 else 0.03) * abs(theta)
    expected = (exponent if loss == "capstan" else 1.0 - np.exp(-exponent)) * STRIBECK
    assert edge_loss("capstan", posture, tension_loss=loss) == pytest.approx(expected, rel=3e-3)


def test_contacts_without_dry_friction() -> None:
    """A law that is only viscous, or nothing at all, needs no bristle level to divide by."""
    for viscous in (0.003, 0.0):
        rig = sliding(joints=[{"friction": dry(0.0, viscous=viscous)}], friction={"bristle_damping": 0.003})
        found = run(rig, SLIDE)
        np.testing.assert_allclose(found["friction_torque"], viscous * found["joint_velocity"], atol=1e-10)
        assert last(found, "joint_velocity")[0] == pytest.approx(SPEED, rel=1e-3)


def test_drift() -> None:
    """Level 1 + A (1 − exp(−t/T)); it does not touch the viscous part."""
    law = dry(0.006, viscous=0.002)
    rig = sliding(joints=[{"friction": law}], friction={"drift": {"amplitude": 0.5, "time_constant": 0.4}})
    found = run(rig, SLIDE)
    level = 1.0 + 0.5 * (1.0 - np.exp(-SLIDE / 0.4))
    np.testing.assert_allclose(found["friction_level"], level, rtol=1e-12)
    v = last(found, "joint_velocity")[0]
    assert last(found, "friction_torque")[0] == pytest.approx(level[-1] * 0.006 + 0.002 * v, rel=1e-5)


def test_heat() -> None:
    """Θ' = friction power − Θ/T and level 1 + coefficient Θ: Θ(t) is the convolution of the friction work."""
    rig = sliding(joints=[{"friction": dry(0.06)}], friction={"heat": {"coefficient": 10.0, "time_constant": 0.3}})
    time = grid(0.5, 1e-3)
    found = run(rig, time)
    work, middle = np.diff(found["energy"][:, 3]), (time[1:] + time[:-1]) / 2.0
    start = (found["friction_level"][0] - 1.0) / 10.0
    theta = [np.sum(work[:k] * np.exp(-(time[k] - middle[:k]) / 0.3)) for k in range(len(time))]
    expected = 1.0 + 10.0 * (start * np.exp(-time / 0.3) + np.array(theta))
    np.testing.assert_allclose(found["friction_level"], expected, rtol=1e-5)
    assert found["friction_level"][-1] > 1.03
    assert last(found, "friction_torque")[0] == pytest.approx(0.06 * found["friction_level"][-1], rel=1e-4)


def test_wrist() -> None:
    """The finger stands, the wrist turns: each tendon loses λ f before the finger, by the sign of its wrist motion."""
    law = dry(0.05)
    wrist = {"amplitude": 0.5, "period": 1.0, "arms": [0.01, -0.01], "friction": law}
    found = run(calm(small_rig(wrist=wrist)), grid(1.0, 1e-2))
    f = found["tendon_force"]
    for k, sign in ((20, 1.0), (50, -1.0), (95, 1.0)):  # α' > 0 up to a quarter of the period, < 0 up to three
        expected = 0.05 * sign * (ARM * f[k, 0] + ARM * f[k, 1])
        assert found["friction_torque"][k, 0] == pytest.approx(expected, rel=1e-4)
    # motors and sensors account for the wrist's own kinematics: only the friction's offset moves the finger
    assert np.ptp(found["joint_position"][:, 0]) == pytest.approx(2 * 0.05 * 20.0 / (2 * STIFFNESS * ARM), rel=0.02)


# --- Contact ----------------------------------------------------------------------------------------------------


def test_obstacle() -> None:
    """At rest against a sphere: k × depth along the normal."""
    obstacle = {"centre": [0.04, 0.0, -0.02], "radius": 0.019, "stiffness": 500.0, "damping": 5.0}
    found = run(calm(small_rig(motion=legs_of([[0.2, 0.4]], [0.0]), obstacle=obstacle)), np.array([0.0, 0.9]))
    assert not found["contact"][0] and found["contact"][1]
    away = found["tip_position"][1] - np.array(obstacle["centre"])
    depth = 0.019 - np.linalg.norm(away)
    assert depth > 1e-4
    np.testing.assert_allclose(found["contact_force"][1], 500.0 * depth * away / np.linalg.norm(away), rtol=1e-5)


def test_pushes() -> None:
    """Raised cosines up and down; the contact label at contact_force."""
    push = {"start": 0.1, "rise": 0.2, "hold": 0.1, "fall": 0.1, "force": 2.0, "direction": [0.0, 0.0, -3.0]}
    rig = calm(small_rig(pushes=[push | {"frame": "base"}], contact_force=1.0))
    time = grid(0.6, 1e-2)
    found = run(rig, time)
    rise = 0.5 * (1.0 - np.cos(np.pi * np.clip((time - 0.1) / 0.2, 0.0, 1.0)))
    fall = 0.5 * (1.0 + np.cos(np.pi * np.clip((time - 0.4) / 0.1, 0.0, 1.0)))
    size = 2.0 * np.where(time < 0.4, rise, fall)
    np.testing.assert_allclose(found["contact_force"][:, 2], -size, atol=1e-12)
    clear = np.abs(size - 1.0) > 1e-9
    assert np.array_equal(found["contact"][clear], (size > 1.0)[clear])


@pytest.mark.parametrize("length", [5e-3, 2e-4, 2e-5])
@pytest.mark.parametrize("tolerance", [1e-8, 1e-4])
def test_short_pushes_are_not_stepped_over(tolerance: float, length: float) -> None:
    """A finger at rest is integrated in long steps. The impulse F (rise/2 + hold + fall/2) at 40 mm turns the joint of
    2e-6 + 0.01·0.02² kg·m² before its tendons, at 74 Hz and damped, have moved."""
    push = {"start": 0.3, "rise": 0.25 * length, "hold": 0.5 * length, "fall": 0.25 * length, "force": 1.0}
    where = {"direction": [0.0, 0.0, -1.0], "frame": "base", "point": [0.04, 0.0, 0.0]}
    rig = calm(small_rig(pushes=[push | where]))
    found = run(rig, np.array([0.3 + length, 0.6]), relative_tolerance=tolerance)
    assert found["energy"][1, 5] > 0.0
    if length < 1e-4:
        assert found["joint_velocity"][0, 0] == pytest.approx(0.04 * 0.75 * length / 6e-6, rel=0.05)


# --- At the limits ----------------------------------------------------------------------------------------------


def test_slack() -> None:
    """A tendon pushed past its pretension pulls no more: f = 0, flagged, and the other carries the load alone."""
    push = {"start": 0.0, "rise": 0.1, "hold": 1.0, "fall": 0.1, "force": 3.0, "direction": [0.0, 0.0, -1.0]}
    rig = calm(small_rig(pretension=2.0, pushes=[push], links=[{"damping": 0.002}]))
    found = run(rig, np.array([0.0, 0.6]))
    f = found["tendon_force"][1]
    # the push bends towards positive angles, which tendon 1 pulls to: it goes slack
    assert not found["slack"][0].any() and list(found["slack"][1]) == [True, False]
    assert f[0] == 0.0
    assert found["joint_torque"][1, 0] == pytest.approx(found["external_torque"][1, 0], rel=1e-6)


def test_settle_stands_still() -> None:
    """After `settle` the finger rests, at time 0."""
    plant = make(calm(small_rig(motion=still([0.3]), joints=[{"friction": dry(0.005)}])))
    assert plant.time == 0.0
    assert abs(plant.continuous_state()[1]) < 1e-6  # rad/s; the solver's tolerance is 1e-8 of each quantity's scale
