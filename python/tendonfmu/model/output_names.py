# Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit.
"""Names of a finger's inputs and outputs, by what they are; docs/reference/fmu_variables.md says what each means."""

from __future__ import annotations

INPUTS = (
    "tendon_force",
    "tendon_position",
    "joint_position",
    "joint_velocity",
)

# numbers of every finger that have a directional derivative
NUMBERS = (
    "compensated_torque",
    "joint_torque",
    "friction_torque",
    "bias_torque",
    "joint_angle",
    "joint_speed",
)

# flags of every finger
FLAGS = (
    "joint_contact",
    "contact",
    "slack",
)

# numbers without a derivative; FMUs of older versions lack them
OPTIONAL_NUMBERS = (
    "compensated_torque_std",
    "residual",
    "contact_level",
)

# of fingers with links, and of their FMUs
PLACE = (
    "fingertip_force",
    "fingertip_force_std",
    "fingertip_force_observable",
    "fingertip_force_misfit",
    "contact_link",
)

# of fingers with sensor_fault, and of their FMUs
SENSORS = (
    "sensor_fault",
    "contact_observable",
)

# outputs that are vectors in space
VECTORS = (
    "fingertip_force",
    "fingertip_force_std",
)
