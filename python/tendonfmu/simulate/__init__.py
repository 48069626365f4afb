"""How a finger is simulated, without any friction code of the model.

`rig` reads rig files, `plant` is the binding of the compiled simulation, `simulation` records, and `ssp`
packages it for other simulators.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .plant import require_plant
    from .rig import describe_rig, description_files, finger_with_limits, is_rig, read_rig
    from .simulation import simulate
    from .ssp import build_plant_fmu

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
