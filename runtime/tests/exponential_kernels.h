/* exp(−x) as each kernel computes it. x and result [count], aligned to 32 bytes; count is a multiple of 4. */
#pragma once

#include <stddef.h>

void exponential_plain(const double* x, double* result, size_t count);
void exponential_vector(const double* x, double* result, size_t count);
void exponential_avx2(const double* x, double* result, size_t count);
