"""How Python calls the simulated finger: the binding of runtime/include/tendonfmu_plant.h (`_plant`).

If SUNDIALS was not found when the package was built, there is no simulated finger. `Plant` then raises
`InputError(PLANT_MISSING)`, and everything else works.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from tendonfmu._plant import Settings as Settings
    from tendonfmu._plant import Statistics as Statistics

__all__ = ["HAS_PLANT", "MEASURED", "PLANT_MISSING", "TRUE", "Plant", "PlantError", "SolverError"]

# find_spec, not try/except: a module that exists but does not load must raise its error
HAS_PLANT = find_spec("tendonfmu._plant") is not None
PLANT_MISSING = "this installation has no simulated finger (SUNDIALS was not found when it was built)"

# readings of the sensors, and the true signals; sizes as in tendonfmu_plant_signals
MEASURED = ("tendon_force", "tendon_position", "joint_position", "joint_velocity", "external_torque")
TRUE = (
    "tendon_force",
    "tendon_position",
    "joint_position",
    "joint_velocity",
    "joint_torque",
    "friction_torque",
    "external_torque",
    "inertial_torque",
    "stop_torque",
    "contact",
    "contact_force",
    "contact_point",
    "tip_position",
    "friction_level",
    "energy",
    "slack",
)
SIGNALS = (*(f"measured_{name}" for name in MEASURED), *TRUE)


def require_plant() -> None:
    """Check that this installation has a simulated finger."""
    if not HAS_PLANT:
        raise InputError(PLANT_MISSING)


if TYPE_CHECKING or HAS_PLANT:
    from tendonfmu._plant import Plant, PlantError, SolverError
else:
    PlantError = SolverError = InputError

    class Plant:
        """What this installation lacks."""

        def __init__(self, *_: Any) -> None:
            require_plant()


@contextmanager
def refused_by(rig: Path) -> Iterator[None]:
    """Turn what the plant refuses inside the block into an InputError that starts with the rig's file."""
    require_plant()
    try:
        yield
    except PlantError as refused:
        raise InputError(f"{rig}: {refused}") from None
