"""What all matplotlib drawings share: clean axes, and PNG files that are the same for the same drawing."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from tendonfmu.drawing.panel_styles import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKIN, SKY, VERMILION
from tendonfmu.files import whole_file

__all__ = [
    "BLUE",
    "DARK",
    "GREEN",
    "GREY",
    "LIGHT",
    "ORANGE",
    "PURPLE",
    "SKIN",
    "SKY",
    "VERMILION",
    "Target",
    "any_names",
    "clean",
    "save",
]

Target = Path | IO[bytes]


def save(figure: Figure, target: Target, dpi: int) -> None:
    """Save a figure as PNG without date or version, so that the same drawing gives the same bytes."""
    with any_names(figure):
        if isinstance(target, Path):
            with whole_file(target) as partial:
                figure.savefig(partial, format="png", dpi=dpi, facecolor="white", metadata={"Software": None})
        else:
            figure.savefig(target, format="png", dpi=dpi, facecolor="white", metadata={"Software": None})


@contextmanager
def any_names(figure: Figure) -> Iterator[FigureCanvasAgg]:
    """Make a canvas for a figure whose texts may contain a $ or letters that the font lacks (drawn as boxes)."""
    canvas = FigureCanvasAgg(figure)
    for text in figure.findobj(Text):
        text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        yield canvas


def clean(axes: Axes, labels: float = 12.0) -> None:
    """Leave two spines and a light grid of horizontal lines."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#E6E6E6", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=labels)
