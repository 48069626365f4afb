"""Writes the log of a servo, moved by MuJoCo, as its software would: python servo_log.py -o servo.csv [--seconds 60].

Time stamps in ms, angles in degrees with the encoder's zero elsewhere, torque in N·cm, names of its own, a column of
text, and steps of encoder and torque. The servo's friction is that of servo.xml.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import mujoco
import numpy as np

from tendonfmu.files import whole_file

HERE = Path(__file__).resolve().parent
RATE = 200  # rows per second
STIFFNESS, DAMPING = 25.0, 0.45  # of the controller: N·m/rad, N·m·s/rad
MOUNTED = 150.0  # degrees that the encoder reads at angle 0
ANGLE_STEP, TORQUE_STEP, TORQUE_NOISE = 360.0 / 16384, 0.1, 0.3  # degrees, N·cm, N·cm
STARTED = 1_726_400  # ms since the servo was switched on


def strokes(seconds: float, step: float, random: np.random.Generator) -> np.ndarray:
    """[N] wanted angles in rad: smooth strokes of 0.4 to 2 s to random angles, with short rests."""
    parts, at = [np.zeros(round(0.5 / step))], 0.0
    while sum(map(len, parts)) * step < seconds:
        target = random.uniform(-1.2, 1.2)
        s = np.linspace(0.0, 1.0, round(random.uniform(0.4, 2.0) / step))
        parts.append(at + (target - at) * s**3 * (10 - 15 * s + 6 * s**2))
        parts.append(np.full(round(random.choice([0.0, 0.0, 0.3]) / step), target))
        at = target
    return np.concatenate(parts)[: round(seconds / step)]


def rows(seconds: float, seed: int) -> list[list[str]]:
    """Rows of the log: time stamp, state, set point, position, load, temperature."""
    model = mujoco.MjModel.from_xml_path(str(HERE / "servo.xml"))
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    step = model.opt.timestep
    wanted = strokes(seconds, step, random)
    speed = np.gradient(wanted, step)
    every, found = round(1.0 / (RATE * step)), []
    for k in range(len(wanted)):
        angle, velocity = float(data.qpos[0]), float(data.qvel[0])
        torque = STIFFNESS * (wanted[k] - angle) + DAMPING * (speed[k] - velocity)
        data.ctrl[0] = np.clip(torque, -3.0, 3.0)
        if k % every == 0:
            position = round((np.degrees(angle) + MOUNTED) / ANGLE_STEP) * ANGLE_STEP
            load = round((100.0 * data.ctrl[0] + random.normal(0.0, TORQUE_NOISE)) / TORQUE_STEP) * TORQUE_STEP
            found.append(
                [
                    f"{STARTED + 1e3 * k * step:.1f}",
                    "OP_ENABLED",
                    f"{np.degrees(wanted[k]) + MOUNTED:.2f}",
                    f"{position:.3f}",
                    f"{load:.1f}",
                    f"{31 + 4 * k / len(wanted):.0f}",
                ]
            )
        mujoco.mj_step(model, data)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("servo.csv"))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    names = ["Timestamp (ms)", "State", "Setpoint (deg)", "Position (deg)", "Load (N.cm)", "Temp (C)"]
    with whole_file(given.output) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, delimiter=";", lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows(given.seconds, given.seed))
    print(given.output)


if __name__ == "__main__":
    main()
