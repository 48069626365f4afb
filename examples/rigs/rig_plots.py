"""Draws the figures of make_figures.py. It computes nothing: the data come ready-made."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch
from plant_figures import LoopFigure, PreslidingFigure, TruthFigure
from rig_drawing import DrawnBody, DrawnRoute, RigDrawing, View

from tendonfmu.drawing.finger_picture import EDGE_RED
from tendonfmu.drawing.panel import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKIN, SKY, VERMILION
from tendonfmu.drawing.png import Target, clean, save
from tendonfmu.model.routing_geometry import Points

FLEXOR_COLOURS = (BLUE, SKY, "#332288", GREEN)
EXTENSOR_COLOURS = (ORANGE, VERMILION, PURPLE, "#8A5A00")
VIEW_HEIGHT = 21.0  # mm, from the middle of a view to the next view
SMALL_SHOWN = (-14.0, 62.0)  # mrad


def draw_rig(drawing: RigDrawing, target: Target) -> None:
    """Draw the finger of a rig to scale from the side and from above, as PNG: links, tendons, where friction acts."""
    labels = 28.0  # mm, for names on the left
    left, right = drawing.left - labels, drawing.right + 4.0
    low, high = -VIEW_HEIGHT - 26.0, 17.0
    figure = Figure(figsize=(16.0, 16.0 * (high - low) / (right - left)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    for view, middle in ((drawing.side, 0.0), (drawing.top, -VIEW_HEIGHT - 8.0)):
        for body in drawing.bodies:
            _draw_body(axes, body, middle)
        for route in view.routes:
            _draw_route(axes, route, middle, drawing.left)
        _draw_view_joints(axes, view, middle)
        axes.text(left + 1.0, middle + 12.5, f"{drawing.name} {view.title}", fontsize=14, fontweight="bold", color=DARK)
    for label, x in drawing.side.stations:
        axes.text(x, -12.6, label, ha="center", va="center", fontsize=10.5, color=DARK)
        axes.plot([x, x], [-11.7, -10.9], color=GREY, linewidth=0.8)
    for body in drawing.bodies:
        _draw_length(axes, body, 15.0)
    _draw_rig_legend(axes)
    save(figure, target, 100)


def _draw_body(axes: Axes, body: DrawnBody, middle: float) -> None:
    box = FancyBboxPatch(
        (body.begin, middle - body.radius),
        body.end - body.begin,
        2.0 * body.radius,
        boxstyle="round,pad=0,rounding_size=2.5",
        facecolor=SKIN,
        edgecolor=LIGHT,
        linewidth=1.2,
        zorder=0.5,
    )
    axes.add_patch(box)


def _draw_route(axes: Axes, route: DrawnRoute, middle: float, left: float) -> None:
    colours = FLEXOR_COLOURS if route.flexor else EXTENSOR_COLOURS
    colour = colours[route.colour % len(colours)]

    def at(points: Points) -> tuple[Points, Points]:
        return points[:, 0], points[:, 1] + middle

    axes.plot(*at(route.spring), color=colour, linewidth=1.2, zorder=4)
    axes.plot(*at(route.line), color=colour, linewidth=1.9, zorder=4)
    axes.plot(*at(route.line[-1:]), marker="s", markersize=5.5, color=colour, zorder=5)
    axes.plot(
        *at(route.pulleys), "o", markersize=6.5, color="white", markeredgecolor=colour, markeredgewidth=1.7, zorder=6
    )
    axes.plot(
        *at(route.edges), "o", markersize=6.0, color="white", markeredgecolor=EDGE_RED, markeredgewidth=1.7, zorder=7
    )
    axes.plot(*at(route.varying_edges), "o", markersize=6.0, color=EDGE_RED, markeredgecolor="white", zorder=7)
    name = route.spring[0, 1] + middle
    axes.text(left - 0.8, name, route.name, ha="right", va="center", fontsize=11.5, color=colour)


def _draw_view_joints(axes: Axes, view: View, middle: float) -> None:
    for name, x in view.joints:
        axes.plot([x], [middle], "o", markersize=15, color="white", markeredgecolor=DARK, markeredgewidth=1.4, zorder=8)
        axes.plot([x], [middle], "o", markersize=4, color=DARK, zorder=9)
        text = axes.text(x, middle - 2.7, name, ha="center", va="center", fontsize=11.5, color=DARK, zorder=9)
        text.set_bbox({"facecolor": SKIN, "edgecolor": "none", "pad": 1.0})


def _draw_length(axes: Axes, body: DrawnBody, height: float) -> None:
    arrow = {"arrowstyle": "<->", "color": GREY, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", (body.begin, height), (body.end, height), arrowprops=arrow)
    label = axes.text(
        0.5 * (body.begin + body.end), height, f"{body.end - body.begin:g} mm", ha="center", va="center", fontsize=11.5
    )
    label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 2.0})


def _draw_rig_legend(axes: Axes) -> None:
    def mark(face: str, edge: str, label: str) -> Line2D:
        return Line2D([], [], linestyle="", marker="o", color=face, markeredgecolor=edge, markersize=7, label=label)

    axes.legend(
        handles=[
            Line2D([], [], color=BLUE, linewidth=2.0, label="flexors (cold colours)"),
            Line2D([], [], color=ORANGE, linewidth=2.0, label="extensors (warm colours)"),
            mark("white", GREY, "pulley friction"),
            mark("white", EDGE_RED, "edge friction"),
            mark(EDGE_RED, EDGE_RED, "edge friction that varies with the angle"),
            Line2D([], [], linestyle="", marker="s", color=GREY, markersize=6, label="end of a tendon"),
        ],
        loc="lower center",
        ncols=6,
        frameon=False,
        fontsize=11.5,
        handletextpad=0.4,
    )


def draw_loops(data: LoopFigure, target: Target) -> None:
    """Draw the friction torque of one joint over its angle as PNG: the rig's and the friction model's."""
    figure = Figure(figsize=(12.8, 6.4), layout="constrained")
    axes = figure.subplots()
    clean(axes)
    for loop, colour in zip(data.loops, (BLUE, VERMILION), strict=False):
        axes.plot(loop.angle, 1e3 * loop.rig, color=colour, linewidth=1.8, label=f"rig, {loop.label}")
        axes.plot(loop.model_line[:, 0], 1e3 * loop.model_line[:, 1], color=DARK, linewidth=1.1, linestyle=(0, (4, 2)))
    axes.plot([], [], color=DARK, linewidth=1.1, linestyle=(0, (4, 2)), label="friction model")
    axes.set_xlabel("joint angle (rad)", fontsize=13)
    axes.set_ylabel("friction torque (mN·m)", fontsize=13)
    axes.set_title(f"{data.joint}, slowly to and fro", loc="left", fontsize=14, fontweight="bold", color=DARK)
    axes.legend(loc="center", ncols=3, frameon=False, fontsize=13)
    save(figure, target, 100)


def draw_presliding(data: PreslidingFigure, target: Target) -> None:
    """Draw torque and bristles after a reversal, and small moves to and fro before a joint breaks away, as PNG."""
    figure = Figure(figsize=(16.0, 6.4), layout="constrained")
    turn, bent, small = figure.subplots(1, 3)
    for loop, colour in zip(data.reversals, (BLUE, VERMILION), strict=False):
        turn.plot(1e3 * loop.angle, 1e3 * loop.rig, color=colour, linewidth=1.9, label=f"rig, {loop.label}")
        turn.plot(*1e3 * loop.model_line.T, color=DARK, linewidth=1.1, linestyle=(0, (4, 2)))
    turn.plot([], [], color=DARK, linewidth=1.1, linestyle=(0, (4, 2)), label="friction model")
    for contact, colour in zip(data.contacts, (EDGE_RED, PURPLE, GREEN), strict=False):
        bent.plot(1e3 * contact.angle, contact.bristle, color=colour, linewidth=1.9, label=contact.label)
    for level in (-1.0, 1.0):
        bent.axhline(level, color=GREY, linewidth=1.0, linestyle=(0, (2, 2)))
    bent.text(29.7, -0.985, "break-away", ha="right", va="bottom", fontsize=12, color=GREY)
    _draw_small_moves(small, data)
    for axes, title, way, torque in (
        (turn, f"{data.joint} after a reversal", "distance back from the reversal (mrad)", "friction torque (mN·m)"),
        (bent, f"bristles of {data.tendon} there", "distance back from the reversal (mrad)", "bristle w"),
        (
            small,
            "small moves, then break-away",
            "joint angle from where they begin (mrad)",
            "friction torque (mN·m)",
        ),
    ):
        clean(axes)
        axes.set_title(title, loc="left", fontsize=14, fontweight="bold", color=DARK)
        axes.set_xlabel(way, fontsize=13)
        axes.set_ylabel(torque, fontsize=13)
    for axes in (turn, bent):
        axes.set_xlim(-0.8, 30.0)
        axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.95), frameon=False, fontsize=12.5)
    save(figure, target, 100)


def _draw_small_moves(axes: Axes, data: PreslidingFigure) -> None:
    angle, torque = 1e3 * data.small.angle, 1e3 * data.small.rig
    end = data.turns[-1]
    axes.plot(
        angle[: end + 1], torque[: end + 1], color=SKY, linewidth=1.7, label=f"small moves to 1 ... {len(data.turns)}"
    )
    axes.plot(angle[end:], torque[end:], color=BLUE, linewidth=2.1, label=f"led away from {len(data.turns)}")
    axes.plot(angle[data.turns], torque[data.turns], "o", color="white", markeredgecolor=SKY, markersize=13.5, zorder=4)
    for number, k in enumerate(data.turns, start=1):
        axes.text(
            angle[k], torque[k], str(number), fontsize=11, color=DARK, ha="center", va="center_baseline", zorder=5
        )
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.45), frameon=False, fontsize=12.5)
    axes.set_xlim(*SMALL_SHOWN)
    near = angle[end:] < SMALL_SHOWN[1]
    highest = end + int(torque[end:][near].argmax())
    axes.annotate(
        "break-away",
        (angle[highest], torque[highest]),
        (angle[highest] + 8.0, torque[highest] - 14.0),
        arrowprops={"arrowstyle": "->", "color": DARK},
        fontsize=12.5,
    )


def draw_truth(data: TruthFigure, target: Target) -> None:
    """Draw the measured tendon forces, and the true angle of one joint and its torque with its parts, as PNG."""
    figure = Figure(figsize=(12.8, 7.6), layout="constrained")
    panels = forces, angle, torque = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 0.7, 1.2])
    for axes, name in zip(panels, ("tendon force (N)", "angle (rad)", "torque (mN·m)"), strict=True):
        clean(axes)
        axes.set_ylabel(name, fontsize=13)
        for begin, end in data.contacts:
            axes.axvspan(begin, end, color=ORANGE, alpha=0.18, linewidth=0)
    for i, flexor in enumerate(data.flexors):
        same = [k for k, other in enumerate(data.flexors) if other == flexor]
        colours = FLEXOR_COLOURS if flexor else EXTENSOR_COLOURS
        forces.plot(data.time, data.forces[:, i], color=colours[same.index(i) % len(colours)], linewidth=1.1)
    forces.set_title("measured: all tendons", loc="left", fontsize=14, fontweight="bold", color=DARK)
    angle.plot(data.time, data.angle, color=DARK, linewidth=1.3)
    angle.set_title(f"truth: {data.joint}", loc="left", fontsize=14, fontweight="bold", color=DARK)
    for (label, values), colour in zip(data.torques.items(), (DARK, SKY, GREEN), strict=True):
        torque.plot(data.time, 1e3 * values, color=colour, linewidth=1.6, label=label)
    torque.plot([], [], color=ORANGE, alpha=0.3, linewidth=9.0, label="contact")
    torque.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, frameon=False, fontsize=12.5)
    torque.set_xlabel("time (s)", fontsize=13)
    torque.set_xlim(data.time[0], data.time[-1])
    figure.align_ylabels(panels)
    save(figure, target, 100)
