"""Names of the FMU's inputs and outputs (docs/reference/fmu_variables.md), and which inputs a finger uses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.model.output_names import (
    DETECTION,
    FLAGS,
    INPUTS,
    NUMBERS,
    OPTIONAL_NUMBERS,
    PLACE,
    REST,
    SENSORS,
    VECTORS,
)

__all__ = [
    "DETECTION",
    "FLAGS",
    "INPUTS",
    "INPUTS_OF_SOURCE",
    "NUMBERS",
    "OPTIONAL_NUMBERS",
    "PLACE",
    "REST",
    "SENSORS",
    "VECTORS",
    "inputs_used",
    "watches_motors",
]


# inputs that a kinematics source uses
INPUTS_OF_SOURCE = {
    1: ("tendon_force", "tendon_position"),
    2: ("tendon_force", "joint_position"),
    3: ("tendon_force", "joint_position", "joint_velocity"),
}


def inputs_used(source: int, watches_motors: bool) -> tuple[str, ...]:
    """Return the inputs that a finger needs."""
    used = INPUTS_OF_SOURCE[source]
    return used if "tendon_position" in used or not watches_motors else (*used, "tendon_position")


def watches_motors(data: Mapping[str, Any]) -> bool:
    """Return whether a finger needs tendon positions with every kinematics source."""
    return (data.get("contact") or {}).get("rest") is not None or data.get("sensor_fault") is not None
