"""Draws compensated torques against those of a reference sensor, for compare.py."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonfmu.arrays import Array
from tendonfmu.drawing.panel import BLUE, DARK, GREEN, GREY, LIGHT, VERMILION
from tendonfmu.drawing.png import Target, clean, save


@dataclass(frozen=True)
class ReferenceCurves:
    """One joint of a recording against its reference sensor."""

    title: str  # name of the recording
    time: Array
    measured: Array  #
    compensated: Array
    external: Array


@dataclass(frozen=True)
class ReferenceFigure:
    """Recordings against their reference sensor."""

    title: str  # heading
    drawn: list[ReferenceCurves]  # the recordings whose curves are drawn
    names: list[str]
    error: Array  # rms error of each, with and without the friction model
    error_without: Array
    limit: float


def draw_reference(data: ReferenceFigure, target: Target) -> None:
    """Draw the compensated torque and the reference sensor's for some recordings, and all rms errors, as PNG."""
    rows = len(data.drawn)
    figure = Figure(figsize=(15.0, 2.9 * rows + 0.8), layout="constrained")
    grid = figure.add_gridspec(rows, 2, width_ratios=[2.3, 1.0])
    panels = [figure.add_subplot(grid[row, 0]) for row in range(rows)]
    for axes, curves in zip(panels, data.drawn, strict=True):
        _draw_against_sensor(axes, curves)
    panels[-1].set_xlabel("time (s)")
    figure.legend(handles=panels[0].get_lines(), loc="outside lower left", ncols=3, frameon=False, fontsize=11)
    _draw_errors(figure.add_subplot(grid[:, 1]), data)
    figure.suptitle(data.title, fontsize=15, color=DARK)
    figure.align_ylabels(panels)
    save(figure, target, 100)


def _draw_against_sensor(axes: Axes, curves: ReferenceCurves) -> None:
    clean(axes)
    axes.plot(curves.time, curves.measured, color=GREY, linewidth=0.9, label="measured torque, friction included")
    axes.plot(curves.time, curves.external, color=GREEN, linewidth=2.2, alpha=0.75, label="external torque (sensor)")
    axes.plot(curves.time, curves.compensated, color=BLUE, linewidth=1.1, label="compensated torque")
    axes.set_xlim(curves.time[0], curves.time[-1])
    axes.set_ylabel("torque (N·m)")
    axes.set_title(curves.title, loc="left", fontsize=12.5, fontweight="bold", color=DARK)


def _draw_errors(axes: Axes, data: ReferenceFigure) -> None:
    clean(axes)
    for errors, shift, colour, label in (
        (data.error_without, -0.2, LIGHT, "without a friction model"),
        (data.error, 0.2, BLUE, "compensated"),
    ):
        places = [row + shift for row in range(len(errors))]
        axes.bar(places, errors, width=0.38, color=colour, label=label)
        for place, error in zip(places, errors, strict=True):
            axes.text(place, error, f"{1e3 * error:.0f}", ha="center", va="bottom", fontsize=8, color=DARK)
    axes.axhline(data.limit, color=VERMILION, linestyle="--", linewidth=1.1, label=f"limit {data.limit:g} N·m")
    axes.set_xticks(range(len(data.names)), data.names)
    axes.set_xlabel("recording")
    axes.set_ylabel("rms error (N·m; figures in mN·m)")
    axes.legend(loc="upper left", frameon=False, fontsize=11)
