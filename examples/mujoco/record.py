"""Records free motion of the finger in MuJoCo: python record.py -o free.parquet [--seconds 60] [--pretension 10]."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from tendon_finger import STEP, Array, TendonFinger

from tendonfmu.files import write_table

SETTLE = 1.0  # s before the recording begins
LOWEST, HIGHEST = np.array([-0.25, 0.05]), np.array([1.1, 0.95])  # rad


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
    finger = TendonFinger(pretension, seed)
    finger.data.qpos[:] = 0.3
    rows = []
    for k, angles in enumerate(motion(seconds, seed)):
        finger.pretension = pretension * (1.0 + 0.3 * np.sin(2 * np.pi * 0.07 * k * STEP))
        sample = finger.step(finger.motors_for(angles))
        if sample.time > SETTLE:
            groups = (sample.tendon_force, sample.tendon_position, sample.joint_position, sample.joint_velocity)
            rows.append(np.concatenate([[sample.time - SETTLE], *groups]))
    names = ["time"]
    for group, count in (("tendon_force", 4), ("tendon_position", 4), ("joint_position", 2), ("joint_velocity", 2)):
        names += [f"{group}[{i}]" for i in range(1, count + 1)]
    return dict(zip(names, np.array(rows).T, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("free.parquet"))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--pretension", type=float, default=10.0, help="N")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    write_table(given.output, record(given.seconds, given.pretension, given.seed))
    print(given.output)


if __name__ == "__main__":
    main()
