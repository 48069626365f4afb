/* The step on vectors of the kind that every x86-64 and every 64-bit ARM processor has. */
#include "floating_point.h"

#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__))

#if defined(__clang__)
#pragma clang diagnostic ignored "-Wpsabi" /* nothing of it leaves this file */
#define TENDONFMU_QUAD_LANES 4             /* two vectors side by side, which GCC would move through memory */
#else
#define TENDONFMU_QUAD_LANES 2
#endif
#include "force_propagation.h"

#if defined(__x86_64__)
const step_kernel step_vector = STEP_KERNEL("sse2");
#else
const step_kernel step_vector = STEP_KERNEL("neon");
#endif

#endif
