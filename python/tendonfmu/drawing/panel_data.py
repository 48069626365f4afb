"""What figures consist of: sheets of panels, ready to be drawn.

`interactive.py` draws a panel alone in a page, where panels flow into as many columns as there is room for; `panels.py`
draws it beside its neighbours in the sheet's PNG file.
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
    """A line. style: a key of `panel_styles.STYLES`. x, y: [N], NaN breaks the line."""

    style: str
    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Band:
    """Between two curves. x, low, high: [N]."""

    style: str
    x: Numbers
    low: Numbers
    high: Numbers


@dataclass(frozen=True)
class Dots:
    """Points, each by itself. x, y: [N]."""

    style: str
    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Bars:
    """Error bars: at each x from low to high, all [N]; lying: at each y = x along the other axis."""

    style: str
    x: Numbers
    low: Numbers
    high: Numbers
    lying: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    alt: what it shows, in words, for those who do not see it. note: small, at the right end of the title's line.
    stripes: shaded along x, in `stripe_style`. ticks: places and names along x. data: where samples are, bin edges
    [k + 1] and heights [k] from 0 to 1, along the bottom. rows: names of y = 0, 1, ... from the top; none: y is a
    number. line: a marked x. log_x, log_y: logarithmic. near_x: to either side of 0 up to here x is linear, beyond it
    logarithmic; 0: linear. height: CSS pixels, 0: the size's. zoom: panels of a page with the same word here are zoomed
    together along x; "": by itself.
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
    """A matrix of numbers from −1 to 1, [p, p]. groups: name, and the rows (from, to) that it spans, in order.

    marked: [k, 2] rows and columns of entries that are drawn larger than they are, where all are too small to be seen.
    names: of the rows, [p], no two alike.
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

    section: under which heading of the page. name: stem of the PNG file. caption: what to see, a sentence or two.
    keys: style and meaning of what is drawn. folded: shown on demand only.
    """

    section: str
    name: str
    title: str
    caption: str
    keys: tuple[tuple[str, str], ...]
    panels: tuple[Panel | MatrixPanel, ...]
    folded: bool = False
