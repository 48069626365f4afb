"""Colours, styles and sizes of panels, for every way of drawing them.

The colours are those of Okabe and Ito, which colour-blind readers can distinguish.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tendonfmu.drawing.panel_data import MatrixPanel, Panel

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
}

SIZES = {"small": (370, 250), "medium": (560, 250), "large": (560, 400)}  # CSS pixels


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
    "unidentified": Style(VERMILION, 0.0, filled=False),
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
    "positive": Style("#B2182B", patch=True),
    "uncorrelated": Style("#FFFFFF", patch=True),
    "opposed": Style("#2166AC", patch=True),
}


def size_of(panel: Panel | MatrixPanel) -> tuple[int, int]:
    """Return width and height of a panel in CSS pixels."""
    width, height = SIZES[panel.size]
    return (width, panel.height) if isinstance(panel, Panel) and panel.height else (width, height)
