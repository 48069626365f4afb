"""Named cases of `extensions` (docs/reference/semantics/effects.md) with results known by hand.

Friction laws are dry (F = ±0.1 at any speed) where a case is not about the law, and lengths, times and speeds are
chosen so that exponentials are powers of 1/2.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analytic_cases import (  # fmt: skip
    ARM,
    ASYMMETRIC,
    DRY,
    V_MIN,
    Description,
    Outputs,
    Run,
    case,
    case_of_sources,
    close,
    finger,
    law_value,
    one_edge,
    recording,
)

HALF = 1.0 / math.log(2.0)  # exp(-x / (HALF·x)) = 1/2
JOINT_DRY = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}


def torque(out: Outputs) -> Any:
    """T, [N, n]."""
    return out["friction_torque"] - out["bias_torque"]


def two_joints(extensions: list[Description], **settings: Any) -> Description:
    """R = [[1, 2], [3, −1]] cm; the second tendon is a cable loop."""
    tendons = [{"moment_arms": [0.01, 0.02]}, {"moment_arms": [0.03, -0.01], "bidirectional": True}]
    joints: list[Description] = [{"name": "j1", "cover": {"stiffness": 0.0, "rest_angle": 0.2}}, {"name": "j2"}]
    return finger(tendons, joints, extensions=extensions, **settings)


def of_two(time: Any, force: Any, speed: Any, angle: Any = 0.0) -> Any:
    return recording(time, force, speed, angle, tendons=2, joints=2)


@case
def springs_and_weights(run: Run) -> None:
    """joint_coupling with rest angles, gravity on the joints before; rows add up."""
    extensions = [
        {"effect": "joint_coupling", "joint": 1, "stiffness": 0.5},
        {"effect": "gravity", "joint": 2, "sine": 0.2, "cosine": 0.1},
        {"effect": "gravity", "joint": 1, "cosine": 0.3},
        {"effect": "cover_hardening", "joint": 1, "stiffness": 2.0},
        {"effect": "cover_hardening", "joint": 1, "stiffness": -1.0},
    ]
    # θ = q_1 + q_2 = π/2 and π/6
    angles = [[0.7, math.pi / 2 - 0.7], [0.2, math.pi / 6 - 0.2]]
    out = run(two_joints(extensions), of_two([0, 0.1], 10.0, 0.0, angles))
    c = 0.5 * (0.5 - (math.pi / 2 - 0.7))
    close(torque(out)[0], [c + 0.2 + 0.3 * math.cos(0.7) + 0.125, -c + 0.2])
    c = 0.5 * (0.0 - (math.pi / 6 - 0.2))
    weight = 0.2 * 0.5 + 0.1 * math.sqrt(0.75)
    close(torque(out)[1], [c + weight + 0.3 * math.cos(0.2), -c + weight])
    close(out["compensated_torque"], out["joint_torque"] - out["friction_torque"])


@case
def gravity_of_other_axes(run: Run) -> None:
    """An axis against that of the link turns it back, one across leaves it alone."""
    description = two_joints([{"effect": "gravity", "joint": 2, "sine": 0.2, "cosine": 0.1}])
    against = description | {"links": [{"axis": [0, 0, -3]}, {"axis": [0, 0, 1]}], "tip": [0.1, 0, 0]}
    rec = of_two([0.0], 10.0, 0.0, [[0.4, 0.9]])
    out = run(against, rec)
    weight = 0.2 * math.sin(0.5) + 0.1 * math.cos(0.5)
    close(torque(out), [[-weight, weight]])


@case
def inertia(run: Run) -> None:
    """q̇ backwards: 0 first, then (3 − 1)/0.1 and (2 − 3)/0.2."""
    description = one_edge(DRY, extensions=[{"effect": "inertia", "joint": 1, "inertia": 1e-3}])
    rec = recording([0.0, 0.1, 0.3], 10.0, [1.0, 3.0, 2.0])
    out = run(description, rec)
    close(torque(out)[:, 0], 0.01 + np.array([0.0, 0.02, -0.005]))


@case
def held_friction(run: Run) -> None:
    """preload_friction and load_friction: nothing before the first motion, held at rest, turned by motion alone."""
    extensions = [
        {"effect": "preload_friction", "tendon": 1, "coulomb": 2.0},
        {"effect": "preload_friction", "joint": 2, "tendon": 2, "coulomb": 5.0},
        {"effect": "load_friction", "joint": 2, "tendon": 2, "coulomb": 1e-3},
    ]
    speed = [[0.0, 0.0], [1.0, -0.1], [1.0, -0.9], [0.01, 0.009], [0.0, 0.0]]
    # ẋ_11 = 0.008, −0.008, 0.00028; ẋ_12 = 0.02 q̇_2; ẋ_22 = −0.01 q̇_2 (0.001 m/s is above 0.0005, 9e-5 is not)
    force = [[10.0, 8.0], [10.0, 8.0], [10.0, -8.0], [10.0, -4.0], [10.0, 4.0]]
    out = run(two_joints(extensions), of_two(np.arange(5) * 0.1, force, speed))
    # tendon 1 before joint 1: both arms; before joint 2: the second one
    forward = np.array([0.01 * 2.0, 0.02 * 2.0 - 0.02 * 2.0])
    backward = np.array([-0.01 * 2.0, -0.02 * 2.0 - 0.02 * 2.0])
    loop = np.array([0.0, -0.01 * 5.0])  # ẋ_22 > 0
    load = np.array([0.0, -1e-3])  # q̇_2 < 0
    close(torque(out), [[0.0, 0.0], forward + loop + 8.0 * load, backward + loop + 8.0 * load,
                        backward + loop + 4.0 * load, backward + loop + 4.0 * load])  # fmt: skip
    close(out["bias_torque"], out["bias_torque"][:1] + np.zeros((5, 1)))  # it neither sticks nor jumps


@case
def held_friction_builds_up(run: Run) -> None:
    """preload_friction with presliding everywhere: z in place of its sign; load_friction: part of the joint's limit."""
    extensions = [
        {"effect": "presliding", "displacement": 0.1},  # D: 5e-5 m at a tendon, 1e-3 rad at a joint
        {"effect": "preload_friction", "joint": 2, "tendon": 2, "coulomb": 5.0},
        {"effect": "load_friction", "joint": 2, "tendon": 2, "coulomb": 1e-3},
    ]
    rec = of_two([0.0, 0.001, 0.002], [[10.0, 8.0]] * 3, [[0.0, 0.0], [0.0, -1.0], [0.0, 2.0]])
    still = torque(run(two_joints(extensions[:1]), rec))
    # ẋ_22 = −0.01 q̇_2 travels 1e-5 m and −2e-5 m of 5e-5; q̇_2 −1e-3 rad, which is all of D, and back by twice that
    added = torque(run(two_joints(extensions), rec)) - still
    close(added[:, 0], np.zeros(3))
    close(added[:, 1], -0.01 * 5.0 * np.array([0.0, 0.2, -0.2]) + 8.0 * 1e-3 * np.array([0.0, -1.0, 1.0]))


