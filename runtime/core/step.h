/* One sample of the finger, as a recipe. */
#pragma once

#include "finger_memory.h"

typedef enum sample_result { SAMPLE_TAKEN, SAMPLE_OUT_OF_RANGE, SAMPLE_OVERFLOWS } sample_result;

/* Takes the sample whose inputs stand in scratch; unless SAMPLE_TAKEN is returned, nothing is remembered. */
sample_result take_sample(tendonfmu_finger* finger, double time);
