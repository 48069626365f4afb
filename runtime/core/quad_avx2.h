/* Four doubles side by side in one AVX2 register. The meaning of each call is in quad_plain.h. */
#ifndef TENDONFMU_QUAD_H
#define TENDONFMU_QUAD_H

#include <immintrin.h>

typedef __m256d quad;
typedef __m256d quad_mask;

static inline quad quad_load(const double* from) {
  return _mm256_load_pd(from);
}

static inline void quad_store(double* to, quad a) {
  _mm256_store_pd(to, a);
}

static inline quad quad_set(double x) {
  return _mm256_set1_pd(x);
}

static inline quad quad_add(quad a, quad b) {
  return _mm256_add_pd(a, b);
}

static inline quad quad_sub(quad a, quad b) {
  return _mm256_sub_pd(a, b);
}

static inline quad quad_mul(quad a, quad b) {
  return _mm256_mul_pd(a, b);
}

static inline quad quad_div(quad a, quad b) {
  return _mm256_div_pd(a, b);
}

static inline quad quad_abs(quad a) {
  return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a);
}

static inline quad quad_with_sign(quad a, quad sign) {
  return _mm256_xor_pd(a, _mm256_and_pd(_mm256_set1_pd(-0.0), sign));
}

static inline quad_mask quad_greater(quad a, quad b) {
  return _mm256_cmp_pd(a, b, _CMP_GT_OQ);
}

static inline quad_mask quad_at_least(quad a, quad b) {
  return _mm256_cmp_pd(a, b, _CMP_GE_OQ);
}

static inline quad_mask quad_both(quad_mask a, quad_mask b) {
  return _mm256_and_pd(a, b);
}

static inline quad_mask quad_only_first(quad_mask a, quad_mask b) {
  return _mm256_andnot_pd(b, a);
}

static inline quad_mask quad_differ(quad_mask a, quad_mask b) {
  return _mm256_xor_pd(a, b);
}

static inline int quad_mask_bits(quad_mask m) {
  return _mm256_movemask_pd(m);
}

static inline quad quad_keep(quad_mask m, quad a) {
  return _mm256_and_pd(m, a);
}

static inline quad quad_select(quad_mask m, quad a, quad b) {
  return _mm256_blendv_pd(b, a, m);
}

static inline double quad_sum(quad a) {
  const __m128d s = _mm_add_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
  return _mm_cvtsd_f64(_mm_add_sd(s, _mm_unpackhi_pd(s, s)));
}

static inline quad quad_scale(quad a, quad shifted) {
  return _mm256_castsi256_pd(
      _mm256_add_epi64(_mm256_castpd_si256(a), _mm256_slli_epi64(_mm256_castpd_si256(shifted), 52)));
}

static inline void quad_load_records(const double* const record[4], quad number[4]) {
  const __m256d a = _mm256_load_pd(record[0]), b = _mm256_load_pd(record[1]);
  const __m256d c = _mm256_load_pd(record[2]), d = _mm256_load_pd(record[3]);
  const __m256d even_low = _mm256_unpacklo_pd(a, b), odd_low = _mm256_unpackhi_pd(a, b);
  const __m256d even_high = _mm256_unpacklo_pd(c, d), odd_high = _mm256_unpackhi_pd(c, d);
  number[0] = _mm256_permute2f128_pd(even_low, even_high, 0x20);
  number[1] = _mm256_permute2f128_pd(odd_low, odd_high, 0x20);
  number[2] = _mm256_permute2f128_pd(even_low, even_high, 0x31);
  number[3] = _mm256_permute2f128_pd(odd_low, odd_high, 0x31);
}

static inline void quad_load_pairs(const double* const record[4], quad number[2]) {
  const __m256d ac = _mm256_set_m128d(_mm_load_pd(record[2]), _mm_load_pd(record[0]));
  const __m256d bd = _mm256_set_m128d(_mm_load_pd(record[3]), _mm_load_pd(record[1]));
  number[0] = _mm256_unpacklo_pd(ac, bd);
  number[1] = _mm256_unpackhi_pd(ac, bd);
}

#endif
