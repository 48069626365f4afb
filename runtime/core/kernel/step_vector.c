/* The step on vectors of two doubles, which every x86-64 and every 64-bit ARM processor has. */
#include "floating_point.h"

#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__))

#define TENDONFMU_QUAD_LANES 2
#include "step_kernel.h"

#if defined(__x86_64__)
const step_kernel step_vector = STEP_KERNEL("sse2");
#else
const step_kernel step_vector = STEP_KERNEL("neon");
#endif

#endif
