/* The step in plain C, for any machine. */
#include "floating_point.h"

#include "step_kernel.h"
#include "step_kernels.h"

const step_kernel step_plain = {"plain", take_sample};
