/* The step on AVX2. The pragmas stand for -mavx2, so that a source FMU needs no flag for this one file; kernel_choice.c
 * sees to it that the code is only entered where it can run. */
#include "floating_point.h"

#if defined(__GNUC__) && defined(__x86_64__)

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif

#define TENDONFMU_QUAD_AVX2
#define TENDONFMU_QUAD_LANES 4
#include "force_propagation.h"

const step_kernel step_avx2 = STEP_KERNEL("avx2");

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

#endif