@case
def corrected_measurements(run: Run) -> None:
    """Forces and arms other than described: corrections of the torque, not of joint_torque, or the angle."""
    extensions = [
        {"effect": "force_gain", "tendon": 1, "correction": 0.1},
        {"effect": "force_offset", "tendon": 2, "correction": -0.5},
        {"effect": "moment_arm", "joint": 1, "tendon": 2, "correction": 2e-3},
        {"effect": "moment_arm_variation", "joint": 2, "tendon": 1, "slope": 4e-3},
        {"effect": "moment_arm_variation", "joint": 1, "tendon": 1, "slope": 2e-3, "correction": -1e-3},
        {"effect": "pulley_eccentricity", "joint": 2, "tendon": 2, "sine": 1e-3, "cosine": 3e-3},
    ]
    # q = R⁺ (x0 − f0/k) with x0 = R (0.3, π/6) + f0/k
    q = np.array([0.3, math.pi / 6])
    force = np.array([20.0, -8.0])
    position = np.array([[0.01, 0.02], [0.03, -0.01]]) @ q + force / 1000.0
    rec = of_two([0.0, 0.1], [force, force], 0.0) | {"tendon_position": np.array([position, position])}
    description = two_joints(extensions)
    out = run(description, rec, 1)
    arm = 1e-3 * 0.5 + 3e-3 * math.sqrt(0.75)
    first = -0.1 * 0.01 * 20.0 + 0.5 * 0.03 + 2e-3 * 8.0 - (2e-3 * 0.3 - 1e-3) * 20.0
    second = -0.1 * 0.02 * 20.0 - 0.5 * 0.01 - 4e-3 * (math.pi / 6) * 20.0 + arm * 8.0
    close(torque(out), [[first, second]] * 2)
    close(out["joint_torque"], [[0.2 - 0.24, 0.4 + 0.08]] * 2)
    close(out["joint_angle"], [q, q])


