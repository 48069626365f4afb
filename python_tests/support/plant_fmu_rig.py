"""The rig that the tests of the simulated finger's FMU pack: small, with friction, sensors, a push and a motion."""

from __future__ import annotations

from typing import Any

from fmu_binary import LAW, OK, Instance
from plant_rigs import TWO_JOINTS, small_rig

JOINT_LAW = {"static": 0.004, "coulomb": 0.003, "stribeck_velocity": 0.1, "viscous": 0.0005}
FRICTION = {
    "presliding": {"pulley": 25e-6, "edge": 40e-6, "joint": 0.004},
    "bristle_damping": 0.003,
    "stribeck_exponent": 2,
    "tension_loss": "linear",
    "pulley_torque": "beyond_joint",
    "joint_load": "all",
}
PUSH = {
    "start": 0.2, "rise": 0.02, "hold": 0.1, "fall": 0.02, "force": 0.5, "direction": [0.0, 0.0, 1.0],
    "frame": "base", "link": 2, "point": [0.04, 0.0, 0.0],
}  # fmt: skip
SEED, TOLERANCE, DURATION = 7, 1e-6, 3.0


def fmu_rig(**changes: Any) -> dict[str, Any]:
    """An unexpanded rig of two joints and four tendons."""
    rig = small_rig(
        TWO_JOINTS,
        joints=[{"friction": JOINT_LAW, "cover": {"stiffness": 0.02}}] * 2,
        tendons=[{"edge_friction": [LAW, LAW], "pulley_friction": [LAW, None]}] * 4,
        links=[{"limits": {"lower": -0.8, "upper": 0.8}}] * 2,
        friction=FRICTION,
        gravity=[0.0, 0.0, -9.81],
        sensors={"rate": 1000, "tendon_force": {"noise": 0.01}, "joint_position": {"noise": 1e-4, "delay": 0.002}},
        pushes=[PUSH],
        settle=0.3,
        seed=SEED,
        integration={"relative_tolerance": TOLERANCE},
        recording={"duration": DURATION},
    )
    motion = {"kind": "strokes", "seed": 1, "duration": DURATION, "still": 0.02, "speed": [1.0, 3.0]}
    return rig | {"motion": motion | {"rest": [0.02, 0.04], "pretension": 10.0}} | changes


def play(instance: Instance, steps: int, begin: int = 0, start: float = 0.0, step: float = 0.001) -> list[list[float]]:
    """Outputs after each step, the inputs moving a little every tenth of a second."""
    rows = []
    for k in range(begin, begin + steps):
        if k % 100 == 0:
            assert instance.write({"pretension": 0.1 * (k // 100), "tendon_position_command[1]": 1e-5 * k}) == OK
        assert instance.step(start + k * step, step) == OK, instance.last_message
        rows.append(instance.outputs())
    return rows
