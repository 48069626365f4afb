"""Make `index_finger_demo.parquet`: the demo finger moved, pushed and measured. See README.md.

Usage: python make_recording.py [-o index_finger_demo.parquet] [--seed 7]
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import motion
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from finger_plant import FingerPlant
from numpy.typing import NDArray

Array = NDArray[np.float64]

HERE = Path(__file__).parent
DURATION, RATE, SUBSTEPS = 60.0, 500, 2
PRETENSION = 10.0  # N, mean over the tendons
SETTLE = 3.0  # s before the recording: the finger comes to rest with its bristles as friction left them
PUSHES, FIRST_PUSH = 11, 9.0
CONTACT_FORCE = 0.05  # N, from which the label says contact

# standard deviation of the noise and smallest step of each sensor, in the column's unit
SENSORS = {
    "tendon_force": (0.003, 0.002),
    "tendon_position": (0.0, 2e-6),  # encoder on the spool
    "joint_position": (2e-4, 2e-4),
    "external_torque": (3e-4, 2e-4),
}


def simulate(seed: int) -> dict[str, Array]:
    """True signals, one row per sample: time and the columns of SENSORS, and contact (samples,)."""
    rng = np.random.default_rng(seed)
    finger = json.loads((HERE.parent / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    arms = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
    plant = FingerPlant(arms, stiffness, rng)

    samples = int(DURATION * RATE)
    dt = 1.0 / (RATE * SUBSTEPS)
    fine: Array = dt * np.arange((samples - 1) * SUBSTEPS + 1, dtype=np.float64)
    wanted = motion.joint_motion(fine, rng, still=1.0)
    force = motion.pushes(fine, rng, PUSHES, FIRST_PUSH)

    # pretension: the forces nearest to equal ones that turn no joint, R^T p = 0
    equal = np.ones(len(arms))
    pretension = equal - arms @ np.linalg.solve(arms.T @ arms, arms.T @ equal)
    pretension *= PRETENSION / pretension.mean()
    motors = wanted @ arms.T + pretension / stiffness

    # come to the first posture from aside, so that it starts with friction as after a motion
    for t in np.arange(0.0, SETTLE, dt):
        aside = 0.15 * max(0.0, 1.0 - t / (0.6 * SETTLE)) * arms.sum(axis=1)
        plant.advance(motors[0] + aside, np.zeros(4), dt)

    true = {"tendon_position": motors[::SUBSTEPS]}
    for name, size in (("tendon_force", 8), ("joint_position", 4), ("external_torque", 4)):
        true[name] = np.empty((samples, size))
    for k in range(len(fine)):
        load = motion.load_of_push(plant.angle, force[k])
        if k > 0:
            plant.advance(motors[k], load, dt)
        if k % SUBSTEPS == 0:
            row = k // SUBSTEPS
            true["tendon_force"][row] = plant.tendon_force(motors[k])
            true["joint_position"][row] = plant.angle
            true["external_torque"][row] = load
    true["time"] = np.arange(samples) / RATE
    true["contact"] = (np.linalg.norm(force[::SUBSTEPS], axis=1) > CONTACT_FORCE).astype(float)
    return true


def measure(true: dict[str, Array], seed: int) -> pa.Table:
    """The recording: sensors add white noise and round to their step."""
    rng = np.random.default_rng([seed, 1])
    columns: dict[str, pa.Array] = {"time": pa.array(np.round(true["time"], 6))}
    for name, (noise, step) in SENSORS.items():
        signal = true[name] + noise * rng.standard_normal(true[name].shape)
        # decimal rounding last, so that a value reads 1.234 and not 1.2340000000000002
        decimals = max(0, int(np.ceil(-np.log10(step))))
        signal = np.round(np.round(signal / step) * step, decimals)
        for k in range(signal.shape[1]):
            columns[f"{name}[{k + 1}]"] = pa.array(signal[:, k] + 0.0)
    columns["contact"] = pa.array(true["contact"].astype(np.int8))
    return pa.table(columns)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=HERE / "index_finger_demo.parquet")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    table = measure(simulate(arguments.seed), arguments.seed)
    unfinished = arguments.output.with_suffix(".part")
    pq.write_table(table, unfinished, compression="zstd", compression_level=19)
    os.replace(unfinished, arguments.output)


if __name__ == "__main__":
    main()
