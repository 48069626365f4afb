/* Four doubles side by side in two SSE2 registers: baseline x86-64. The meaning of each call is in quad_plain.h. */
#pragma once

#include <emmintrin.h>

#include "inlining.h"

typedef struct quad {
  __m128d low, high;
} quad;
typedef quad quad_mask;
typedef quad quad_sums;

#define QUAD_BOTH_HALVES(operation, a, b) ((quad){operation((a).low, (b).low), operation((a).high, (b).high)})

HOT_INLINE quad quad_load(const double* from) {
  return (quad){_mm_load_pd(from), _mm_load_pd(from + 2)};
}

HOT_INLINE void quad_store(double* to, quad a) {
  _mm_store_pd(to, a.low);
  _mm_store_pd(to + 2, a.high);
}

HOT_INLINE quad quad_set(double x) {
  return (quad){_mm_set1_pd(x), _mm_set1_pd(x)};
}

#define QUAD_CALL(name, operation)            \
  HOT_INLINE quad name(quad a, quad b) {      \
    return QUAD_BOTH_HALVES(operation, a, b); \
  }

QUAD_CALL(quad_add, _mm_add_pd)
QUAD_CALL(quad_sub, _mm_sub_pd)
QUAD_CALL(quad_mul, _mm_mul_pd)
QUAD_CALL(quad_div, _mm_div_pd)
QUAD_CALL(quad_min, _mm_min_pd)
QUAD_CALL(quad_max, _mm_max_pd)
QUAD_CALL(quad_both, _mm_and_pd)
QUAD_CALL(quad_either, _mm_or_pd)
QUAD_CALL(quad_differ, _mm_xor_pd)
QUAD_CALL(quad_keep, _mm_and_pd)
QUAD_CALL(quad_drop, _mm_andnot_pd)
QUAD_CALL(quad_greater, _mm_cmpgt_pd)
QUAD_CALL(quad_at_least, _mm_cmpge_pd)

HOT_INLINE quad_mask quad_only_first(quad_mask a, quad_mask b) {
  return quad_drop(b, a);
}

HOT_INLINE quad quad_abs(quad a) {
  const quad sign = quad_set(-0.0);
  return QUAD_BOTH_HALVES(_mm_andnot_pd, sign, a);
}

HOT_INLINE quad quad_with_sign(quad a, quad sign) {
  const quad bit = quad_set(-0.0);
  const quad flip = QUAD_BOTH_HALVES(_mm_and_pd, bit, sign);
  return QUAD_BOTH_HALVES(_mm_xor_pd, a, flip);
}

HOT_INLINE int quad_mask_bits(quad_mask m) {
  return _mm_movemask_pd(m.low) | _mm_movemask_pd(m.high) << 2;
}

HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
  const quad first = quad_keep(m, a);
  const quad second = QUAD_BOTH_HALVES(_mm_andnot_pd, m, b);
  return QUAD_BOTH_HALVES(_mm_or_pd, first, second);
}

HOT_INLINE double quad_sum(const quad_sums* sums) {
  const quad a = *sums;
  const __m128d s = _mm_add_pd(a.low, a.high);
  return _mm_cvtsd_f64(_mm_add_sd(s, _mm_unpackhi_pd(s, s)));
}

HOT_INLINE __m128d quad_two_sums(quad a, quad b) {
  const __m128d s = _mm_add_pd(a.low, a.high), t = _mm_add_pd(b.low, b.high);
  return _mm_add_pd(_mm_unpacklo_pd(s, t), _mm_unpackhi_pd(s, t));
}

HOT_INLINE quad quad_sum_rows(const quad_sums row[4]) {
  return (quad){quad_two_sums(row[0], row[1]), quad_two_sums(row[2], row[3])};
}

HOT_INLINE __m128d quad_scale_half(__m128d a, __m128d shifted) {
  return _mm_castsi128_pd(_mm_add_epi64(_mm_castpd_si128(a), _mm_slli_epi64(_mm_castpd_si128(shifted), 52)));
}

HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return QUAD_BOTH_HALVES(quad_scale_half, a, shifted);
}
