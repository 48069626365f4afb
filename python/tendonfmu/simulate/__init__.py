"""The simulated finger, which shares no friction code with the model.

`rig` reads rig files, `plant` is the binding of the compiled simulation, `simulation` records, `fmu_packaging` and
`ssp` pack it for other simulators.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
