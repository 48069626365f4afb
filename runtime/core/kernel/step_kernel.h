/* A kernel of the lanes that the source asks for (quad.h). */
#pragma once

#include "force_propagation.h"
#include "kernel_choice.h"
#include "kinematics.h"

#define STEP_KERNEL(name) \
  { name, multiply, tendon_velocities, find_friction, remember_slots, restart_rests }
