/* Inputs and outputs of a finger (tendonfmu.h) as they lie in the block of variables. */
#pragma once

#include "tendonfmu.h"
#include "variables.h"

/* Views of the block. */
tendonfmu_inputs variables_inputs(const variables* v);
tendonfmu_outputs variables_outputs(const variables* v);

/* Copies the outputs of the last sample into the block. */
void variables_fetch_outputs(variables* v, const tendonfmu_finger* finger);
