"""Pages, figures and texts of every command. Computes nothing that is not only for showing.

`*_text` are sentences and rows, `*_figures` ready-made figures, `*_plots` draw them, `*_page` and `*_files` write
pages and folders.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
