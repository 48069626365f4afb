"""Names of the FMU's inputs and outputs (contract section 4), in the order in which they are passed."""

from __future__ import annotations

INPUTS = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")
NUMBERS = ("compensated_torque", "joint_torque", "friction_torque", "bias_torque", "joint_angle", "joint_speed")
FLAGS = ("joint_contact", "contact", "slack")

# beyond the contract (docs/contract-additions.md); the FMU has the first one only
OPTIONAL_NUMBERS = ("compensated_torque_std",)  # FMUs of before have none
DETECTION = ("compensated_torque_std", "residual", "innovation", "stuck_friction", "friction_jump")

# of fingers with links, and of their FMUs
PLACE = (
    "fingertip_force",
    "fingertip_force_std",
    "fingertip_force_observable",
    "fingertip_force_misfit",
    "contact_link",
)

# inputs that a kinematics source uses
INPUTS_OF_SOURCE = {
    1: ("tendon_force", "tendon_position"),
    2: ("tendon_force", "joint_position"),
    3: ("tendon_force", "joint_position", "joint_velocity"),
}
