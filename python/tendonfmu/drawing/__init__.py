"""Draws figures from ready-made data; computes nothing.

- `panel_data`: what a figure shows
- `interactive`: draws it for pages, with Plotly
- `panels`: draws it as PNG files, with matplotlib
- `panel_styles`, `plot_style`: colours and sizes
- `finger_picture`, `terminal_picture`: draw what an FMU shows, with Pillow (`raster`)
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .figure_grid import SeriesRow, series_figure, sheets_figure
    from .finger_picture import EDGE_RED, draw_finger
    from .interactive import dark_colours, figures_json, height_in_page, packed_plotly
    from .panel_data import Band, Bars, Curve, Dots, Interval, MatrixPanel, Panel, Sheet
    from .panel_styles import BLUE, DARK, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKIN, SKY, STYLES, VERMILION, size_of
    from .panels import draw_panel, write_sheet
    from .plot_style import Target, clean, save
    from .terminal_picture import draw_terminal

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
