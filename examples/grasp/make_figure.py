"""Draws docs/figures/grasp.png: the grasp of grasp.py with compensation and without.

python make_figure.py TendonFinger.fmu friction.fmu [-o FIGURE.png]
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from controller import Array, Task
from grasp import run
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonfmu.drawing.panel import BLUE, DARK, GREEN, GREY, VERMILION
from tendonfmu.drawing.png import clean, save

FIGURE = Path(__file__).resolve().parents[2] / "docs" / "figures" / "grasp.png"
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


def draw_contact(axes: Axes, tables: Mapping[str, Table], stopped: Mapping[str, float]) -> None:
    """The force about the touch, a dot where each way stops."""
    draw_force(axes, tables)
    touched = float(tables[WITH]["time"][tables[WITH]["force"] > 0.0][0])
    dots, highest = [], 0.0
    for (name, table), colour in zip(tables.items(), (BLUE, VERMILION), strict=True):
        stop = table["force"][table["time"] <= stopped[name]][-1]
        dots += axes.plot(stopped[name], stop, "o", color=colour, markersize=7, label=f"stop, {name}")
        highest = max(highest, float(table["force"][table["time"] < touched + AFTER].max()))
    axes.set_xlim(touched - BEFORE, touched + AFTER)
    axes.set_ylim(0.0, 1.1 * highest)
    axes.legend(handles=dots, loc="lower right", fontsize=9, frameon=False)
    axes.set_title("first contact", fontsize=12, loc="left")


def draw(tables: Mapping[str, Table], stopped: Mapping[str, float], target: Path) -> None:
    figure = Figure(figsize=(13, 7.2), layout="constrained")
    ((force, contact), torques) = figure.subplots(2, 2, sharex="col", gridspec_kw={"width_ratios": [3, 1]})
    draw_force(force, tables)
    draw_contact(contact, tables, stopped)
    for torque in torques:
        draw_torque(torque, tables[WITH])
    for axes in (force, contact, *torques):
        clean(axes)
    for axes in (force, torques[0]):
        axes.legend(loc="upper left", fontsize=10, frameon=False)
        axes.set_xlim(0.0, tables[WITH]["time"][-1])
    title = "closes, pauses, opens, closes; stops at the contact; holds a force while the plate moves by ±3 mm"
    force.set_title(title, fontsize=12, loc="left")
    save(figure, target, 110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("hand", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=FIGURE)
    given = parser.parse_args()
    runs = {name: run(given.hand, given.model, Task(compensated=name == WITH)) for name in (WITH, WITHOUT)}
    tables = {name: table for name, (table, _) in runs.items()}
    draw(tables, {name: loop.stopped_at for name, (_, loop) in runs.items()}, given.output)


if __name__ == "__main__":
    main()
