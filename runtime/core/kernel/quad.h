/* The quad of this source: one double in plain C, or four side by side where the source defines TENDONFMU_QUAD_SSE2 or
 * TENDONFMU_QUAD_AVX2 before. */
#pragma once

#if defined(TENDONFMU_QUAD_AVX2)
#include "quad_avx2.h"
#elif defined(TENDONFMU_QUAD_SSE2)
#include "quad_sse2.h"
#else
#include "quad_plain.h"
#endif

#if defined(TENDONFMU_QUAD_AVX2) || defined(TENDONFMU_QUAD_SSE2)

enum { QUAD_LANES = 4, QUAD_ALL = 15 };

HOT_INLINE void quad_sums_begin(quad_sums* sums, size_t i, quad a) {
  (void)i;
  *sums = a;
}

HOT_INLINE void quad_sums_add(quad_sums* sums, size_t i, quad a) {
  (void)i;
  *sums = quad_add(*sums, a);
}

#endif

HOT_INLINE void quad_sums_clear(quad_sums* sums) {
  for (size_t i = 0; i < 4; i += QUAD_LANES) {
    quad_sums_begin(sums, i, quad_set(0.0));
  }
}
