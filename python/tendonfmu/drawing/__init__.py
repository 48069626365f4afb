"""Draws what it is given; computes nothing.

`panel_data` says what a figure shows, `interactive` draws it for pages, with Plotly, and `panels` as PNG files, with
matplotlib; `panel_styles` and `plot_style` hold colours and sizes. `finger_picture` draws the routing of a finger.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
