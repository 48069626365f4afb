/* Four doubles side by side in one AVX2 register. The meaning of each call is in quad_plain.h. */
#pragma once

#include <immintrin.h>

#include "inlining.h"

typedef __m256d quad;
typedef __m256d quad_mask;

HOT_INLINE quad quad_load(const double* from) {
  return _mm256_load_pd(from);
}

HOT_INLINE void quad_store(double* to, quad a) {
  _mm256_store_pd(to, a);
}

HOT_INLINE quad quad_of_halves(const double* low, const double* high) {
  return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(low)), _mm_loadu_pd(high), 1);
}

HOT_INLINE void quad_load_pairs(const double* const from[4], quad* first, quad* second) {
  const quad a = quad_of_halves(from[0], from[2]), b = quad_of_halves(from[1], from[3]);
  *first = _mm256_unpacklo_pd(a, b);
  *second = _mm256_unpackhi_pd(a, b);
}

HOT_INLINE void quad_store_lanes(double* const to[4], const quad row[4]) {
  const quad even01 = _mm256_unpacklo_pd(row[0], row[1]), odd01 = _mm256_unpackhi_pd(row[0], row[1]);
  const quad even23 = _mm256_unpacklo_pd(row[2], row[3]), odd23 = _mm256_unpackhi_pd(row[2], row[3]);
  _mm256_storeu_pd(to[0], _mm256_permute2f128_pd(even01, even23, 0x20));
  _mm256_storeu_pd(to[1], _mm256_permute2f128_pd(odd01, odd23, 0x20));
  _mm256_storeu_pd(to[2], _mm256_permute2f128_pd(even01, even23, 0x31));
  _mm256_storeu_pd(to[3], _mm256_permute2f128_pd(odd01, odd23, 0x31));
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

HOT_INLINE quad quad_sqrt(quad a) {
  return _mm256_sqrt_pd(a);
}

HOT_INLINE double quad_sum(quad a) {
  const __m128d s = _mm_add_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
  return _mm_cvtsd_f64(_mm_add_sd(s, _mm_unpackhi_pd(s, s)));
}

/* {a0 + a2, a1 + a3, b0 + b2, b1 + b3} */
HOT_INLINE quad quad_half_sums(quad a, quad b) {
  return _mm256_add_pd(_mm256_permute2f128_pd(a, b, 0x20), _mm256_permute2f128_pd(a, b, 0x31));
}

HOT_INLINE quad quad_sums(const quad row[4]) {
  const quad even = quad_half_sums(row[0], row[2]), odd = quad_half_sums(row[1], row[3]);
  return _mm256_add_pd(_mm256_unpacklo_pd(even, odd), _mm256_unpackhi_pd(even, odd));
}

HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return _mm256_castsi256_pd(
      _mm256_add_epi64(_mm256_castpd_si256(a), _mm256_slli_epi64(_mm256_castpd_si256(shifted), 52)));
}
