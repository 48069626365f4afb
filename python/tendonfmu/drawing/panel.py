"""What a figure shows: sheets of panels and their styles, before they are drawn.

`figures.py` makes a Plotly figure of each panel, which pages embed. The colours are those of Okabe and Ito, which
colour-blind readers can distinguish.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from tendonfmu.arrays import Numbers

Interval = tuple[float, float]
Ticks = tuple[tuple[float, str], ...]  # (place, name)
Size = Literal["small", "medium", "large", "wide"]

BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00"
DARK, GREY, LIGHT, SKIN = "#222222", "#8A8A8A", "#D5D8DC", "#F4F1EC"

DIVERGING = ("#2166AC", "#6BAED6", "#FFFFFF", "#F4895F", "#B2182B")  # from −1 over 0 to 1
# Replacements on a dark page. The other colours are visible on both.
IN_DARK = {
    DARK: "#E4E8EC",
    BLUE: "#6E95FF",
    GREY: "#A4ABB3",
    VERMILION: "#F0803C",
    GREEN: "#2FC79B",
    "#BDBDBD": "#7C858E",
    "#5A5A5A": "#B9BFC6",
    "#332288": "#A495F5",
    "#999933": "#C4C45A",
    "#CC1F1A": "#FF6B62",
}

SIZES: Mapping[Size, tuple[int, int]] = {  # CSS pixels
    "small": (370, 250),
    "medium": (560, 250),
    "large": (560, 400),
    "wide": (1120, 230),
}


@dataclass(frozen=True)
class Style:
    """How something is drawn."""

    colour: str  # as "#RRGGBB"
    width: float = 1.2  # of a curve; a width of 0 means dots
    dash: Literal["-", "--", ":"] = "-"
    alpha: float = 1.0  # opacity
    filled: bool = True  # whether dots are filled
    patch: bool = False  # whether its key is a patch, as for a band

    @property
    def shape(self) -> str:
        """Return the CSS class of its key in the page."""
        if self.patch:
            return "patch"
        if self.width == 0:
            return "dot" if self.filled else "ring"
        return {"-": "line", "--": "dashed", ":": "dotted"}[self.dash]


STYLES = {
    "measured": Style(DARK, 1.0),
    "predicted": Style(SKY, 1.5),
    "bias": Style(ORANGE, 0.8, alpha=0.8),
    "fitted": Style(BLUE, 1.8),
    "slow": Style(ORANGE, 1.8),
    "negative": Style(VERMILION, 1.8),
    "start": Style(GREY, 1.1, "--"),
    "confidence": Style(BLUE, alpha=0.2, patch=True),
    "fitted_confidence": Style(BLUE, alpha=0.2, patch=True),
    "slow_limit": Style(ORANGE, 0.9, ":"),
    "standstill": Style("#BDBDBD", alpha=0.35, patch=True),
    "negative_confidence": Style(VERMILION, alpha=0.18, patch=True),
    "median": Style(BLUE, 1.6),
    "spread": Style(SKY, alpha=0.35, patch=True),
    "held_out": Style(ORANGE, alpha=0.16, patch=True),
    "contact": Style(VERMILION, 7.0),
    "labelled": Style(DARK, 7.0),
    "slack": Style(ORANGE, 7.0),
    "in_contact": Style(VERMILION, alpha=0.16, patch=True),
    "data": Style("#BDBDBD", alpha=0.6, patch=True),
    "identified": Style(BLUE, 0.0, alpha=0.7),
    "unidentified": Style(GREY, 0.0, filled=False),
    "unknown": Style(GREY, 1.8),
    "before": Style(VERMILION, 1.0, alpha=0.9),
    "after": Style(BLUE, 1.0),
    "reference": Style(DARK, 1.0),
    "reference_line": Style(DARK, 0.9, alpha=0.45),
    "reference_dots": Style(DARK, 0.0),
    "before_line": Style(VERMILION, 0.9, alpha=0.45),
    "after_line": Style(BLUE, 0.9, alpha=0.45),
    "before_dots": Style(VERMILION, 0.0),
    "after_dots": Style(BLUE, 0.0),
    "before_scatter": Style(VERMILION, alpha=0.13, patch=True),
    "floor": Style(GREEN, 0.0, filled=False),
    "joint_1": Style(BLUE, 1.1),
    "joint_2": Style(VERMILION, 1.1),
    "joint_3": Style(GREEN, 1.1),
    "joint_4": Style(PURPLE, 1.1),
    "sensor_1": Style(BLUE, 1.6, "--", alpha=0.7),
    "sensor_2": Style(VERMILION, 1.6, "--", alpha=0.7),
    "sensor_3": Style(GREEN, 1.6, "--", alpha=0.7),
    "sensor_4": Style(PURPLE, 1.6, "--", alpha=0.7),
    "sensor": Style(DARK, 1.6, "--"),
    "external": Style(GREEN, 3.0, alpha=0.55),
    "label_stripe": Style("#F0C27A", alpha=0.3, patch=True),
    "label": Style("#F0C27A", 9.0),
    "alarm": Style(BLUE, 9.0),
    "missed": Style(GREY, 9.0),
    "false_alarm": Style(VERMILION, 9.0),
    "found_stripe": Style(ORANGE, alpha=0.2, patch=True),
    "false_stripe": Style(PURPLE, alpha=0.2, patch=True),
    "onset": Style(DARK, 1.6),
    "first_alarm": Style(VERMILION, 2.6),
    "own_dots": Style(VERMILION, 0.0),
    "interval": Style("#B4BBC4", 1.2),
    "ninety": Style(VERMILION, 1.3, "--"),
    "limit": Style(VERMILION, 1.3),
    "found_bar": Style(ORANGE, 9.0),
    "false_bar": Style(PURPLE, 9.0),
    "share": Style(GREY, 1.4, "--"),
    "slow_limits": Style(GREY, 1.5, ":"),
    "start_dots": Style(GREEN, 0.0),
    "dark_dots": Style(DARK, 0.0),
    "bound": Style(LIGHT, patch=True),
    "threshold": Style("#BBD9EE", patch=True),
}


@dataclass(frozen=True)
class Curve:
    """A line; NaN breaks it."""

    style: str  # key of `STYLES`
    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Band:
    """The area between two curves."""

    style: str
    x: Numbers
    low: Numbers
    high: Numbers


@dataclass(frozen=True)
class Dots:
    """Single points."""

    style: str
    x: Numbers
    y: Numbers
    texts: tuple[str, ...] = ()  # written to the right of each; empty: none


@dataclass(frozen=True)
class Bars:
    """Error bars: at each x one from low to high."""

    style: str
    x: Numbers
    low: Numbers
    high: Numbers
    lying: bool = False  # bars lie along the horizontal axis; `x` is then their height


@dataclass(frozen=True)
class Heat:
    """A matrix as colours."""

    values: Numbers  # [rows, columns]
    x: Numbers | Sequence[str]  # middle or name of each column
    y: Numbers | Sequence[str]  # of each row
    colours: tuple[str, ...]  # from `low` to `high`
    low: float
    high: float
    unit: str  # of the values


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    title: str
    alt: str  # what the panel shows, in words, for readers who cannot see it
    x_label: str
    y_label: str
    size: Size = "small"
    note: str = ""  # small text at the right end of the title's line
    curves: tuple[Curve, ...] = ()
    bands: tuple[Band, ...] = ()
    dots: tuple[Dots, ...] = ()
    bars: tuple[Bars, ...] = ()
    heat: Heat | None = None
    stripes: Mapping[str, Sequence[Interval]] = field(default_factory=dict)  # style -> intervals shaded along x
    # where samples are: bin edges [k + 1] and heights [k] from 0 to 1, drawn along the bottom
    data: tuple[Numbers, Numbers] | None = None
    ticks: Ticks = ()
    y_ticks: Ticks = ()
    x_limits: Interval | None = None  # None: those of the data
    y_limits: Interval | None = None
    log_x: bool = False
    log_y: bool = False
    near_x: float = 0.0  # x is linear up to this value on both sides of 0 and logarithmic beyond; 0: linear
    near_y: float = 0.0
    rows: tuple[str, ...] = ()  # names of y = 0, 1, ... from the top; empty: y is a number
    line: float | None = None  # a marked x
    height: int = 0  # CSS pixels; 0: that of its size
    zoom: str = ""  # panels of a page with the same word are zoomed together along x; empty: this one alone

    @property
    def extent(self) -> tuple[int, int]:
        """Return width and height in CSS pixels."""
        width, height = SIZES[self.size]
        return width, self.height or height

    @property
    def page_height(self) -> int:
        """Return the height of the drawing in a page, where the title is above it."""
        return self.extent[1] - 20


@dataclass(frozen=True)
class Sheet:
    """Panels that belong together."""

    section: str  # heading of the page under which the sheet is
    name: str
    title: str
    keys: Sequence[tuple[str, str]]  # (style, meaning) of what is drawn
    panels: Sequence[Panel]
    caption: str = ""  # what to see, in a sentence or two
    folded: bool = False  # shown on demand only


def line_of(stretches: Sequence[Interval], height: float) -> tuple[Numbers, Numbers]:
    """Return a line at a height that is broken between stretches of x."""
    x = np.array([place for begin, end in stretches for place in (begin, end, np.nan)])
    return x, np.where(np.isfinite(x), float(height), np.nan)
