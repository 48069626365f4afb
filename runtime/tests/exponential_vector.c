/* exp(−x) of the kernel on vectors as a function, for exponential_test.cpp. */
#include "floating_point.h"

#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__))

#if defined(__clang__)
#pragma clang diagnostic ignored "-Wpsabi" /* nothing of it leaves this file */
#define TENDONFMU_QUAD_LANES 4             /* two vectors side by side, which GCC would move through memory */
#else
#define TENDONFMU_QUAD_LANES 2
#endif
#include "exponential.h"
#include "exponential_kernels.h"

void exponential_vector(const double* x, double* result, size_t count) {
  for (size_t i = 0; i < count; i += QUAD_LANES) {
    quad_store(result + i, exp_of_minus(quad_load(x + i)));
  }
}

#endif
