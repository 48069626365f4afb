"""Draws the figures of a tuning (`tune_figures.py`). It computes nothing: the data come ready-made."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

from tendonfmu.drawing import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, VERMILION, Target, clean, save
from tendonfmu.report.tune_figures import BoundFigure, TailFigure, WorstFigure

_TITLE, _LABEL, _LEGEND = 14.0, 12.5, 11.5  # pt
_OTHERS = {"residual": ("threshold of the residual", (4, 2)), "drift": ("threshold of slow loads", (1, 1.5))}


def draw_tail(data: TailFigure, target: Target) -> None:
    """Draw false alarms per hour over the factor on the bounds, in sample and held out, as PNG."""
    figure = Figure(figsize=(10.4, 5.8), layout="constrained")
    axes = figure.subplots()
    clean(axes)
    axes.fill_between(
        data.factors, data.low, data.high, step="post", color=BLUE, alpha=0.15, linewidth=0, label="95 % interval"
    )
    axes.step(
        data.factors, data.held_out, where="post", color=BLUE, linewidth=2.0, label="held out: bounds of other blocks"
    )
    axes.step(
        data.factors, data.in_sample, where="post", color=ORANGE, linewidth=1.6, label="in sample: of the same blocks"
    )
    axes.axhline(data.wished, color=VERMILION, linewidth=1.3, linestyle=(0, (4, 3)))
    axes.text(
        float(data.factors[-1]),
        data.wished,
        f"tuned for {data.wished:.3g} per hour",
        ha="right",
        va="bottom",
        color=VERMILION,
        fontsize=_LEGEND,
    )
    axes.axvline(1.0, color=DARK, linewidth=1.0, linestyle=(0, (2, 2)))
    axes.plot(
        1.0,
        data.limit,
        "v",
        color=DARK,
        markersize=9,
        label=f"chosen level: at most {data.limit:.3g} per hour ({100 * data.confidence:g} %)",
    )
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yscale("symlog", linthresh=data.least)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(data.factors[0], data.factors[-1])
    axes.set_xlabel("factor on the chosen thresholds", fontsize=_LABEL)
    axes.set_ylabel("false alarms per hour", fontsize=_LABEL)
    axes.legend(loc="upper right", frameon=False, fontsize=_LEGEND)
    axes.set_title(data.title, loc="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    save(figure, target, 100)


def draw_bounds(data: BoundFigure, target: Target) -> None:
    """Draw the bounds over the mean force by joint, as PNG."""
    figure = Figure(figsize=(12.8, 7.4), layout="constrained")
    grid = figure.subplots(2, 2, squeeze=False)
    panels = [axes for row in grid for axes in row]
    for axes in panels[len(data.panels) :]:
        axes.set_axis_off()
    for axes, panel in zip(panels, data.panels, strict=False):
        clean(axes)
        axes.plot(panel.force, 1e3 * panel.own, color=BLUE, linewidth=2.0, label=f"threshold of the {data.signal}")
        axes.plot(panel.at, 1e3 * panel.friction, "s", color=GREEN, markersize=8, label="with H and J, on average")
        axes.plot(
            panel.at,
            1e3 * panel.points,
            "o",
            color=VERMILION,
            markersize=8,
            label="the joint alone, at the wished rate",
        )
        axes.plot(panel.at, 1e3 * panel.rms, "x", color=DARK, markersize=8, label="rms of the residual")
        for name, values in panel.others.items():
            label, dashes = _OTHERS[name]
            axes.plot(panel.force, 1e3 * values, color=GREY, linewidth=1.5, linestyle=(0, dashes), label=label)
        axes.set_title(panel.joint, loc="left", fontsize=_LABEL, color=DARK)
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("mean tendon force (N)", fontsize=_LABEL)
        axes.set_ylabel("torque (mN·m)", fontsize=_LABEL)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=_LEGEND)
    figure.suptitle(data.title, x=0.01, ha="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    save(figure, target, 100)


def draw_worst(data: WorstFigure, target: Target) -> None:
    """Draw signal and bound around the moments nearest to an alarm, as PNG."""
    figure = Figure(figsize=(12.8, 7.4), layout="constrained")
    grid = figure.subplots(2, 2, squeeze=False)
    panels = [axes for row in grid for axes in row]
    for axes in panels[len(data.moments) :]:
        axes.set_axis_off()
    for axes, moment in zip(panels, data.moments, strict=False):
        clean(axes)
        axes.fill_between(
            moment.time,
            -1e3 * moment.bound,
            1e3 * moment.bound,
            color=LIGHT,
            linewidth=0,
            label="bound with H and J",
        )
        axes.fill_between(
            moment.time,
            -1e3 * moment.own,
            1e3 * moment.own,
            color="#BBD9EE",
            linewidth=0,
            label="threshold alone",
        )
        axes.plot(moment.time, 1e3 * moment.signal, color=VERMILION, linewidth=1.4, label=data.signal)
        axes.set_title(moment.title, loc="left", fontsize=_LABEL, color=DARK)
        axes.set_xlim(moment.time[0], moment.time[-1])
        axes.set_xlabel("time from the peak (s)", fontsize=_LABEL)
        axes.set_ylabel("torque (mN·m)", fontsize=_LABEL)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=_LEGEND)
    figure.suptitle(data.title, x=0.01, ha="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    save(figure, target, 100)
