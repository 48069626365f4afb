"""The figures of pages and notebooks, and the picture of a finger. Draws ready-made data; computes nothing.

- `figures`: traces of Plotly, panels of them, sheets of panels; as JSON for a page, or as a figure for a notebook
- `finger_picture`: draws what an FMU carries, with Pillow
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .figures import (
        BLUE,
        COLOURS,
        DARK,
        DIVERGING,
        GREEN,
        GREY,
        ORANGE,
        SAND,
        SILVER,
        SKY,
        VERMILION,
        Interval,
        Panel,
        Sheet,
        Trace,
        band,
        bars,
        curve,
        dark_colours,
        dots,
        figures_json,
        heat,
        histogram,
        lane,
        mark,
        packed_plotly,
        panel,
        series_figure,
        sheets_figure,
        stripes,
    )
    from .finger_picture import draw_finger, draw_terminal

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
