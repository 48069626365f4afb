"""How recordings are read, checked and prepared for a fit.

`recording` reads them and `converters` turns foreign formats into ours. `match` says whether they belong to a finger,
and if not, why. `smoothing`, `prepared` and `residuals` prepare them for a fit and compute the torque that a finger
leaves unexplained.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
