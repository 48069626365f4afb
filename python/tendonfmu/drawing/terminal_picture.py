"""Draws the sign of a terminal of an FMU."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from tendonfmu.drawing.plot_style import BLUE, Target, save

SIZE, DPI = 0.4, 80  # inch, pixels per inch


def draw_terminal(target: Target, *, is_input: bool) -> None:
    """Draw a triangle that points to the right as PNG: filled for inputs, outlined for outputs.

    Parameters
    ----------
    target
        File name or binary stream.
    is_input
        Whether the signals of the terminal go into the FMU.
    """
    figure = Figure(figsize=(SIZE, SIZE))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    corners = [(0.1, 0.1), (0.9, 0.5), (0.1, 0.9)]
    axes.add_patch(Polygon(corners, facecolor=BLUE if is_input else "white", edgecolor=BLUE, linewidth=2.0))
    save(figure, target, DPI)
