"""Draws what an FMU carries: the routing of its finger, and the signs of its terminals.

The geometry of the routing comes from `model/routing_geometry.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import IO

import numpy as np

from tendonfmu.drawing.panel import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKIN, SKY
from tendonfmu.drawing.raster import Raster
from tendonfmu.model import DrawnTendon, FingerDrawing

EDGE_RED = "#CC1F1A"
TENDON_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, "#5A5A5A", "#332288", "#999933")

PICTURE_DPI, ICON_DPI = 130, 26
TERMINAL_PIXELS = 32
SIZE = 0.145  # of letters, in drawing units; widths and marks are parts of it
THIN = 0.13 * SIZE
DASH = (5.0 * THIN, 2.0 * THIN)  # of a cable loop
ROW = 1.6 * SIZE  # of the legend

Mark = Callable[[Raster, float, float], None]


def draw_finger(drawing: FingerDrawing, target: IO[bytes], icon: IO[bytes] | None = None) -> None:
    """Draw the routing of a finger as PNG, as in fig. 3 of the paper."""
    longest = max(len(tendon.name) for tendon in drawing.tendons)
    labels = 0.5 + 0.115 * longest  # room for names on the left, in drawing units
    half = drawing.height + 0.8
    width = drawing.right - drawing.left + labels
    scale = min(max(10.0 / width, 0.48), 1.15)  # inch per unit
    picture = Raster(drawing.left - labels, drawing.right, -half, half, scale * PICTURE_DPI)
    _draw_lines(picture, drawing)
    _write_names(picture, drawing)
    _draw_legend(picture, drawing, 0.5 * (drawing.left - labels + drawing.right), 0.6 * SIZE - half)
    picture.save(target)
    if icon is not None:
        shown = drawing.right - drawing.left
        side, middle = max(shown, 2.0 * half), 0.5 * (drawing.left + drawing.right)
        small = Raster(
            middle - 0.5 * side, middle + 0.5 * side, -0.5 * side, 0.5 * side, width * scale * ICON_DPI / side
        )
        _draw_lines(small, drawing)
        small.save(icon)


def _draw_lines(picture: Raster, drawing: FingerDrawing) -> None:
    """Draw all but words: each kind of mark over all lines below it."""
    x, lower, upper = drawing.outline.T
    sides = np.concatenate([np.column_stack([x, lower]), np.column_stack([x, upper])[::-1]])
    picture.polygon(sides, SKIN, LIGHT, 0.1 * SIZE)
    for begin, end in drawing.links:
        picture.line([(begin, 0.0), (end, 0.0)], LIGHT, 1.6 * SIZE)
        picture.discs([(begin, 0.0), (end, 0.0)], 0.8 * SIZE, LIGHT)
    for joint in drawing.joints:
        picture.discs([(joint.x, 0.0)], joint.radius, "white", DARK, 0.11 * SIZE)
    coloured = [(tendon, TENDON_COLOURS[i % len(TENDON_COLOURS)]) for i, tendon in enumerate(drawing.tendons)]
    for tendon, colour in coloured:
        picture.line(tendon.spring, colour, 0.8 * THIN)
        picture.line(tendon.line, colour, THIN, DASH if tendon.bidirectional else None)
    for tendon, colour in coloured:
        picture.square(tendon.line[-1], 0.44 * SIZE, colour)
    for tendon, colour in coloured:
        picture.discs(tendon.pulleys, 0.26 * SIZE, "white", colour, THIN)
    for tendon, _ in coloured:
        picture.discs(tendon.edges, 0.22 * SIZE, "white", EDGE_RED, THIN)
        picture.discs(tendon.varying_edges, 0.3 * SIZE, EDGE_RED)


def _write_names(picture: Raster, drawing: FingerDrawing) -> None:
    for number, joint in enumerate(drawing.joints, start=1):
        half = 0.5 * picture.length(str(number), SIZE) + 0.1 * SIZE
        ground = [(joint.x + a * half, b * 0.5 * SIZE) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        picture.polygon(ground, "white", "white", 0.0)
        picture.words((joint.x, 0.0), str(number), SIZE, "black", "mm")
        picture.words((joint.x, drawing.height + 0.25), joint.name, SIZE, DARK, "ms")
    for tendon in drawing.tendons:
        picture.words((drawing.left - 0.12, tendon.spring[0, 1]), tendon.name, 0.9 * SIZE, DARK, "rm")


# --- legend -----------------------------------------------------------------------------------------------------------


def _draw_legend(picture: Raster, drawing: FingerDrawing, middle: float, bottom: float) -> None:
    """Explain the marks in rows above `bottom`, the longest row around x = `middle`."""
    entries = _legend(drawing.tendons)
    columns = 2 if len(drawing.joints) == 1 else len(entries)
    rows = [entries[i : i + columns] for i in range(0, len(entries), columns)]
    widths = [
        max(1.9 * SIZE + picture.length(row[k][1], 0.85 * SIZE) for row in rows if k < len(row)) for k in range(columns)
    ]
    gap = 1.7 * SIZE
    left = middle - 0.5 * (sum(widths) + gap * (columns - 1))
    for i, row in enumerate(reversed(rows)):
        x, y = left, bottom + (i + 0.5) * ROW
        for width, (mark, text) in zip(widths, row, strict=False):
            mark(picture, x + 0.8 * SIZE, y)
            picture.words((x + 1.9 * SIZE, y), text, 0.85 * SIZE, "black", "lm")
            x += width + gap


def _legend(tendons: list[DrawnTendon]) -> list[tuple[Mark, str]]:
    def disc(face: str, edge: str) -> Mark:
        return lambda picture, x, y: picture.discs([(x, y)], 0.275 * SIZE, face, edge, THIN)

    entries: list[tuple[Mark, str]] = [
        (lambda picture, x, y: picture.square((x, y), 0.44 * SIZE, GREY), "end of a tendon")
    ]
    if any(len(tendon.pulleys) for tendon in tendons):
        entries.append((disc("white", GREY), "pulley friction"))
    if any(len(tendon.edges) for tendon in tendons):
        entries.append((disc("white", EDGE_RED), "edge friction"))
    if any(len(tendon.varying_edges) for tendon in tendons):
        entries.append((disc(EDGE_RED, EDGE_RED), "edge friction that varies with the angle"))
    if any(tendon.bidirectional for tendon in tendons):
        ends = 0.8 * SIZE
        entries.append(
            (lambda picture, x, y: picture.line([(x - ends, y), (x + ends, y)], GREY, THIN, DASH), "cable loop")
        )
    return entries


# --- terminals --------------------------------------------------------------------------------------------------------


def draw_terminal(target: IO[bytes], *, is_input: bool) -> None:
    """Draw a triangle that points to the right as PNG: filled for inputs, outlined for outputs."""
    picture = Raster(0.0, 1.0, 0.0, 1.0, TERMINAL_PIXELS)
    picture.polygon([(0.1, 0.1), (0.9, 0.5), (0.1, 0.9)], BLUE if is_input else "white", BLUE, 0.07)
    picture.save(target)
