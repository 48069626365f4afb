"""How a finger is simulated, without any friction code of the model.

`rig` reads rig files, `plant` is the binding of the compiled simulation, `simulation` records, and `fmu_packaging` and
`ssp` package it for other simulators.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .fmu_packaging import build_plant_fmu
    from .plant import require_plant
    from .rig import describe_rig, description_files, is_rig, read_rig
    from .simulation import simulate

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
