/* The kernels, and which of them may run here. */
#ifndef TENDONFMU_KERNEL_CHOICE_H
#define TENDONFMU_KERNEL_CHOICE_H

#include "finger_memory.h"

struct step_kernel {
  const char* name;
  /* Takes the sample whose inputs stand in scratch; 0, or −1 when it overflows and nothing was remembered. */
  int (*take_sample)(tendonfmu_finger* finger, double time);
};

/* The fastest kernel that processor and operating system allow ("auto"), or the one of that name; NULL where it cannot
 * run or is not built in. */
const step_kernel* kernel_choose(const char* name);

#endif
