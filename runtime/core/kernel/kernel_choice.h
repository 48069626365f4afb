/* The kernels, and which of them may run here. */
#pragma once

#include "finger_memory.h"

typedef enum sample_result { SAMPLE_TAKEN, SAMPLE_OUT_OF_RANGE, SAMPLE_OVERFLOWS } sample_result;

struct step_kernel {
  const char* name;
  /* Takes the sample whose inputs stand in scratch; unless SAMPLE_TAKEN is returned, nothing is remembered. */
  sample_result (*take_sample)(tendonfmu_finger* finger, double time);
};

/* The fastest kernel that processor and operating system allow ("auto"), or the one of that name; NULL where it cannot
 * run or is not built in. */
const step_kernel* kernel_choose(const char* name);

/* Whether the compiler has kept the order of sums and the rounding of products. */
int kernel_rounds_as_written(void);
