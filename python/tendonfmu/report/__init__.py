"""Pages, figures and texts of every command. Computes only what is needed to show results.

- `*_text`: sentences and table rows
- `*_figures`: figures ready to be drawn; `*_plots` draws them
- `*_page`, `*_files`: pages and folders of files
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
