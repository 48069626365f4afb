/* The step in plain C, for any machine. */
#include "floating_point.h"

#include "force_propagation.h"

const step_kernel step_plain = STEP_KERNEL("plain");
