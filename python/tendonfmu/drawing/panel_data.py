"""What figures consist of: sheets of panels, ready to be drawn.

`interactive.py` draws each panel for a page, where panels fill as many columns as fit. `panels.py` draws all panels of
a sheet side by side in one PNG file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Interval = tuple[float, float]
Size = Literal["small", "medium", "large"]


@dataclass(frozen=True)
class Curve:
    """A line.

    Attributes
    ----------
    style
        Key of `panel_styles.STYLES`.
    x, y : [N]
        NaN breaks the line.
    """

    style: str
    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Band:
    """The area between two curves.

    Attributes
    ----------
    style
        Key of `panel_styles.STYLES`.
    x, low, high : [N]
    """

    style: str
    x: Numbers
    low: Numbers
    high: Numbers


@dataclass(frozen=True)
class Dots:
    """Single points.

    Attributes
    ----------
    style
        Key of `panel_styles.STYLES`.
    x, y : [N]
    """

    style: str
    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Bars:
    """Error bars.

    Attributes
    ----------
    style
        Key of `panel_styles.STYLES`.
    x, low, high : [N]
        At each x a bar from low to high.
    lying
        Bars lie along the horizontal axis; `x` is then their height.
    """

    style: str
    x: Numbers
    low: Numbers
    high: Numbers
    lying: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    title, x_label, y_label
        Texts. A unit is in brackets at the end of a label.
    alt
        What the panel shows, in words, for readers who cannot see it.
    size
        Key of `panel_styles.SIZES`.
    note
        Small text at the right end of the title's line.
    curves, bands, dots, bars
        What is drawn.
    stripes
        Intervals shaded along x, in `stripe_style`.
    ticks
        (place, name) along x.
    data
        Where samples are: bin edges [k + 1] and heights [k] from 0 to 1, drawn along the bottom.
    x_limits, y_limits
        Ends of the axes; None for those of the data.
    log_x, log_y
        Logarithmic axes.
    near_x
        x is linear up to this value on both sides of 0 and logarithmic beyond; 0: linear.
    rows
        Names of y = 0, 1, ... from the top; empty: y is a number.
    line
        A marked x.
    height : CSS pixels
        0: that of the size.
    zoom
        Panels of a page with the same word are zoomed together along x; empty: this one alone.
    """

    title: str
    alt: str
    x_label: str
    y_label: str
    size: Size = "small"
    note: str = ""
    curves: tuple[Curve, ...] = ()
    bands: tuple[Band, ...] = ()
    dots: tuple[Dots, ...] = ()
    bars: tuple[Bars, ...] = ()
    stripes: tuple[Interval, ...] = ()
    stripe_style: str = "held_out"
    ticks: tuple[tuple[float, str], ...] = ()
    data: tuple[Numbers, Numbers] | None = None
    x_limits: Interval | None = None
    y_limits: Interval | None = None
    log_x: bool = False
    log_y: bool = False
    near_x: float = 0.0
    rows: tuple[str, ...] = ()
    line: float | None = None
    height: int = 0
    zoom: str = ""


@dataclass(frozen=True)
class MatrixPanel:
    """A matrix of numbers from −1 to 1.

    Attributes
    ----------
    title
        Heading.
    alt
        What the panel shows, in words, for readers who cannot see it.
    matrix : [p, p]
    groups
        (name, begin, end) of the rows of each group, in order.
    marked : [k, 2]
        Rows and columns of entries that are drawn enlarged where entries are too small to be seen.
    names : [p]
        Names of the rows, all different.
    size
        Key of `panel_styles.SIZES`.
    """

    title: str
    alt: str
    matrix: Numbers
    groups: tuple[tuple[str, int, int], ...]
    marked: NDArray[np.intp]
    names: tuple[str, ...]
    size: Size = "large"


@dataclass(frozen=True)
class Sheet:
    """Panels that belong together.

    Attributes
    ----------
    section
        Heading of the page under which the sheet is.
    name
        Stem of the PNG file.
    title
        Heading.
    caption
        What to see, in a sentence or two.
    keys
        (style, meaning) of what is drawn.
    panels
        The panels.
    folded
        Shown on demand only.
    """

    section: str
    name: str
    title: str
    caption: str
    keys: tuple[tuple[str, str], ...]
    panels: tuple[Panel | MatrixPanel, ...]
    folded: bool = False
