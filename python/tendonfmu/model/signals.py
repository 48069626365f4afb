"""Which inputs and outputs the FMU has (docs/reference/recordings.md), in the order in which they are passed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

INPUTS = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")
NUMBERS = ("compensated_torque", "joint_torque", "friction_torque", "bias_torque", "joint_angle", "joint_speed")
FLAGS = ("joint_contact", "contact", "slack")

# needed for tuning (docs/reference/semantics.md#outputs); the FMU has the first one only
OPTIONAL_NUMBERS = ("compensated_torque_std",)  # older FMUs lack it
DETECTION = ("compensated_torque_std", "residual", "innovation", "stuck_friction", "friction_jump", "drift")

# only of fingers with links, and of their FMUs
PLACE = (
    "fingertip_force",
    "fingertip_force_std",
    "fingertip_force_observable",
    "fingertip_force_misfit",
    "contact_link",
)

# only of fingers with contact.rest, and of their FMUs
REST = ("contact_change", "contact_at_rest")

# only of fingers with sensor_fault, and of their FMUs
SENSORS = ("sensor_fault", "contact_observable")

# inputs that a kinematics source uses
INPUTS_OF_SOURCE = {
    1: ("tendon_force", "tendon_position"),
    2: ("tendon_force", "joint_position"),
    3: ("tendon_force", "joint_position", "joint_velocity"),
}


def inputs_used(source: int, watches_motors: bool) -> tuple[str, ...]:
    """Return the inputs that a finger needs.

    Parameters
    ----------
    source
        Kinematics, 1 to 3.
    watches_motors
        Whether the finger has contact.rest or sensor_fault, which need tendon positions.

    Returns
    -------
    tuple of str
        Names of the groups.
    """
    used = INPUTS_OF_SOURCE[source]
    return used if "tendon_position" in used or not watches_motors else (*used, "tendon_position")


def watches_motors(data: Mapping[str, Any]) -> bool:
    """Return whether a finger needs tendon positions with every kinematics source.

    Parameters
    ----------
    data
        A valid finger description.

    Returns
    -------
    bool
        True if it has contact.rest or sensor_fault.
    """
    return (data.get("contact") or {}).get("rest") is not None or data.get("sensor_fault") is not None
