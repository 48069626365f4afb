/* The step on AVX2. The pragmas stand for -mavx2, so that a source FMU needs no flag for this one file; kernel_choice.c
 * sees to it that the code is only entered where it can run. */
#include "floating_point.h"

#if defined(__x86_64__) || defined(_M_X64)

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC target("avx2")
#endif

#define TENDONFMU_QUAD_AVX2
#include "step_kernel.h"
#include "step_kernels.h"

const step_kernel step_avx2 = {"avx2", take_sample};

#if defined(__clang__)
#pragma clang attribute pop
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif

#endif
