/* exp(−x) as each kernel computes it. x and result [count], aligned to 32 bytes; count is a multiple of 4. */
#ifndef TENDONFMU_EXPONENTIAL_KERNELS_H
#define TENDONFMU_EXPONENTIAL_KERNELS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

void exponential_plain(const double* x, double* result, size_t count);
void exponential_sse2(const double* x, double* result, size_t count);
void exponential_avx2(const double* x, double* result, size_t count);

#ifdef __cplusplus
}
#endif

#endif
