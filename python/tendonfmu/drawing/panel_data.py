"""What figures consist of: sheets of panels, ready to be drawn.

`interactive.py` draws each panel for a page, where panels fill as many columns as fit. `panels.py` draws all panels of
a sheet side by side in one PNG file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers

Interval = tuple[float, float]
Size = Literal["small", "medium", "large"]


@dataclass(frozen=True)
class Curve:
    """A line."""

    style: str  # key of `panel_styles.STYLES`
    x: Numbers  # naN breaks the line
    y: Numbers


@dataclass(frozen=True)
class Band:
    """The area between two curves."""

    style: str  # key of `panel_styles.STYLES`
    x: Numbers  #
    low: Numbers
    high: Numbers


@dataclass(frozen=True)
class Dots:
    """Single points."""

    style: str  # key of `panel_styles.STYLES`
    x: Numbers  #
    y: Numbers


@dataclass(frozen=True)
class Bars:
    """Error bars."""

    style: str  # key of `panel_styles.STYLES`
    x: Numbers  # at each x a bar from low to high
    low: Numbers
    high: Numbers
    lying: bool = False  # bars lie along the horizontal axis; `x` is then their height


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    title: str  # texts
    alt: str  # what the panel shows, in words, for readers who cannot see it
    x_label: str
    y_label: str
    size: Size = "small"  # key of `panel_styles.SIZES`
    note: str = ""  # small text at the right end of the title's line
    curves: tuple[Curve, ...] = ()  # what is drawn
    bands: tuple[Band, ...] = ()
    dots: tuple[Dots, ...] = ()
    bars: tuple[Bars, ...] = ()
    stripes: tuple[Interval, ...] = ()  # intervals shaded along x, in `stripe_style`
    stripe_style: str = "held_out"
    ticks: tuple[tuple[float, str], ...] = ()  # (place, name) along x
    # where samples are: bin edges [k + 1] and heights [k] from 0 to 1, drawn along the bottom
    data: tuple[Numbers, Numbers] | None = None
    x_limits: Interval | None = None  # ends of the axes; None for those of the data
    y_limits: Interval | None = None
    log_x: bool = False  # logarithmic axes
    log_y: bool = False
    near_x: float = 0.0  # x is linear up to this value on both sides of 0 and logarithmic beyond; 0: linear
    rows: tuple[str, ...] = ()  # names of y = 0, 1, ... from the top; empty: y is a number
    line: float | None = None  # A marked x
    height: int = 0
    zoom: str = ""  # panels of a page with the same word are zoomed together along x; empty: this one alone


@dataclass(frozen=True)
class MatrixPanel:
    """A matrix of numbers from −1 to 1."""

    title: str  # heading
    alt: str  # what the panel shows, in words, for readers who cannot see it
    matrix: Numbers
    groups: tuple[tuple[str, int, int], ...]  # (name, begin, end) of the rows of each group, in order
    marked: NDArray[np.intp]
    names: tuple[str, ...]
    size: Size = "large"  # key of `panel_styles.SIZES`


@dataclass(frozen=True)
class Sheet:
    """Panels that belong together."""

    section: str  # heading of the page under which the sheet is
    name: str  # stem of the PNG file
    title: str  # heading
    caption: str  # what to see, in a sentence or two
    keys: tuple[tuple[str, str], ...]  # (style, meaning) of what is drawn
    panels: tuple[Panel | MatrixPanel, ...]  # the panels
    folded: bool = False  # shown on demand only