@case
def presliding(run: Run) -> None:
    """F: 0, half of the limit, slips, back over twice the distance, then at rest on the earlier side; no bias jump."""
    law = {"positive": JOINT_DRY, "negative": JOINT_DRY | {"static": 0.3, "coulomb": 0.2}}
    rows = [{"effect": "presliding", "joint": 1, "displacement": 0.2}]
    description = finger([{"moment_arms": [ARM]}], [{"name": "j", "friction": law}], extensions=rows)
    speed = [1.0, 1.0, 1.0, -2.0, 0.0, 0.0, -0.005, 1.0]
    out = run(description, recording(np.arange(8) * 0.1, 10.0, speed))
    # 0.1 N·m on the positive side, 0.2 and what is left of 0.1 on the other: κ = limit/D
    slow = 0.2 + 0.1 * math.exp(-0.5)
    back = 0.1 - 0.2 / 0.2 * 0.2
    crept = back - slow / 0.2 * 0.0005
    expected = [0.0, 0.05, 0.1, back, back, back, crept, crept + 0.05]
    close(torque(out)[:, 0], expected)
    close(out["bias_torque"], 0.1)


@case
def presliding_by_stiffness(run: Run) -> None:
    """Two elements of a joint, one of which relaxes; what is held does not change with the load."""
    rows = [
        {"effect": "presliding", "joint": 1, "stiffness": 2.0, "share": 3.0},
        {"effect": "presliding", "joint": 1, "stiffness": 1.0, "share": 1.0, "relaxation_time": 0.1 * HALF},
    ]
    load = {"static": 1e-2, "coulomb": 1e-2, "stribeck_velocity": 1.0}
    description = finger([{"moment_arms": [ARM]}], [{"name": "j", "load_friction": load}], extensions=rows)
    rec = recording(np.arange(5) * 0.1, [10.0, 10.0, 5.0, 5.0, 5.0], [0.0, 0.1, 0.0, 0.0, 1.0])
    out = run(description, rec)
    # limits 0.075 and 0.025, then half of that; the second loses half in each step and gains 1/(2 ln 2) of its travel
    second = 0.01 / (2.0 * math.log(2.0))
    expected = [0.0, 0.02 + second, 0.02 + second / 2.0, 0.02 + second / 4.0, 0.05]
    close(torque(out)[:, 0], expected)


