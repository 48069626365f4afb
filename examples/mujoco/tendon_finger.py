"""Records free motion of a finger in MuJoCo whose tendons lose force on their way.

    python tendon_finger.py -o free.parquet [--seconds 60] [--pretension 10]

MuJoCo moves the bodies, stretches the springs and makes the friction in the joints. In each step of its loop the core
computes from the tendon forces and the joints' motion what the tendons lose (losses.json), as torques on the joints.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from tendonfmu import Runner
from tendonfmu.excite import pretension_vector
from tendonfmu.files import write_table

Array = NDArray[np.float64]
HERE = Path(__file__).resolve().parent
STEP = 0.001  # s
FORCE_NOISE = 0.02  # N, of a load cell
SETTLE = 1.0  # s before the recording begins
LOWEST, HIGHEST = np.array([-0.25, 0.05]), np.array([1.1, 0.95])  # rad


class TendonFinger:
    """The finger of finger.xml with the losses of losses.json, stepped at 1 kHz. seed: of the sensors' noise."""

    def __init__(self, seed: int) -> None:
        description = json.loads((HERE / "losses.json").read_text(encoding="utf-8"))
        self.losses = Runner(description, kinematics=3)
        self.model = mujoco.MjModel.from_xml_path(str(HERE / "finger.xml"))
        self.data = mujoco.MjData(self.model)
        self.random = np.random.default_rng(seed)
        self.arms = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
        self.stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
        self.preload = pretension_vector(description) / self.stiffness  # m per N of pretension
        mujoco.mj_forward(self.model, self.data)
        self.reference = self.data.ten_length.copy()  # m, at joint angle 0: where tendon positions count from

    def tension(self, motors: Array) -> Array:
        """Force of each spring [N] where the joints are now; it pulls only."""
        for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
            compute(self.model, self.data)
        return np.asarray(np.clip(self.stiffness * (self.data.ten_length - self.reference + motors), 0.0, 100.0))

    def step(self, angles: Array, pretension: float) -> Array:
        """Move the motors as the angles ask, let the tendons lose force, step MuJoCo; time and readings of a row."""
        motors, d = self.arms @ angles + pretension * self.preload, self.data
        force = self.tension(motors)
        lost = self.losses.step(
            d.time,
            tendon_force=force,
            tendon_position=motors,
            joint_position=d.qpos.copy(),
            joint_velocity=d.qvel.copy(),
        )
        d.qfrc_applied[:] = -lost.friction_torque
        d.ctrl[:] = self.reference - motors  # a position servo of the tendon's length: the spring behind the motor
        mujoco.mj_step(self.model, d)
        read = self.tension(motors) + self.random.normal(0.0, FORCE_NOISE, len(motors))
        return np.concatenate([[d.time - SETTLE], read, motors, d.qpos, d.qvel])


def motion(seconds: float, seed: int) -> Array:
    """[N, n] wanted angles: strokes of both joints between random angles, smooth, at up to some 2 rad/s."""
    random = np.random.default_rng(seed)
    columns = []
    for low, high in zip(LOWEST, HIGHEST, strict=True):
        at, parts, count = 0.3, [np.full(round(SETTLE / STEP), 0.3)], 0
        while count < seconds / STEP:
            target = random.uniform(low, high)
            s = np.linspace(0.0, 1.0, round(random.uniform(0.5, 2.0) / STEP))
            parts.append(at + (target - at) * s**3 * (10 - 15 * s + 6 * s**2))
            at, count = target, count + len(s)
        columns.append(np.concatenate(parts)[: round((SETTLE + seconds) / STEP)])
    return np.column_stack(columns)


def record(seconds: float, pretension: float, seed: int) -> dict[str, Array]:
    """Columns at 1 kHz; the pretension varies by 30 %, which shows friction that grows with the force."""
    finger = TendonFinger(seed)
    finger.data.qpos[:] = 0.3
    rows = [
        finger.step(angles, pretension * (1.0 + 0.3 * np.sin(2 * np.pi * 0.07 * k * STEP)))
        for k, angles in enumerate(motion(seconds, seed))
    ]
    names = ["time"]
    for group, count in (("tendon_force", 4), ("tendon_position", 4), ("joint_position", 2), ("joint_velocity", 2)):
        names += [f"{group}[{i}]" for i in range(1, count + 1)]
    return dict(zip(names, np.array([row for row in rows if row[0] > 0.0]).T, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("free.parquet"))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--pretension", type=float, default=10.0, help="N, mean tendon force at rest")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    write_table(given.output, record(given.seconds, given.pretension, given.seed))
    print(given.output)


if __name__ == "__main__":
    main()
