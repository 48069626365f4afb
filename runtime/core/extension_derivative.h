/* The part of the parameters' derivative that the extensions make (parameter_derivative.h). */
#pragma once

#include "parameter_derivative.h"

/* Appends the slopes by every number of every extension to the plain terms; the places are read already. */
void extension_derivative_read(const tendonfmu_finger* finger, parameter_derivative* derivative);

/* F and b of one place by the numbers of one friction row. */
typedef struct place_slopes {
  double friction[EFFECT_MAX_PARAMETERS], jump[EFFECT_MAX_PARAMETERS];
} place_slopes;

/* Of the row_number-th friction row (extensions.h), after the derivative was read; zeros where it does not act there.
 */
void extension_place_slopes(const tendonfmu_finger* finger, const parameter_derivative* derivative, size_t row_number,
                            size_t place, place_slopes* slopes);

/* ∂(b·what acts) of every place [places] by number k of the row_number-th signal row. */
void extension_entry_slopes(const tendonfmu_finger* finger, size_t row_number, uint32_t k, double* entry);
