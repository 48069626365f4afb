"""How a finger is simulated, without any friction code of the model.

`rig` reads rig files, `plant` is the binding of the compiled simulation, `simulation` records, and `fmu_packaging` and
`ssp` package it for other simulators.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