@case
def presliding_passes_the_force_on(run: Run) -> None:
    """At a tendon: f_B = f_A − F, with a factor of friction_drift, beside a joint that sticks as ever."""
    rows = [
        {"effect": "presliding", "tendon": 1, "displacement": 2e-3},
        {"effect": "friction_drift", "tendon": 1, "amplitude": 1.0, "time_constant": 0.1 * HALF},
    ]
    tendon = {"moment_arms": [ARM], "edge_friction": [DRY]}
    load = {"static": 1e-3, "coulomb": 1e-3, "stribeck_velocity": 1.0}
    description = finger([tendon], [{"name": "j", "load_friction": load}], extensions=rows)
    rec = recording([0.0, 0.1, 0.2], 10.0, [1.0, 1.0, 0.0])
    out = run(description, rec)
    # half the distance at a limit of 3/2; that is held at rest, whatever the limit
    F = np.array([0.0, 0.5 * 1.5, 0.5 * 1.5])
    rubs = np.array([1e-3, 1e-3, 0.0]) * (10.0 - F)
    close(torque(out)[:, 0], ARM * F + rubs)
    entered = 1e-3 * (10.0 - F[2])  # the joint alone came to rest
    close(out["bias_torque"][:, 0], 0.09 + np.array([0.0, 0.0, entered]))


@case
def cords_that_stretch(run: Run) -> None:
    """A pulley turns as the cord beyond it stretches: a force that rises at a finger that stands."""
    rows = [{"effect": "presliding", "tendon": 1, "stiffness": 1000.0}, {"effect": "cord_stretch", "stiffness": 500.0}]
    tendon = {"moment_arms": [ARM], "edge_friction": [DRY]}
    description = finger([tendon], [{"name": "j"}], extensions=rows)
    out = run(description, recording([0.0, 0.1, 0.2, 0.3], [10.0, 10.3, 10.3, 20.0], [0.0, 0.0, 0.0, 0.0]))
    # F = κ·(ΔT_b − F)/k_c, so 2/3 of the rise; then it is held, and what the rise makes of it slips at a tenth of T_b
    close(torque(out)[:, 0], ARM * np.array([0.0, 0.2, 0.2, 2.0]))


@case
def friction_that_drifts(run: Run) -> None:
    """φ = 1 + a·(1 − 2^(−t)) of F and of b, several rows multiply; t counts from the first sample."""
    rows = [
        {"effect": "friction_drift", "amplitude": 0.5, "time_constant": HALF},
        {"effect": "friction_drift", "tendon": 1, "amplitude": -0.8, "time_constant": HALF},
        {"effect": "friction_drift", "joint": 1, "amplitude": 9.0, "time_constant": HALF},  # no friction there
    ]
    rec = recording([5.0, 6.0, 7.0, 8.0], 10.0, [1.0, 1.0, 0.0, -1.0])
    out = run(one_edge(DRY, extensions=rows), rec)
    gone = 1.0 - 0.5 ** np.arange(4)
    phi = (1.0 + 0.5 * gone) * (1.0 - 0.8 * gone)
    close(torque(out)[:, 0], 0.01 * phi * np.array([1.0, 1.0, 0.0, -1.0]))
    # enters with φ_2·F, leaves after one sample with −F(s2)−(F(s1)−F(s2))·1 = −0.1, times φ_3
    jumps = 0.01 * np.cumsum([0.0, 0.0, phi[2], -phi[3]])
    close(out["bias_torque"][:, 0], 0.09 + jumps)


@case
def stribeck(run: Run) -> None:
    """1 + a·exp(−|v|/v_s) of F at a tendon, and of b at the present |v|: friction that rises from rest."""
    rows = [{"effect": "stribeck", "tendon": 1, "amplitude": -0.8, "stribeck_velocity": 0.01 * HALF}]
    rec = recording([0.0, 0.1, 0.2, 0.3], 10.0, [1.0, 2.0, 0.0, -1.0])
    out = run(one_edge(ASYMMETRIC, extensions=rows), rec)
    F = np.array([law_value(ASYMMETRIC, v) for v in (0.01, 0.02)])
    close(torque(out)[:2, 0], 0.1 * F * np.array([0.6, 0.8]))
    start = 0.1 - 0.1 * 0.6 * F[0]
    entered = 0.1 * 0.2 * law_value(ASYMMETRIC, V_MIN)  # v = 0
    left = -0.1 * 0.6 * law_value(ASYMMETRIC, V_MIN)  # κ = 1: one sample of rest
    close(out["bias_torque"][:, 0], [start, start, start + entered, start + entered + left])


