/* exp(−x) of the plain kernel as a function, for exponential_test.cpp. */
#include "floating_point.h"

#include "exponential.h"
#include "exponential_kernels.h"

void exponential_plain(const double* x, double* result, size_t count) {
  for (size_t i = 0; i < count; i += QUAD_LANES) {
    quad_store(result + i, exp_of_minus(quad_load(x + i)));
  }
}
