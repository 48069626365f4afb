"""Draws figures from ready-made data; computes nothing.

- `panel`: what a figure shows, with its colours and sizes
- `figures`: makes it as a Plotly figure, which pages embed; `grid`: several in one, for notebooks
- `finger_picture`: draws what an FMU carries, with Pillow
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .figures import dark_colours, figures_json, figures_of, packed_plotly
    from .finger_picture import draw_finger, draw_terminal
    from .grid import SeriesRow, series_figure, sheets_figure
    from .panel import (
        BLUE,
        DARK,
        DIVERGING,
        GREEN,
        GREY,
        IN_DARK,
        LIGHT,
        ORANGE,
        SKY,
        STYLES,
        VERMILION,
        Band,
        Bars,
        Curve,
        Dots,
        Heat,
        Interval,
        Panel,
        Sheet,
        line_of,
    )

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
