/* Directional derivative of the last sample's outputs by its inputs. */
#pragma once

#include "finger_memory.h"

/* direction and derivative as in tendonfmu.h; the finger is initialised and nothing in it changes. */
void directional_derivative(const tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                            const tendonfmu_outputs* derivative);
