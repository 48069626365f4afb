/* The quad of this source: plain C, unless the source defines TENDONFMU_QUAD_SSE2 or TENDONFMU_QUAD_AVX2 before. */
#pragma once

#if defined(TENDONFMU_QUAD_AVX2)
#include "quad_avx2.h"
#elif defined(TENDONFMU_QUAD_SSE2)
#include "quad_sse2.h"
#else
#include "quad_plain.h"
#endif
