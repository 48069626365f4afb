/* The one place where all numbers that follow from the parameters are computed. */
#pragma once

#include "finger_memory.h"

/* Recomputes finger->derived from finger->parameters: at creation, and after parameters were written or restored.
 * R⁺ is only computed again where `routing_changed`. */
void derive_numbers(tendonfmu_finger* finger, int routing_changed);

/* Copies parameters and all that follows from them, of a finger of the same image. */
void take_prepared_numbers(tendonfmu_finger* finger, const tendonfmu_finger* prepared);

/* Makes the next sample look at all laws anew. */
void forget_views(tendonfmu_finger* finger);
