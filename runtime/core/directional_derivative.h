/* Directional derivative of the last sample's outputs by its inputs. */
#pragma once

#include "finger_memory.h"

/* direction and derivative as in tendonfmu.h; the finger is initialised and nothing in it changes. */
void directional_derivative(const tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                            const tendonfmu_outputs* derivative);

/* Of the sample last remembered, along a direction of the joint angles and velocities [n], of the tendon forces [m] and
 * of what the extensions remember [effect_memory]: torque [n] ∂(T − τ), jump [n] ∂Δb. Velocities count for themselves:
 * nothing of the angles' direction reaches them. */
typedef struct state_direction {
  const double *angle, *speed, *force, *memory;
} state_direction;
/* entry [2·n·m + 2·n] ∂(b·what acts) of every place (parameter_derivative.h); NULL: not wanted. */
void torque_along(const tendonfmu_finger* finger, const state_direction* direction, double* torque, double* jump,
                  double* entry);
