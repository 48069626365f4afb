/* exp(−x) of the sse2 kernel as a function, for exponential_test.cpp. */
#include "floating_point.h"

#if defined(__x86_64__) || defined(_M_X64)

#define TENDONFMU_QUAD_SSE2
#include "exponential.h"
#include "exponential_kernels.h"

void exponential_sse2(const double* x, double* result, size_t count) {
  for (size_t i = 0; i < count; i += QUAD_LANES) {
    quad_store(result + i, exp_of_minus(quad_load(x + i)));
  }
}

#endif
