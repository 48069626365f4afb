/* The kernels, and which of them may run here. */
#ifndef TENDONFMU_KERNEL_CHOICE_H
#define TENDONFMU_KERNEL_CHOICE_H

#include "finger_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Beyond this, in magnitude, no input is a measurement; below it no product in a step overflows for sane parameters. */
#define LARGEST_INPUT 1e12

#define LARGEST_TIME 1e15 /* s */

typedef enum sample_result { SAMPLE_TAKEN, SAMPLE_OUT_OF_RANGE, SAMPLE_OVERFLOWS } sample_result;

struct step_kernel {
  const char* name;
  /* Takes the sample whose inputs stand in scratch; unless SAMPLE_TAKEN is returned, nothing is remembered. */
  sample_result (*take_sample)(tendonfmu_finger* finger, double time);
};

/* The fastest kernel that processor and operating system allow ("auto"), or the one of that name; NULL where it cannot
 * run or is not built in. */
const step_kernel* kernel_choose(const char* name);

#ifdef __cplusplus
}
#endif

#endif
