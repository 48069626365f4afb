"""Draws the icons that an FMU carries: the routing of its finger, and the signs of its terminals.

The geometry of the routing comes from `model/routing_geometry.py`; the page of the FMU draws it with all names
(`model/routing_geometry.py`). Pillow does not smooth edges, so a picture is drawn three times as large and scaled down.
"""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, PngImagePlugin

from tendonfmu.drawing.figures import BLUE, DARK, LIGHT, SKIN
from tendonfmu.model import EDGE_RED, TENDON_COLOURS, FingerDrawing

ICON_PIXELS, TERMINAL_PIXELS = 480, 32
WIDTH = 0.05  # of lines, in units of the drawing
LARGER = 3  # the drawing than the picture


class _Square:
    """A square picture with a white ground around (middle, 0), y upward. All lengths are in units of the drawing."""

    def __init__(self, middle: float, side: float, pixels: int) -> None:
        self._corner, self._scale = np.array([middle - 0.5 * side, 0.5 * side]), LARGER * pixels / side
        self._image = Image.new("RGB", (LARGER * pixels, LARGER * pixels), "white")
        self._draw = ImageDraw.Draw(self._image)

    def line(self, points: ArrayLike, colour: str, width: float = WIDTH) -> None:
        """Draw a line through points [k, 2]."""
        self._draw.line(self._pixels(points), colour, max(round(width * self._scale), 1), joint="curve")

    def area(self, points: ArrayLike, face: str, edge: str, width: float = WIDTH) -> None:
        """Draw a closed area with corners [k, 2]."""
        corners = np.asarray(points, dtype=float)
        self._draw.polygon(self._pixels(corners), fill=face)
        self.line(np.concatenate([corners, corners[:2]]), edge, width)

    def discs(self, centres: ArrayLike, radius: float, face: str, edge: str) -> None:
        """Draw a disc at each centre [k, 2]; half of the edge lies outside of the radius."""
        for x, y in self._pixels(centres):
            for r, colour in ((radius + 0.5 * WIDTH, edge), (radius - 0.5 * WIDTH, face)):
                r *= self._scale
                self._draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    def png(self) -> bytes:
        """Return the picture. The same drawing gives the same bytes."""
        stream = io.BytesIO()
        self._image.reduce(LARGER).save(stream, format=PngImagePlugin.PngImageFile.format)
        return stream.getvalue()

    def _pixels(self, points: ArrayLike) -> list[tuple[float, float]]:
        at = (np.asarray(points, dtype=float).reshape(-1, 2) - self._corner) * (self._scale, -self._scale)
        return [(x, y) for x, y in at.tolist()]


def draw_finger(drawing: FingerDrawing) -> bytes:
    """Draw the routing of a finger as PNG, as in fig. 3 of the paper: each kind of mark over all lines below it."""
    side = max(drawing.right - drawing.left, 2.0 * drawing.height)
    picture = _Square(0.5 * (drawing.left + drawing.right), 1.04 * side, ICON_PIXELS)
    x, lower, upper = drawing.outline.T
    picture.area(np.concatenate([np.column_stack([x, lower]), np.column_stack([x, upper])[::-1]]), SKIN, LIGHT)
    for begin, end in drawing.links:
        picture.line([(begin, 0.0), (end, 0.0)], LIGHT, 0.23)
    for joint in drawing.joints:
        picture.discs([(joint.x, 0.0)], joint.radius, "white", DARK)
    coloured = [(tendon, TENDON_COLOURS[i % len(TENDON_COLOURS)]) for i, tendon in enumerate(drawing.tendons)]
    for tendon, colour in coloured:
        picture.line(tendon.spring, colour)
        picture.line(tendon.line, colour)
    for tendon, colour in coloured:
        picture.discs(tendon.line[-1], 0.04, colour, colour)
        picture.discs(tendon.pulleys, 0.065, "white", colour)
    for tendon, _ in coloured:
        picture.discs(tendon.edges, 0.065, "white", EDGE_RED)
        picture.discs(tendon.varying_edges, 0.065, EDGE_RED, EDGE_RED)
    return picture.png()


def draw_terminal(*, is_input: bool) -> bytes:
    """Draw a triangle that points to the right as PNG: filled for inputs, outlined for outputs."""
    picture = _Square(0.5, 1.0, TERMINAL_PIXELS)
    picture.area([(0.1, -0.4), (0.9, 0.0), (0.1, 0.4)], BLUE if is_input else "white", BLUE, 0.07)
    return picture.png()
