"""Presses on a moving plate in MuJoCo, with friction compensation and without: figures, and one picture.

    python press.py [finger_calibrated.json] [-o press.html]

After a warm-up of free strokes the finger closes until it feels the wanted force, and holds it: 0.5 N, then 1 N, while
the plate moves by 3 mm. It feels the force by its tendons alone. Three ways are compared: the compensated torque, the
joint torque, and the joint torque less what it was on average while the finger closed freely.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from plotly.subplots import make_subplots
from tendon_finger import HERE, STEP, Array, Runner, TendonFinger, step

HOLD = 8.0  # s, each wanted force
WANTED = (0.5, 1.0)  # N
SETTLED = 3.0  # s after a new force is wanted, from which on errors count
START, CLOSING = np.array([0.25, 0.25]), np.array([1.0, 0.6])  # rad; angles = START + s · CLOSING
STROKE = 0.45  # rad of s, of the warm-up
PLATE, WAVE, WAVES = -0.052, 0.003, 0.4  # m, m, Hz
GAIN, FASTEST = 1.5, 0.3  # rad/s per N, rad/s
PERIOD = np.pi * STROKE / FASTEST  # s, of a stroke forth and back
WARM_UP = 2 * PERIOD  # s
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#8A8A8A"
WAYS = ("compensated torque", "joint torque", "joint torque, offset known")


@dataclass(frozen=True)
class Run:
    """One way to feel the force: series over time."""

    way: str
    time: Array  # [N], s
    wanted: Array  # [N], N
    felt: Array  # [N], N
    true: Array  # [N], N


def without_bias(description: Mapping[str, Any]) -> dict[str, Any]:
    """The description with a bias of 0 that does not learn: it would take what presses for long as friction."""
    nothing = [0.0] * len(description["joints"])
    bias = {**description.get("bias", {}), "initial_torque": nothing}
    return {**description, "bias": bias, "contact": {"threshold": nothing}}  # everything counts as contact


class Feeling:
    """Estimates the plate's force from the tendons' sensors."""

    def __init__(self, way: str, description: Mapping[str, Any]) -> None:
        self.way = way
        self.model = Runner(without_bias(description), kinematics=3)
        self.weight = [row for row in description["extensions"] if row["effect"] == "gravity"]
        self.free: list[float] = []

    def force(self, finger: TendonFinger, presses: bool, closes: bool = False) -> float:
        """Force between fingertip and plate as it is felt [N]."""
        sample = finger.sense()
        outputs = step(self.model, sample)
        if self.way == WAYS[0]:
            torque = outputs.compensated_torque
        else:
            torque = outputs.joint_torque - self.held_weight(sample.joint_position)
        direction = finger.press_direction()
        felt = float(direction @ torque / (direction @ direction))
        if closes:
            self.free.append(felt)
        if self.way == WAYS[2] and presses:
            felt -= self.offset
        return felt

    @cached_property
    def offset(self) -> float:
        """What the finger felt on average while it closed freely [N]."""
        return float(np.mean(self.free))

    def held_weight(self, angles: Array) -> Array:
        """Torques that hold the links [n], by the rows `gravity`."""
        total = np.zeros(len(angles))
        for row in self.weight:
            theta = angles[: row["joint"]].sum()
            total[: row["joint"]] += row.get("sine", 0.0) * np.sin(theta) + row.get("cosine", 0.0) * np.cos(theta)
        return total


def press(way: str, description: Mapping[str, Any], hold: float = HOLD) -> Run:
    """Warm up, then hold the wanted forces on the plate. hold: s, each."""
    finger, feeling = TendonFinger(), Feeling(way, description)
    finger.data.qpos[:] = START
    s, rows = 0.0, []
    for k in range(round((WARM_UP + len(WANTED) * hold) / STEP)):
        t = k * STEP
        if t < WARM_UP:  # strokes at the speed of the later closing; the plate is out of reach
            before, s = s, STROKE * (0.5 - 0.5 * np.cos(2 * np.pi * t / PERIOD))
            wanted, plate = 0.0, PLATE - 0.1
            feeling.force(finger, presses=False, closes=s > before and t > PERIOD)  # the second stroke counts
        else:
            wanted = WANTED[min(int((t - WARM_UP) / hold), len(WANTED) - 1)]
            plate = PLATE + WAVE * np.sin(2 * np.pi * WAVES * t)
            felt = feeling.force(finger, presses=True)
            s += STEP * float(np.clip(GAIN * (wanted - felt), -FASTEST, FASTEST))
            s = min(max(s, -0.3), 0.95)
            rows.append((t, wanted, felt, finger.contact_force()))
        finger.place_plate(plate)
        finger.step(finger.motors_for(START + s * CLOSING))
    return Run(way, *np.array(rows).T)


def figures(run: Run, hold: float = HOLD) -> list[str]:
    """One row of the table: share of the time in touch, mean and rms error of each force."""
    cells = [run.way]
    for number, wanted in enumerate(WANTED):
        begin = WARM_UP + number * hold
        part = (run.time >= begin + min(SETTLED, hold / 2)) & (run.time < begin + hold)
        error = run.true[part] - wanted
        rms = float(np.sqrt(np.mean(error**2)))
        cells.append(f"{error.mean():+.2f}, {rms:.2f} N; touches {100 * np.mean(run.true[part] > 0):.0f} %")
    return cells


def draw(runs: list[Run], target: Path) -> None:
    """True force over time as a page, one panel for each way."""
    figure = make_subplots(
        len(runs),
        1,
        shared_xaxes=True,
        shared_yaxes="all",
        vertical_spacing=0.07,
        subplot_titles=WAYS,
        y_title="force (N)",
    )
    for row, run in enumerate(runs, start=1):
        curves = {"felt": (run.felt, ORANGE), "true force on the plate": (run.true, BLUE), "wanted": (run.wanted, GREY)}
        for name, (force, colour) in curves.items():
            line = {"color": colour, "width": 1.2}
            figure.add_scatter(x=run.time, y=force, name=name, line=line, showlegend=row == 1, row=row, col=1)
    figure.update_xaxes(title="time (s)", row=len(runs))
    figure.update_layout(template="plotly_white", height=620, legend={"orientation": "h"}, margin={"t": 30, "r": 10})
    figure.write_html(target)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("finger", type=Path, nargs="?", default=HERE / "finger_calibrated.json")
    parser.add_argument("-o", "--output", type=Path, metavar="PICTURE.html")
    given = parser.parse_args()
    description = json.loads(given.finger.read_text(encoding="utf-8"))
    runs = [press(way, description) for way in WAYS]
    print("| felt by | " + " | ".join(f"{wanted:g} N wanted: mean error, rms error" for wanted in WANTED) + " |")
    print("| --- |" + " --- |" * len(WANTED))
    for run in runs:
        print("| " + " | ".join(figures(run)) + " |")
    if given.output is not None:
        draw(runs, given.output)
        print(given.output)


if __name__ == "__main__":
    main()
