"""The figures of pages and notebooks, and the picture of a finger. Draws ready-made data; computes nothing.

- `figures`: traces of Plotly, panels of them, sheets of panels
- `output`: panels as JSON for a page, and as one Plotly figure for a notebook
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
        LIGHT,
        ORANGE,
        PURPLE,
        SAND,
        SILVER,
        SKIN,
        SKY,
        VERMILION,
        Interval,
        Panel,
        Sheet,
        Trace,
        band,
        bars,
        curve,
        dots,
        heat,
        histogram,
        lane,
        mark,
        panel,
        stripes,
    )
    from .finger_picture import draw_finger, draw_terminal
    from .output import IN_DARK, dark_colours, figures_json, packed_plotly, series_figure, sheets_figure

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
