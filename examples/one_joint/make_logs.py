"""Logs of a geared servo as its own software would write them: week 1, week 3 as it was, week 5 with worn bearings.

    python make_logs.py -o logs

Needs numpy alone; nothing of tendonfmu made them. The servo follows strokes between random angles under a PD
controller. Its friction is Coulomb's with a Stribeck effect, presliding, a viscous part and a ripple once a turn of the
gear: the description that `convert table` writes knows the first and the third of these. In week 5 the Coulomb friction
is 20 % higher. Every week makes other strokes.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Series = NDArray[np.float64]

DURATION, RATE, SUBSTEPS = 60.0, 500, 10  # s, rows per second, steps of the simulation per row
INERTIA, VISCOUS, OFFSET = 0.004, 0.05, 0.010  # kg.m2, N.m.s/rad, N.m; behind the gear
COULOMB, STATIC, STRIBECK = 0.150, 0.165, 0.05  # N.m, N.m, rad/s
PRESLIDING = 5e-4  # rad
RIPPLE, GEAR = 0.006, 12.0  # N.m, waves a turn of the joint
STIFFNESS, DAMPING = 25.0, 0.45  # of the controller: N.m/rad, N.m.s/rad
TORQUE_NOISE, TORQUE_STEP = 0.003, 0.001  # N.m
ANGLE_STEP = 360.0 / 65536  # degrees
MOUNTED = 180.0  # degrees; what the encoder, which counts the other way, reads at angle 0


@dataclass(frozen=True)
class Week:
    """One log: its name, the factor on the Coulomb and static friction, and the seed of its strokes and noise."""

    name: str
    friction: float
    seed: int


WEEKS = (Week("week_1", 1.0, 1), Week("week_3", 1.0, 3), Week("week_5", 1.2, 5))


def strokes(random: np.random.Generator) -> tuple[Series, Series]:
    """[N] wanted angle in rad and speed in rad/s, at RATE: minimum-jerk strokes of 0.4 to 2 s, with rests."""
    angle, at = [np.zeros(RATE // 2)], 0.0
    while sum(map(len, angle)) < DURATION * RATE:
        target = random.uniform(-1.2, 1.2)
        s = np.linspace(0.0, 1.0, round(random.uniform(0.4, 2.0) * RATE))
        angle.append(at + (target - at) * s**3 * (10 - 15 * s + 6 * s**2))
        angle.append(np.full(int(random.choice([0.0, 0.0, 0.3]) * RATE), target))
        at = target
    wanted = np.concatenate(angle)[: round(DURATION * RATE)]
    return wanted, np.gradient(wanted, 1.0 / RATE)


def simulate(week: Week, wanted: Series, speed: Series) -> tuple[Series, Series]:
    """[N] angle in rad and torque of the drive in N.m."""
    step = 1.0 / (RATE * SUBSTEPS)
    angle, velocity, bristle = 0.0, 0.0, 0.0  # bristle: -1 to 1, how far the contact has given way
    angles, torques = np.empty_like(wanted), np.empty_like(wanted)
    for k in range(len(wanted)):
        torque = STIFFNESS * (wanted[k] - angle) + DAMPING * (speed[k] - velocity) + VISCOUS * speed[k]
        angles[k], torques[k] = angle, torque
        for _ in range(SUBSTEPS):
            bristle += step * (velocity - abs(velocity) * bristle) / PRESLIDING
            bristle = min(max(bristle, -1.0), 1.0)
            dry = week.friction * (COULOMB + (STATIC - COULOMB) * math.exp(-abs(velocity) / STRIBECK))
            resisted = dry * bristle + VISCOUS * velocity + OFFSET + RIPPLE * math.sin(GEAR * angle)
            velocity += step * (torque - resisted) / INERTIA
            angle += step * velocity
    return angles, torques


def write_log(week: Week, folder: Path) -> Path:
    """The log of a week, in the units of the servo's software."""
    random = np.random.default_rng(week.seed)
    angle, torque = simulate(week, *strokes(random))
    time = np.arange(len(angle)) / RATE + random.uniform(0.0, 1e-4, len(angle))
    reading = np.round((MOUNTED - np.degrees(angle)) / ANGLE_STEP) * ANGLE_STEP
    measured = np.round((torque + random.normal(0.0, TORQUE_NOISE, len(torque))) / TORQUE_STEP) * TORQUE_STEP
    file = folder / f"{week.name}.csv"
    with open(file, "w", encoding="utf-8", newline="\n") as out:
        out.write("t [ms];state;encoder [deg];torque [mN.m]\n")
        for row in zip(1e3 * time, reading, 1e3 * measured, strict=True):
            out.write("{:.3f};RUN;{:.4f};{:.0f}\n".format(*row))
    return file


def main() -> None:
    parser = argparse.ArgumentParser(description="Logs of a geared servo in three weeks.")
    parser.add_argument("-o", "--output", type=Path, default=Path("."), metavar="DIR", help="folder for the logs")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for week in WEEKS:
        print(write_log(week, folder))


if __name__ == "__main__":
    main()
