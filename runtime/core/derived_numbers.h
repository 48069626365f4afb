/* The one place where all numbers that follow from the parameters are computed. */
#ifndef TENDONFMU_DERIVED_NUMBERS_H
#define TENDONFMU_DERIVED_NUMBERS_H

#include "finger_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Recomputes finger->derived from finger->parameters: at creation, and after parameters were written or restored.
 * R⁺ is only computed again where `routing_changed`. */
void derive_numbers(tendonfmu_finger* finger, int routing_changed);

/* Makes the next sample look at all laws anew. */
void forget_views(tendonfmu_finger* finger);

#ifdef __cplusplus
}
#endif

#endif
