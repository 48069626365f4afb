"""Draws the routing of a finger. Its geometry comes from `model/routing_geometry.py`."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from tendonfmu.drawing.plot_style import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKIN, SKY, Target, save
from tendonfmu.model import DrawnTendon, FingerDrawing

EDGE_RED = "#CC1F1A"
TENDON_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, "#5A5A5A", "#332288", "#999933")


PICTURE_DPI, ICON_DPI = 130, 26


def draw_finger(drawing: FingerDrawing, target: Target, icon: Target | None = None) -> None:
    """Draw the routing of a finger as PNG, as in fig. 3 of the paper.

    It shows links, joints, tendons over and under them, pulleys, and edges (red).

    Parameters
    ----------
    drawing
        Geometry of the drawing.
    target
        File name or binary stream.
    icon
        The same for a small square copy without words.
    """
    longest = max(len(tendon.name) for tendon in drawing.tendons)
    labels = 0.5 + 0.115 * longest  # room for names on the left, in drawing units
    width, height = drawing.right - drawing.left + labels, 2.0 * drawing.height + 1.6
    scale = min(max(10.0 / width, 0.48), 1.15)
    figure = Figure(figsize=(width * scale, height * scale))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(drawing.left - labels, drawing.right)
    axes.set_ylim(-drawing.height - 0.8, drawing.height + 0.8)
    size = 72.0 * scale * 0.145
    _draw_skeleton(axes, drawing, size)
    for i, tendon in enumerate(drawing.tendons):
        _draw_tendon(axes, tendon, TENDON_COLOURS[i % len(TENDON_COLOURS)], drawing.left, size)
    _draw_finger_legend(axes, drawing, size)
    save(figure, target, PICTURE_DPI)
    if icon is not None:
        _leave_words_out(figure, axes, drawing)
        save(figure, icon, ICON_DPI)


def _leave_words_out(figure: Figure, axes: Axes, drawing: FingerDrawing) -> None:
    legend = axes.get_legend()
    if legend is not None:
        legend.remove()
    for text in axes.texts:
        text.set_visible(False)
    axes.set_xlim(drawing.left, drawing.right)
    figure.set_size_inches(figure.get_figwidth(), figure.get_figwidth())


def _draw_skeleton(axes: Axes, drawing: FingerDrawing, size: float) -> None:
    x, lower, upper = drawing.outline.T
    axes.fill_between(x, lower, upper, facecolor=SKIN, edgecolor=LIGHT, linewidth=0.1 * size, zorder=0.5)
    for begin, end in drawing.links:
        axes.plot([begin, end], [0.0, 0.0], color=LIGHT, linewidth=size * 1.6, solid_capstyle="round", zorder=1)
    for number, joint in enumerate(drawing.joints, start=1):
        disc = Circle((joint.x, 0.0), joint.radius, facecolor="white", edgecolor=DARK, linewidth=0.11 * size, zorder=2)
        axes.add_patch(disc)
        label = axes.text(joint.x, 0.0, str(number), ha="center", va="center_baseline", fontsize=size, zorder=8)
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.1 * size})
        axes.text(joint.x, drawing.height + 0.25, joint.name, ha="center", va="bottom", fontsize=size, color=DARK)


def _draw_tendon(axes: Axes, tendon: DrawnTendon, colour: str, left: float, size: float) -> None:
    thin = 0.13 * size
    style = (0, (5, 2)) if tendon.bidirectional else "-"
    axes.plot(*tendon.spring.T, color=colour, linewidth=0.8 * thin, zorder=4)
    axes.plot(*tendon.line.T, color=colour, linewidth=thin, linestyle=style, zorder=4)
    axes.plot(*tendon.line[-1], marker="s", markersize=0.38 * size, color=colour, zorder=5)
    axes.plot(
        *tendon.pulleys.T,
        "o",
        markersize=0.52 * size,
        color="white",
        markeredgecolor=colour,
        markeredgewidth=thin,
        zorder=6,
    )
    axes.plot(
        *tendon.edges.T,
        "o",
        markersize=0.44 * size,
        color="white",
        markeredgecolor=EDGE_RED,
        markeredgewidth=thin,
        zorder=7,
    )
    axes.plot(*tendon.varying_edges.T, "o", markersize=0.52 * size, color=EDGE_RED, zorder=7)
    axes.text(left - 0.12, tendon.spring[0, 1], tendon.name, ha="right", va="center", fontsize=0.9 * size, color=DARK)


def _draw_finger_legend(axes: Axes, drawing: FingerDrawing, size: float) -> None:
    def mark(face: str, edge: str, label: str) -> Line2D:
        return Line2D(
            [], [], linestyle="", marker="o", color=face, markeredgecolor=edge, markersize=0.55 * size, label=label
        )

    tendons = drawing.tendons
    handles = [Line2D([], [], linestyle="", marker="s", color=GREY, markersize=0.4 * size, label="end of a tendon")]
    if any(len(tendon.pulleys) for tendon in tendons):
        handles.append(mark("white", GREY, "pulley friction"))
    if any(len(tendon.edges) for tendon in tendons):
        handles.append(mark("white", EDGE_RED, "edge friction"))
    if any(len(tendon.varying_edges) for tendon in tendons):
        handles.append(mark(EDGE_RED, EDGE_RED, "edge friction that varies with the angle"))
    if any(tendon.bidirectional for tendon in tendons):
        handles.append(Line2D([], [], color=GREY, linestyle=(0, (5, 2)), label="cable loop"))
    columns = 2 if len(drawing.joints) == 1 else len(handles)
    axes.legend(
        handles=handles,
        loc="lower center",
        ncols=columns,
        frameon=False,
        fontsize=0.85 * size,
        handletextpad=0.4,
        borderaxespad=0.2,
    )
