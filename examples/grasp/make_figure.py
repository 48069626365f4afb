"""Draws grasp.png: the grasp of grasp.py with compensation and without.

python make_figure.py TendonFinger.fmu friction.fmu [-o grasp.png]
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from controller import Array, Task
from grasp import run
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonfmu.plot_style import BLUE, DARK, GREEN, GREY, VERMILION, clean, save

Table = Mapping[str, Array]
JOINT = 2  # mcp_flexion
BEFORE, AFTER = 0.05, 0.25  # s, about the touch
WITH, WITHOUT = "with compensation", "joint torque alone"


def draw_force(axes: Axes, tables: Mapping[str, Table]) -> None:
    for (name, table), colour in zip(tables.items(), (BLUE, VERMILION), strict=True):
        axes.plot(table["time"], table["force"], color=colour, linewidth=1.4, label=f"true force, {name}")
    axes.plot(tables[WITH]["time"], tables[WITH]["wanted"], color=DARK, linewidth=1.2, linestyle="--", label="wanted")
    axes.set_ylabel("contact force (N)", fontsize=12)


def draw_torque(axes: Axes, table: Table) -> None:
    for name, label, colour in (
        ("joint_torque", "joint torque", GREY),
        ("truth.external_torque", "true external torque", GREEN),
        ("compensated_torque", "compensated torque", BLUE),
    ):
        axes.plot(table["time"], 1e3 * table[f"{name}[{JOINT}]"], color=colour, linewidth=1.2, label=label)
    axes.set_ylabel("mcp_flexion (mN·m)", fontsize=12)
    axes.set_xlabel("time (s)", fontsize=12)


def draw(tables: Mapping[str, Table], stopped: Mapping[str, float], touched: float, target: Path) -> None:
    figure = Figure(figsize=(13, 7.2), layout="constrained")
    grid = figure.subplots(2, 2, sharex="col", gridspec_kw={"width_ratios": [3, 1]})
    for force, torque in grid.T:
        draw_force(force, tables)
        draw_torque(torque, tables[WITH])
        for axes in (force, torque):
            clean(axes)
    near = grid[0, 1]
    near.set_xlim(touched - BEFORE, touched + AFTER)
    for (name, time), colour in zip(stopped.items(), (BLUE, VERMILION), strict=True):
        near.axvline(time, color=colour, linewidth=1.0, linestyle=":")
        near.annotate(
            f" stop,\n {name}", (time, 0.0), xytext=(0, 2), textcoords="offset points", color=colour, fontsize=9
        )
    table = tables[WITH]
    shown = np.abs(table["time"] - touched - (AFTER - BEFORE) / 2) < (AFTER + BEFORE) / 2
    near.set_ylim(
        0.0,
        1.1 * max(float(each["force"][: len(shown)][shown[: len(each["force"])]].max()) for each in tables.values()),
    )
    for axes in grid[:, 0]:
        axes.legend(loc="upper left", fontsize=10, frameon=False)
        axes.set_xlim(0.0, table["time"][-1])
    grid[0, 0].set_title(
        "closes, pauses, opens, closes; stops at the contact; holds a force while the plate moves by 3 mm",
        fontsize=12,
        loc="left",
    )
    near.set_title("first contact", fontsize=12, loc="left")
    save(figure, target, 110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("hand", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("grasp.png"))
    given = parser.parse_args()
    runs = {name: run(given.hand, given.model, Task(compensated=name == WITH)) for name in (WITH, WITHOUT)}
    table = runs[WITH][0]
    touched = float(table["time"][table["force"] > 0.0][0])
    draw(
        {name: table for name, (table, _) in runs.items()},
        {name: loop.stopped_at for name, (_, loop) in runs.items()},
        touched,
        given.output,
    )


if __name__ == "__main__":
    main()
