"""Draws the sign of a terminal of an FMU."""

from __future__ import annotations

from typing import IO

from tendonfmu.drawing.panel_styles import BLUE
from tendonfmu.drawing.raster import Raster

PIXELS = 32


def draw_terminal(target: IO[bytes], *, is_input: bool) -> None:
    """Draw a triangle that points to the right as PNG: filled for inputs, outlined for outputs."""
    picture = Raster(0.0, 1.0, 0.0, 1.0, PIXELS)
    picture.polygon([(0.1, 0.1), (0.9, 0.5), (0.1, 0.9)], BLUE if is_input else "white", BLUE, 0.07)
    picture.save(target)
