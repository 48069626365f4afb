"""Draws figures from ready-made data; computes nothing.

- `panel_data`: what a figure shows
- `interactive`: draws it for pages, with Plotly
- `panels`: draws it as PNG files, with matplotlib
- `panel_styles`, `plot_style`: colours and sizes
- `finger_picture`, `terminal_picture`: draw what an FMU shows, with Pillow (`raster`)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