@case
def all_that_friction_can_hold(run: Run) -> None:
    """B: |F| times the factors, of what sticks and of what slides."""
    rows = [
        {"effect": "stribeck", "tendon": 1, "amplitude": 0.5, "stribeck_velocity": 1.0},
        {"effect": "friction_drift", "amplitude": 1.0, "time_constant": HALF},
    ]
    slides = [*rows, {"effect": "presliding", "tendon": 1, "displacement": 1.0}]
    contact = {"threshold": [1e6], "method": "bands", "bands": [{"noise": [1e6]}] * 4}
    for extensions in (rows, slides):
        out = run(one_edge(DRY, contact=contact, extensions=extensions), recording([0.0, 1.0], 10.0, 0.0))
        if "contact_terms" in out:
            close(out["contact_terms"][:, 0, :, 4].T, 0.01 * 1.5 * np.array([1.0, 1.5]) * np.ones((4, 1)))


@case
def progressive_tendon(run: Run) -> None:
    """30 N stretch it by 0.02 m where k = 1000 N/m and h = 25000 N/m²; −30 N by −0.02 m; hardening 0 is the spring."""
    rows = [{"effect": "tendon_nonlinearity", "tendon": 1, "hardening": 25000.0}]
    tendons = [{"moment_arms": [ARM], "bidirectional": True}]
    rec = recording([0.0, 0.1, 0.2], [30.0, -30.0, 0.0], 0.0, position=[0.021, 0.001, 0.004])
    out = run(finger(tendons, extensions=rows), rec, 1)
    close(out["joint_angle"][:, 0], [0.1, 2.1, 0.4], within=1e-12)


@case
def play_of_a_tendon(run: Run) -> None:
    """Width 4 mm at r = 1 cm: the angle waits 0.4 rad after a reversal, then follows 0.2 rad behind."""
    rows = [{"effect": "backlash", "tendon": 1, "width": 0.004}]
    description = one_edge(DRY, extensions=rows, velocity_filter_cutoff=0.0)
    position = np.array([0.01, 0.012, 0.015, 0.013, 0.011, 0.008, 0.010])
    rec = recording(np.arange(7) * 0.1, 10.0, 0.0, position=position)
    out = run(description, rec, 1)
    z = np.array([0.010, 0.010, 0.013, 0.013, 0.013, 0.010, 0.010])
    angle = (z - 0.01) / 0.01
    close(out["joint_angle"][:, 0], angle, within=1e-12)
    close(out["joint_speed"][:, 0], np.diff(angle, prepend=angle[0]) / 0.1, within=1e-11)


@case_of_sources(2, 3)
def play_of_a_joint(run: Run, source: int) -> None:
    """By measured angles it stops the velocity too; a measured velocity stays as it is. Covers see what is left."""
    joints = [{"name": "j", "cover": {"stiffness": 0.5}}]
    rows = [{"effect": "backlash", "joint": 1, "width": 0.4}, {"effect": "backlash", "tendon": 1, "width": 0.4}]
    description = finger([{"moment_arms": [ARM]}], joints, extensions=rows, velocity_filter_cutoff=0.0)
    rec = recording(np.arange(5) * 0.1, 10.0, 2.0, [0.0, 0.1, 0.5, 0.2, -0.1])
    out = run(description, rec, source)
    z = np.array([0.0, 0.0, 0.3, 0.3, 0.1])
    close(out["joint_angle"][:, 0], z)
    close(torque(out)[:, 0], 0.5 * z)
    expected = [0.0, 0.0, 3.0, 0.0, -2.0] if source == 2 else np.full(5, 2.0)
    close(out["joint_speed"][:, 0], expected, within=1e-12)


