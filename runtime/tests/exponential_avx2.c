/* exp(−x) of the avx2 kernel as a function, for exponential_test.cpp. */
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
#include "exponential.h"
#include "exponential_kernels.h"

void exponential_avx2(const double* x, double* result, size_t count) {
  for (size_t i = 0; i < count; i += QUAD_LANES) {
    quad_store(result + i, exp_of_minus(quad_load(x + i)));
  }
}

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

#endif
