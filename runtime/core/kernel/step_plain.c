/* The step in plain C, for any machine. */
#include "floating_point.h"

#include "step_kernel.h"

const step_kernel step_plain = STEP_KERNEL("plain");
