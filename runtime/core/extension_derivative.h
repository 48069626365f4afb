/* The part of the parameters' derivative that the extensions make (parameter_derivative.h). */
#ifndef TENDONFMU_EXTENSION_DERIVATIVE_H
#define TENDONFMU_EXTENSION_DERIVATIVE_H

#include "parameter_derivative.h"

/* Appends the slopes by every number of every extension to the plain terms; the places are read already. */
void extension_derivative_read(const tendonfmu_finger* finger, parameter_derivative* derivative);

#endif
