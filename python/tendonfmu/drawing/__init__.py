"""The figures of pages and notebooks. Draws ready-made data; computes nothing.

`figures` has traces of Plotly, panels of them, sheets of panels; as JSON for a page, or as a figure for a notebook.
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

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
