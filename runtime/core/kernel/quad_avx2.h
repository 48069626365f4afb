/* Four doubles side by side in one AVX2 register. The meaning of each call is in quad_plain.h. */
#pragma once

#include <immintrin.h>

#include "inlining.h"

typedef __m256d quad;
typedef __m256d quad_mask;
typedef __m256d quad_sums;

HOT_INLINE quad quad_load(const double* from) {
  return _mm256_load_pd(from);
}

HOT_INLINE void quad_store(double* to, quad a) {
  _mm256_store_pd(to, a);
}

HOT_INLINE quad quad_set(double x) {
  return _mm256_set1_pd(x);
}

#define QUAD_CALL(name, operation)       \
  HOT_INLINE quad name(quad a, quad b) { \
    return operation(a, b);              \
  }

QUAD_CALL(quad_add, _mm256_add_pd)
QUAD_CALL(quad_sub, _mm256_sub_pd)
QUAD_CALL(quad_mul, _mm256_mul_pd)
QUAD_CALL(quad_div, _mm256_div_pd)
QUAD_CALL(quad_min, _mm256_min_pd)
QUAD_CALL(quad_max, _mm256_max_pd)
QUAD_CALL(quad_both, _mm256_and_pd)
QUAD_CALL(quad_either, _mm256_or_pd)
QUAD_CALL(quad_differ, _mm256_xor_pd)
QUAD_CALL(quad_keep, _mm256_and_pd)
QUAD_CALL(quad_drop, _mm256_andnot_pd)

HOT_INLINE quad_mask quad_only_first(quad_mask a, quad_mask b) {
  return quad_drop(b, a);
}

HOT_INLINE quad_mask quad_greater(quad a, quad b) {
  return _mm256_cmp_pd(a, b, _CMP_GT_OQ);
}

HOT_INLINE quad_mask quad_at_least(quad a, quad b) {
  return _mm256_cmp_pd(a, b, _CMP_GE_OQ);
}

HOT_INLINE quad quad_abs(quad a) {
  return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a);
}

HOT_INLINE quad quad_with_sign(quad a, quad sign) {
  return _mm256_xor_pd(a, _mm256_and_pd(_mm256_set1_pd(-0.0), sign));
}

HOT_INLINE int quad_mask_bits(quad_mask m) {
  return _mm256_movemask_pd(m);
}

HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
  return _mm256_blendv_pd(b, a, m);
}

HOT_INLINE double quad_sum(const quad_sums* sums) {
  const quad a = *sums;
  const __m128d s = _mm_add_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
  return _mm_cvtsd_f64(_mm_add_sd(s, _mm_unpackhi_pd(s, s)));
}

/* {a0 + a2, a1 + a3, b0 + b2, b1 + b3} */
HOT_INLINE quad quad_half_sums(quad a, quad b) {
  return _mm256_add_pd(_mm256_permute2f128_pd(a, b, 0x20), _mm256_permute2f128_pd(a, b, 0x31));
}

HOT_INLINE quad quad_sum_rows(const quad_sums row[4]) {
  const quad even = quad_half_sums(row[0], row[2]), odd = quad_half_sums(row[1], row[3]);
  return _mm256_add_pd(_mm256_unpacklo_pd(even, odd), _mm256_unpackhi_pd(even, odd));
}

HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return _mm256_castsi256_pd(
      _mm256_add_epi64(_mm256_castpd_si256(a), _mm256_slli_epi64(_mm256_castpd_si256(shifted), 52)));
}
