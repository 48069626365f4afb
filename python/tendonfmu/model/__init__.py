"""The finger: its description and the compiled model.

`description` reads a finger description, `native` is the binding of the C runtime, through which every call of the
model goes. Beside them: the places of friction (`friction_places`), extensions, quasi-static balance, the geometry of
the routing, and what a valid description says that no finger has (`plausibility`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
