"""Draws lines, shapes and words into a PNG picture with Pillow: the small drawings that an FMU carries.

Pillow is imported in a tenth of the time of matplotlib, which draws everything else. Pillow does not smooth edges: the
picture is drawn three times as large and then scaled down.
"""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from typing import IO, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from tendonfmu.errors import InternalError

LARGER = 3  # the drawing than the picture
FONT = "mpl-data/fonts/ttf/DejaVuSans.ttf"  # in matplotlib's package; it has the letters of most languages


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
