/* One double at a time, in plain C: for any machine, and the definition of what the other quads must give bit by bit.
 * Its QUAD_LANES is 1, so the formulas of the kernels run lane by lane. */
#pragma once

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "inlining.h"

enum { QUAD_LANES = 1, QUAD_ALL = 1 };

typedef double quad;
typedef int quad_mask; /* 1 or 0 */

/* four sums side by side, each over every fourth lane of a row */
typedef struct quad_sums {
  double of[4];
} quad_sums;

#define QUAD_CALL(result, name, first, second, value) \
  HOT_INLINE result name(first a, second b) {         \
    return value;                                     \
  }

HOT_INLINE uint64_t quad_bits(double x) {
  uint64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}

HOT_INLINE double quad_from_bits(uint64_t bits) {
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

HOT_INLINE quad quad_load(const double* from) {
  return *from;
}

HOT_INLINE void quad_store(double* to, quad a) {
  *to = a;
}

HOT_INLINE quad quad_set(double x) {
  return x;
}

QUAD_CALL(quad, quad_add, quad, quad, a + b)
QUAD_CALL(quad, quad_sub, quad, quad, a - b)
QUAD_CALL(quad, quad_mul, quad, quad, (a * b))
QUAD_CALL(quad, quad_div, quad, quad, a / b)
/* b where one is NaN */
QUAD_CALL(quad, quad_min, quad, quad, a < b ? a : b)
QUAD_CALL(quad, quad_max, quad, quad, a > b ? a : b)
QUAD_CALL(quad_mask, quad_greater, quad, quad, a > b)
QUAD_CALL(quad_mask, quad_at_least, quad, quad, a >= b)
QUAD_CALL(quad_mask, quad_both, quad_mask, quad_mask, a& b)
QUAD_CALL(quad_mask, quad_either, quad_mask, quad_mask, a | b)
QUAD_CALL(quad_mask, quad_only_first, quad_mask, quad_mask, a & !b)
QUAD_CALL(quad_mask, quad_differ, quad_mask, quad_mask, a ^ b)
/* b where the mask is set, or not set, +0 elsewhere */
QUAD_CALL(quad, quad_keep, quad_mask, quad, a ? b : 0.0)
QUAD_CALL(quad, quad_drop, quad_mask, quad, a ? 0.0 : b)
/* a where b >= 0, -a where the sign bit of b is set */
QUAD_CALL(quad, quad_with_sign, quad, quad, quad_from_bits(quad_bits(a) ^ (quad_bits(b) & 0x8000000000000000u)))

HOT_INLINE quad quad_abs(quad a) {
  return fabs(a);
}

/* one bit a lane */
HOT_INLINE int quad_mask_bits(quad_mask m) {
  return m;
}

HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
  return m ? a : b;
}

/* the lanes of a from lane i of a row on; the first four begin the sums */
HOT_INLINE void quad_sums_begin(quad_sums* sums, size_t i, quad a) {
  sums->of[i] = a;
}

HOT_INLINE void quad_sums_add(quad_sums* sums, size_t i, quad a) {
  sums->of[i % 4] += a;
}

HOT_INLINE double quad_sum(const quad_sums* sums) {
  return (sums->of[0] + sums->of[2]) + (sums->of[1] + sums->of[3]);
}

/* lane k: quad_sum(row[k]) */
HOT_INLINE quad quad_sum_rows(const quad_sums row[QUAD_LANES]) {
  return quad_sum(row);
}

/* a · 2^k, where the low bits of the double `shifted` hold the integer k (see exponential.h) */
HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return quad_from_bits(quad_bits(a) + (quad_bits(shifted) << 52));
}
