"""Recordings: read, checked and made ready.

`recording` reads them, `converters` brings foreign formats into ours, `match` says whether they belong to a finger,
and why not. `smoothing`, `prepared` and `residuals` make them ready for a fit and say what a finger leaves of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
