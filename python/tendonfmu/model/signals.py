"""Names of the FMU's inputs and outputs (docs/reference/recordings.md), in the order in which they are passed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

INPUTS = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")
NUMBERS = ("compensated_torque", "joint_torque", "friction_torque", "bias_torque", "joint_angle", "joint_speed")
FLAGS = ("joint_contact", "contact", "slack")

# for those who tune (docs/reference/semantics.md#outputs); the FMU has the first one only
OPTIONAL_NUMBERS = ("compensated_torque_std",)  # older FMUs have none
DETECTION = ("compensated_torque_std", "residual", "innovation", "stuck_friction", "friction_jump", "drift")

# of fingers with links, and of their FMUs
PLACE = (
    "fingertip_force",
    "fingertip_force_std",
    "fingertip_force_observable",
    "fingertip_force_misfit",
    "contact_link",
)

# of fingers with contact.rest, and of their FMUs
REST = ("contact_change", "contact_at_rest")

# of fingers with sensor_fault, and of their FMUs
SENSORS = ("sensor_fault", "contact_observable")

# inputs that a kinematics source uses
INPUTS_OF_SOURCE = {
    1: ("tendon_force", "tendon_position"),
    2: ("tendon_force", "joint_position"),
    3: ("tendon_force", "joint_position", "joint_velocity"),
}


def inputs_used(source: int, watches_motors: bool) -> tuple[str, ...]:
    """Inputs that a kinematics source uses, and contact.rest and sensor_fault where the finger has one of them."""
    used = INPUTS_OF_SOURCE[source]
    return used if "tendon_position" in used or not watches_motors else (*used, "tendon_position")


def watches_motors(data: Mapping[str, Any]) -> bool:
    """Whether a finger of this description needs tendon positions with every kinematics source."""
    return (data.get("contact") or {}).get("rest") is not None or data.get("sensor_fault") is not None