@case_of_sources(1, 2, 3)
def late_positions(run: Run, source: int) -> None:
    """30 ms late on uneven samples: between neighbours, before the oldest the oldest; forces stay."""
    rows = [{"effect": "time_delay", "delay": 0.03}]
    description = finger([{"moment_arms": [ARM]}], extensions=rows, velocity_filter_cutoff=0.0)
    time = np.array([1.0, 1.02, 1.06, 1.08, 1.13])
    angle, speed = np.array([0.5, 0.7, 1.1, 0.9, 0.4]), np.array([1.0, 2.0, 4.0, 3.0, 5.0])
    force = np.array([10.0, 12.0, 9.0, 8.0, 7.0])
    rec = recording(time, force, speed, angle, position=(ARM * angle + force / 1000.0))
    out = run(description, rec, source)
    close(out["joint_torque"][:, 0], ARM * force)
    # at 0.97, 0.99, 1.03, 1.05, 1.10 s
    late = np.array([0.5, 0.5, 0.8, 1.0, 0.7])
    if source == 1:  # x0 late, f0 not
        x0 = rec["tendon_position"][:, 0]
        late_x0 = [
            x0[0],
            x0[0],
            0.75 * x0[1] + 0.25 * x0[2],
            0.25 * x0[1] + 0.75 * x0[2],
            0.6 * x0[3] + 0.4 * x0[4],
        ]
        late = (np.array(late_x0) - force / 1000.0) / ARM
    close(out["joint_angle"][:, 0], late, within=1e-12)
    if source == 3:
        close(out["joint_speed"][:, 0], [1.0, 1.0, 2.5, 3.5, 3.8], within=1e-12)
    else:
        raw = np.diff(late, prepend=late[0]) / np.diff(time, prepend=0.0)
        close(out["joint_speed"][:, 0], raw, within=1e-10)


@case
def late_forces(run: Run) -> None:
    """delay < 0: earlier forces in all of it: τ, the mean force of the noise, the stretch."""
    rows = [{"effect": "time_delay", "delay": -0.05}]
    bias = {"drift_variance": 0.0, "noise_std": 0.0, "noise_std_per_force": 0.01, "initial_variance": 0.0225}
    description = finger([{"moment_arms": [ARM]}], extensions=rows, bias=bias)
    rec = recording([0.0, 0.1, 0.2], [10.0, 20.0, 30.0], 0.0, position=0.02)
    out = run(description, rec, 1)
    close(out["joint_torque"][:, 0], [0.1, 0.15, 0.25])
    close(out["joint_angle"][:, 0], [1.0, 0.5, -0.5], within=1e-12)
    close(out["bias_torque"][:2, 0], [0.1, 0.125])  # noise (0.01·15)² = 0.0225: K = 1/2 of 0.05


@case
def delay_longer_than_its_memory(run: Run) -> None:
    """64 samples of 0.5 ms reach back 31.5 ms: a delay of 50 ms counts as that."""
    rows = [{"effect": "time_delay", "delay": 0.05}]
    time = np.arange(150) * 0.0005
    rec = recording(time, 10.0, 0.0, np.arange(150.0) ** 2)
    out = run(finger([{"moment_arms": [ARM]}], extensions=rows), rec)
    expected = np.maximum(np.arange(150.0) - 63.0, 0.0) ** 2
    close(out["joint_angle"][:, 0], expected)


@case
def signals_in_order(run: Run) -> None:
    """Late first, then play at the tendon, then the progressive stretch, then play at the joint; rows in any order."""
    rows = [
        {"effect": "backlash", "joint": 1, "width": 0.2},
        {"effect": "tendon_nonlinearity", "tendon": 1, "hardening": 25000.0},
        {"effect": "backlash", "tendon": 1, "width": 0.004},
        {"effect": "time_delay", "delay": 0.05},
    ]
    description = one_edge(DRY, extensions=rows)
    rec = recording([0.0, 0.1, 0.2, 0.3], 30.0, 0.0, position=[0.02, 0.028, 0.02, 0.028])
    out = run(description, rec, 1)
    # late x0: 0.02, 0.024, 0.024, 0.024; z: 0.02, 0.022, 0.022, 0.022; x1 = z − 0.02; q: 0, 0.2 → 0.1 by the play
    close(out["joint_angle"][:, 0], [0.0, 0.1, 0.1, 0.1], within=1e-12)
