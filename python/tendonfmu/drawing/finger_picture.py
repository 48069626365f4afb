"""Draws what an FMU carries: the routing of its finger, and the signs of its terminals.

The geometry of the routing comes from `model/routing_geometry.py`. Pillow draws: it is imported in a tenth of the time
of matplotlib. It does not smooth edges, so the picture is drawn three times as large and then scaled down.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from tendonfmu.drawing.figures import BLUE, DARK, GREY, LIGHT, SKIN
from tendonfmu.errors import InternalError
from tendonfmu.model import EDGE_RED, TENDON_COLOURS, DrawnTendon, FingerDrawing

PICTURE_DPI, ICON_DPI = 130, 26
TERMINAL_PIXELS = 32
SIZE = 0.145  # of letters, in drawing units; widths and marks are parts of it
THIN = 0.13 * SIZE
DASH = (5.0 * THIN, 2.0 * THIN)  # of a cable loop
ROW = 1.6 * SIZE  # of the legend

LARGER = 3  # the drawing than the picture
FONT = "mpl-data/fonts/ttf/DejaVuSans.ttf"  # in matplotlib's package; it has the letters of most languages


# --- a picture --------------------------------------------------------------------------------------------------------


class Raster:
    """A picture with a white ground. All lengths are in units of the drawing, with y upward."""

    def __init__(self, left: float, right: float, bottom: float, top: float, scale: float) -> None:
        self._left, self._top, self._scale = left, top, LARGER * scale
        size = (max(round((right - left) * scale), 1), max(round((top - bottom) * scale), 1))
        self._image = Image.new("RGB", (LARGER * size[0], LARGER * size[1]), "white")
        self._draw = ImageDraw.Draw(self._image)

    def line(self, points: ArrayLike, colour: str, width: float, dash: tuple[float, float] | None = None) -> None:
        """Draw a line through points [k, 2]; `dash`: lengths of a dash and of the gap behind it."""
        at = self._pixels(points)
        for piece in [at] if dash is None else _dashes(at, dash[0] * self._scale, dash[1] * self._scale):
            self._draw.line([(x, y) for x, y in piece], fill=colour, width=self._width(width), joint="curve")

    def polygon(self, points: ArrayLike, face: str, edge: str, width: float) -> None:
        """Draw a closed area with corners [k, 2]."""
        corners = [(x, y) for x, y in self._pixels(points)]
        self._draw.polygon(corners, fill=face)
        self._draw.line([*corners, corners[0], corners[1]], fill=edge, width=self._width(width), joint="curve")

    def discs(self, centres: ArrayLike, radius: float, face: str, edge: str = "", width: float = 0.0) -> None:
        """Draw a disc at each centre [k, 2]; half of the edge's width lies outside of the radius."""
        for x, y in self._pixels(centres):
            for r, colour in ((radius + 0.5 * width, edge or face), (radius - 0.5 * width, face)):
                r *= self._scale
                self._draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    def square(self, centre: ArrayLike, side: float, colour: str) -> None:
        """Draw a square around a centre [2]."""
        (x, y), half = self._pixels(centre)[0], 0.5 * side * self._scale
        self._draw.rectangle((x - half, y - half, x + half, y + half), fill=colour)

    def words(
        self, at: ArrayLike, text: str, size: float, colour: str, anchor: Literal["mm", "lm", "rm", "ms"]
    ) -> None:
        """Write a line of text of a size around a point [2]; `anchor` is Pillow's."""
        x, y = self._pixels(at)[0]
        self._draw.text((x, y), text, fill=colour, font=_font(round(size * self._scale)), anchor=anchor)

    def length(self, text: str, size: float) -> float:
        """Return the length of a line of text."""
        return float(self._draw.textlength(text, font=_font(round(size * self._scale)))) / self._scale

    def save(self, target: IO[bytes]) -> None:
        """Write the picture as PNG. The same drawing gives the same bytes."""
        self._image.reduce(LARGER).save(target, format=PngImagePlugin.PngImageFile.format)

    def _pixels(self, points: ArrayLike) -> NDArray[np.float64]:
        at = np.asarray(points, dtype=float).reshape(-1, 2)
        return np.column_stack([at[:, 0] - self._left, self._top - at[:, 1]]) * self._scale

    def _width(self, width: float) -> int:
        return max(round(width * self._scale), 1)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    spec = importlib.util.find_spec("matplotlib")  # which is not imported
    if spec is None or not spec.submodule_search_locations:
        raise InternalError("a font not found; expected the Python package matplotlib")
    file = Path(spec.submodule_search_locations[0]) / FONT
    return ImageFont.truetype(str(file), max(size, 1), layout_engine=ImageFont.Layout.BASIC)


def _dashes(points: NDArray[np.float64], dash: float, gap: float) -> list[NDArray[np.float64]]:
    """Return the dashes of a line through points [k, 2], each a line of its own."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    pieces = []
    for begin in np.arange(0.0, way[-1], dash + gap):
        end = min(begin + dash, way[-1])
        inside = way[(way > begin) & (way < end)]
        at = np.concatenate([[begin], inside, [end]])
        pieces.append(np.column_stack([np.interp(at, way, points[:, k]) for k in range(2)]))
    return pieces


# --- the finger -------------------------------------------------------------------------------------------------------


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
    columns = min(len(entries), 2 if len(drawing.joints) == 1 else len(entries))
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
