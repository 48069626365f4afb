/* The model of the friction FMU: a finger of tendonfmu.h. */
#pragma once

#include "model.h"
#include "tendonfmu.h"

/* For what is not the same in every FMU: derivatives. */
tendonfmu_finger* model_finger(const model* m);
double* model_derivatives(const model* m); /* room for one number of each Real input and output */
