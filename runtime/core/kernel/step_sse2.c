/* The step on SSE2, which every x86-64 processor has. */
#include "floating_point.h"

#if defined(__x86_64__) || defined(_M_X64)

#define TENDONFMU_QUAD_SSE2
#include "step_kernel.h"
#include "step_kernels.h"

const step_kernel step_sse2 = {"sse2", take_sample};

#endif
