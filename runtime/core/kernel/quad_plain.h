/* Four doubles side by side, in plain C: the fallback, and the definition of what the other quads must give bit by bit.
 */
#pragma once

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "inlining.h"

typedef struct quad {
  double lane[4];
} quad;
typedef struct quad_mask {
  uint64_t lane[4]; /* all ones or zero */
} quad_mask;

/* the expression for each lane i, written out: compilers leave a loop of four a loop */
#define QUAD_LANE(number, expression) \
  {                                   \
    enum { i = number };              \
    expression;                       \
  }
#define QUAD_EACH(expression) \
  do {                        \
    QUAD_LANE(0, expression)  \
    QUAD_LANE(1, expression)  \
    QUAD_LANE(2, expression)  \
    QUAD_LANE(3, expression)  \
  } while (0)

/* a call of two quads, or of a mask and a quad, lane by lane */
#define QUAD_CALL(result, name, first, second, value) \
  HOT_INLINE result name(first a, second b) {         \
    result r;                                         \
    QUAD_EACH(r.lane[i] = (value));                   \
    return r;                                         \
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
  quad r;
  QUAD_EACH(r.lane[i] = from[i]);
  return r;
}

HOT_INLINE void quad_store(double* to, quad a) {
  QUAD_EACH(to[i] = a.lane[i]);
}

/* lane i of first and second: from[i][0], from[i][1], wherever these stand */
HOT_INLINE void quad_load_pairs(const double* const from[4], quad* first, quad* second) {
  QUAD_EACH(first->lane[i] = from[i][0]);
  QUAD_EACH(second->lane[i] = from[i][1]);
}

/* to[i][k] = lane i of row[k], k = 0 to 3, wherever these stand */
HOT_INLINE void quad_store_lanes(double* const to[4], const quad row[4]) {
  for (int k = 0; k < 4; ++k) {
    QUAD_EACH(to[i][k] = row[k].lane[i]);
  }
}

HOT_INLINE quad quad_set(double x) {
  quad r;
  QUAD_EACH(r.lane[i] = x);
  return r;
}

QUAD_CALL(quad, quad_add, quad, quad, a.lane[i] + b.lane[i])
QUAD_CALL(quad, quad_sub, quad, quad, a.lane[i] - b.lane[i])
QUAD_CALL(quad, quad_mul, quad, quad, a.lane[i] * b.lane[i])
QUAD_CALL(quad, quad_div, quad, quad, a.lane[i] / b.lane[i])
/* b where one is NaN */
QUAD_CALL(quad, quad_min, quad, quad, a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i])
QUAD_CALL(quad, quad_max, quad, quad, a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i])
QUAD_CALL(quad_mask, quad_greater, quad, quad, a.lane[i] > b.lane[i] ? UINT64_MAX : 0)
QUAD_CALL(quad_mask, quad_at_least, quad, quad, a.lane[i] >= b.lane[i] ? UINT64_MAX : 0)
QUAD_CALL(quad_mask, quad_both, quad_mask, quad_mask, a.lane[i] & b.lane[i])
QUAD_CALL(quad_mask, quad_either, quad_mask, quad_mask, a.lane[i] | b.lane[i])
QUAD_CALL(quad_mask, quad_only_first, quad_mask, quad_mask, a.lane[i] & ~b.lane[i])
QUAD_CALL(quad_mask, quad_differ, quad_mask, quad_mask, a.lane[i] ^ b.lane[i])
/* b where the mask is set, or not set, +0 elsewhere */
QUAD_CALL(quad, quad_keep, quad_mask, quad, a.lane[i] ? b.lane[i] : 0.0)
QUAD_CALL(quad, quad_drop, quad_mask, quad, a.lane[i] ? 0.0 : b.lane[i])
/* a where b >= 0, -a where the sign bit of b is set */
QUAD_CALL(quad, quad_with_sign, quad, quad,
          quad_from_bits(quad_bits(a.lane[i]) ^ (quad_bits(b.lane[i]) & 0x8000000000000000u)))

HOT_INLINE quad quad_abs(quad a) {
  QUAD_EACH(a.lane[i] = quad_from_bits(quad_bits(a.lane[i]) & 0x7fffffffffffffffu));
  return a;
}

/* one bit a lane */
HOT_INLINE int quad_mask_bits(quad_mask m) {
  return (int)((m.lane[0] & 1) | (m.lane[1] & 2) | (m.lane[2] & 4) | (m.lane[3] & 8));
}

HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
  QUAD_EACH(a.lane[i] = m.lane[i] ? a.lane[i] : b.lane[i]);
  return a;
}

HOT_INLINE quad quad_sqrt(quad a) {
  QUAD_EACH(a.lane[i] = sqrt(a.lane[i]));
  return a;
}

HOT_INLINE double quad_sum(quad a) {
  return (a.lane[0] + a.lane[2]) + (a.lane[1] + a.lane[3]);
}

/* lane i: quad_sum(row[i]) */
HOT_INLINE quad quad_sums(const quad row[4]) {
  quad r;
  QUAD_EACH(r.lane[i] = quad_sum(row[i]));
  return r;
}

/* a · 2^k, where the low bits of the double `shifted` hold the integer k (see exponential.h) */
HOT_INLINE quad quad_scale(quad a, quad shifted) {
  QUAD_EACH(a.lane[i] = quad_from_bits(quad_bits(a.lane[i]) + (quad_bits(shifted.lane[i]) << 52)));
  return a;
}
