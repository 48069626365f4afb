"""What a finger is: its description and the compiled model.

`description` reads a finger description. `native` is the binding of the C runtime; every call of the model goes through
it. Other modules hold the places of friction (`friction_places`), extensions, quasi-static balance, the geometry of the
routing, and checks for implausible but valid descriptions (`plausibility`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
