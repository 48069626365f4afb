"""Draws the figures of a score (`score_figures.py`). It computes nothing: the data come ready-made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator, PercentFormatter

from tendonfmu.drawing import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKY, VERMILION, Target, clean, save
from tendonfmu.report.figure_data import Interval
from tendonfmu.report.score_figures import ContactFigure, DelayFigure, EventFigure, RocFigure

JOINT_COLOURS = (BLUE, VERMILION, GREEN, PURPLE)
LABELLED, PALE = "#F0C27A", "#B4BBC4"
_HEAT = LinearSegmentedColormap.from_list("torque", ["#FFFFFF", "#BBD9EE", SKY, BLUE, "#08306B"]).with_extremes(
    bad=LIGHT
)
Dash = tuple[float, tuple[float, ...]]
MEDIAN: Dash = (0.0, ())
NINETY: Dash = (0.0, (4.0, 3.0))
_TITLE, _LABEL, _LEGEND = 14.0, 12.5, 11.5  # pt


def draw_contacts(data: ContactFigure, target: Target) -> None:
    """Draw joint torques, compensated torques with the reference, sensed force and detection, as PNG (fig. 8)."""
    heights = [1.0, 1.25, *([0.6] if data.force is not None else []), 0.55]
    figure = Figure(figsize=(12.8, 2.9 * sum(heights)), layout="constrained")
    panels = list(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights))
    for axes in panels:
        clean(axes)
        for begin, end in data.labelled:
            axes.axvspan(begin, end, color=LABELLED, alpha=0.3, linewidth=0)
    _draw_torques(panels[0], panels[1], data)
    if data.force is not None:
        panels[2].plot(data.time, data.force, color=DARK, linewidth=1.3)
        panels[2].set_ylabel("sensed\nforce (N)", fontsize=_LABEL)
    _draw_detection(panels[-1], data)
    panels[0].set_title(data.title, loc="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    panels[-1].set_xlim(data.time[0], data.time[-1])
    panels[-1].set_xlabel("time (s)", fontsize=_LABEL)
    figure.align_ylabels(panels)
    save(figure, target, 100)


def _draw_torques(above: Axes, below: Axes, data: ContactFigure) -> None:
    for joint, colour in zip(data.joints, JOINT_COLOURS, strict=False):
        above.plot(data.time, 1e3 * joint.measured, color=colour, linewidth=1.1)
        below.plot(data.time, 1e3 * joint.compensated, color=colour, linewidth=1.1)
        if joint.external is not None:
            below.plot(
                data.time,
                1e3 * joint.external,
                color=colour,
                linewidth=1.6,
                linestyle=(0, (4, 2)),
                alpha=0.7,
                zorder=1.5,
            )
    above.set_ylabel("joint torque\n(mN·m)", fontsize=_LABEL)
    below.set_ylabel("compensated\n(mN·m)", fontsize=_LABEL)
    named = zip(data.joints, JOINT_COLOURS, strict=False)
    _legend(above, [Line2D([], [], color=colour, linewidth=1.8, label=joint.name) for joint, colour in named])
    keys = [Line2D([], [], color=DARK, linewidth=1.3, label="compensated: estimate of the external torque")]
    if any(joint.external is not None for joint in data.joints):
        keys.append(Line2D([], [], color=DARK, linewidth=1.6, linestyle=(0, (4, 2)), label="reference sensor"))
    _legend(below, keys)


def _draw_detection(axes: Axes, data: ContactFigure) -> None:
    bars: tuple[tuple[list[Interval], str, str, float], ...] = (
        (data.labelled, LABELLED, "contact, as labelled", 1.0),
        (data.found, BLUE, "alarm, event found", 0.0),
        (data.masked, GREY, "alarm, event missed", 0.0),
        (data.outside, VERMILION, "alarm without contact", 0.0),
    )
    shown = [bar for bar in bars if bar[0]]
    for spans, colour, _, height in shown:
        axes.broken_barh([(begin, end - begin) for begin, end in spans], (height, 0.8), color=colour)
    axes.set_yticks([0.4, 1.4], ["alarm", "label"])
    axes.set_ylim(-0.15, 2.0)
    axes.grid(visible=False)
    axes.set_ylabel("detection", fontsize=_LABEL)
    _legend(axes, [Patch(color=colour, label=meaning) for _, colour, meaning, _ in shown])


def _legend(axes: Axes, handles: Sequence[Artist]) -> None:
    """Place the legend above the panel on the right, clear of the curves."""
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(handles),
        frameon=False,
        fontsize=_LEGEND,
        borderaxespad=0.0,
        borderpad=0.15,
        handletextpad=0.5,
        columnspacing=1.4,
    )


def draw_events(data: EventFigure, target: Target) -> None:
    """Draw each event as a row of colour from before its onset, with its alarm and its end marked, as PNG."""
    count = len(data.torque)
    figure = Figure(figsize=(12.8, min(max(3.6, 1.8 + 0.3 * count), 12.0)), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(
        1e3 * data.torque,
        aspect="auto",
        interpolation="nearest",
        cmap=_HEAT,
        vmin=0.0,
        vmax=1e3 * data.most,
        extent=(data.begin, data.end, count - 0.5, -0.5),
    )
    rows, half = np.arange(count), 0.36
    axes.axvline(0.0, color=DARK, linewidth=1.2)
    inside = data.length < data.end
    axes.vlines(data.length[inside], rows[inside] - half, rows[inside] + half, color=DARK, linewidth=1.6)
    axes.vlines(data.delay, rows - half, rows + half, color=VERMILION, linewidth=2.6)
    begin, middles = 0, []
    for _, rows_of_group in data.groups:
        middles.append(begin + 0.5 * (rows_of_group - 1))
        begin += rows_of_group
        if begin < count:
            axes.axhline(begin - 0.5, color=DARK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.set_yticks(middles, [f"{number} {name}" for name, number in data.groups], fontsize=_LABEL)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=12)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("time from the onset (s)", fontsize=_LABEL)
    axes.set_title(data.title, loc="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    _legend_of_events(axes)
    bar = figure.colorbar(image, ax=axes, pad=0.01, fraction=0.03, extend="max")
    bar.set_label("compensated torque,\nall joints (mN·m)", fontsize=_LABEL)
    bar.outline.set_visible(False)
    save(figure, target, 100)


def _legend_of_events(axes: Axes) -> None:
    keys = (("onset", DARK, 1.2), ("first alarm", VERMILION, 2.6), ("end of the event", DARK, 1.6))
    handles = [
        Line2D(
            [],
            [],
            color=colour,
            linewidth=width,
            label=label,
            linestyle="",
            marker="|",
            markersize=13,
            markeredgewidth=width,
        )
        for label, colour, width in keys[1:]
    ]
    _legend(axes, handles)


def draw_roc(data: RocFigure, target: Target) -> None:
    """Draw found events against false alarms per hour, and both over the factor on the thresholds, as PNG."""
    figure = Figure(figsize=(12.8, 5.4), layout="constrained")
    curve, over = figure.subplots(1, 2, width_ratios=[1.25, 1.0])
    for axes in (curve, over):
        clean(axes)
        axes.set_ylim(-0.03, 1.03)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    _draw_points(curve, data)
    over.plot(data.factors, data.found, color=BLUE, linewidth=1.8, marker="o", markersize=4, label="events found")
    over.fill_between(data.factors, data.found_low, data.found_high, color=BLUE, alpha=0.15, linewidth=0)
    over.plot(
        data.factors,
        data.in_alarm,
        color=VERMILION,
        linewidth=1.8,
        marker="o",
        markersize=4,
        label="free time in alarm",
    )
    over.plot(
        data.factors, data.masked, color=GREY, linewidth=1.4, linestyle=(0, (4, 2)), label="missed: in alarm before"
    )
    over.axvline(1.0, color=GREY, linewidth=1.0, linestyle=(0, (3, 3)))
    over.set_xscale("log", base=2)
    over.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    over.xaxis.set_minor_locator(NullLocator())
    over.set_xlabel("factor on all thresholds", fontsize=_LABEL)
    over.set_ylabel("share", fontsize=_LABEL)
    _legend(over, over.get_legend_handles_labels()[0])
    figure.suptitle(data.title, x=0.01, ha="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    save(figure, target, 100)


def _draw_points(axes: Axes, data: RocFigure) -> None:
    axes.errorbar(
        data.rate,
        data.found,
        xerr=[data.rate - data.rate_low, data.rate_high - data.rate],
        yerr=[data.found - data.found_low, data.found_high - data.found],
        fmt="none",
        ecolor=PALE,
        elinewidth=1.2,
    )
    axes.plot(data.rate, data.found, color=SKY, linewidth=1.0)
    axes.plot(data.rate, data.found, "o", color=BLUE, markersize=6)
    own = data.own
    axes.plot(data.rate[own], data.found[own], "o", color=VERMILION, markersize=9, label="the description's thresholds")
    for k in data.named:
        at = (data.rate[k], data.found[k])
        axes.annotate(f"×{data.factors[k]:g}", at, (7, 5), textcoords="offset points", fontsize=10, color=DARK)
    axes.set_xscale("symlog", linthresh=data.least)
    axes.set_xlim(-0.15 * data.least, 2.0 * max(data.rate_high.max(), data.least))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("false alarms per hour of free time", fontsize=_LABEL)
    axes.set_ylabel("events found", fontsize=_LABEL)
    _legend(axes, axes.get_legend_handles_labels()[0])


def draw_delays(data: DelayFigure, target: Target) -> None:
    """Draw the share of all events found within a time, with its interval, and the number of delays, as PNG."""
    figure = Figure(figsize=(12.8, 6.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    for axes in (above, below):
        clean(axes)
        for value, style in ((data.median, MEDIAN), (data.ninety, NINETY)):
            axes.axvline(1e3 * value, color=VERMILION, linewidth=1.3, linestyle=style)
    delays = 1e3 * data.delays
    above.fill_between(
        delays, data.low, data.high, step="post", color=BLUE, alpha=0.18, linewidth=0, label="95 % interval"
    )
    above.step([0.0, *delays], [0.0, *data.share], where="post", color=BLUE, linewidth=2.0, label="found so far")
    above.set_ylim(0.0, min(1.0, 1.3 * data.high.max()))
    above.yaxis.set_major_formatter(PercentFormatter(1.0))
    above.set_ylabel("share of all events", fontsize=_LABEL)
    handles = above.get_legend_handles_labels()[0]
    for value, style, name in ((data.median, MEDIAN, "median"), (data.ninety, NINETY, "90 % within")):
        label = f"{name} {1e3 * value:.0f} ms"
        handles.append(Line2D([], [], color=VERMILION, linewidth=1.3, linestyle=style, label=label))
    _legend(above, handles)
    above.set_title(data.title, loc="left", fontsize=_TITLE, fontweight="bold", color=DARK)
    if data.later:
        said = f"{data.later} later, up to {delays[-1]:.0f} ms →"
        above.text(0.995, 0.04, said, ha="right", fontsize=_LEGEND, color=DARK, transform=above.transAxes)
    below.hist(delays, bins=data.bins, range=(0.0, 1e3 * data.end), color=ORANGE, edgecolor="white")
    below.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=4))
    below.set_ylabel("events", fontsize=_LABEL)
    below.set_xlabel("delay from the onset (ms)", fontsize=_LABEL)
    below.set_xlim(0.0, 1.03e3 * max(data.end, 1e-3))
    save(figure, target, 100)
