/* Directional derivative of the last sample's outputs by its inputs. */
#ifndef TENDONFMU_DIRECTIONAL_DERIVATIVE_H
#define TENDONFMU_DIRECTIONAL_DERIVATIVE_H

#include "finger_memory.h"

/* direction and derivative as in tendonfmu.h; the finger is initialised and nothing in it changes. */
void directional_derivative(const tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                            const tendonfmu_outputs* derivative);

/* Of the sample last remembered, along a direction of the joint angles and velocities [n] and of the tendon forces [m]:
 * torque [n] ∂(T − τ), jump [n] ∂Δb. Velocities count for themselves: nothing of the angles' direction reaches them. */
void torque_along(const tendonfmu_finger* finger, const double* angle, const double* speed, const double* force,
                  double* torque, double* jump);

#endif
