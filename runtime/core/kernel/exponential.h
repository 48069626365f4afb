/* exp(−x) and 1 − exp(−x) for x >= 0, lane by lane: the same bits in every kernel, without the host's libm. Within 1.5
 * ulp (runtime/tests holds it to that). Arguments above 708 count as 708, 3e-308: no result is subnormal. */
#pragma once

#include "quad.h"

/* Whether sums keep their order and products their rounding: some compilers have flags that change them and name no
 * macro (core/floating_point.h). */
HOT_INLINE int rounds_as_written(void) {
  volatile double near_one = 1.0 + 0x1p-30, small = 1e-3;
  const double x = near_one, y = small, shift = 6755399441055744.0;
  return x * x - (1.0 + 0x1p-29) == 0.0 && (y + shift) - shift == 0.0;
}

/* −y = k·ln 2 + r with |r| <= ln 2 / 2; adding 1.5·2^52 rounds to the integer k and leaves it in the low bits. */
typedef struct reduced_exponential {
  quad shifted, k, rest; /* rest: e^r − 1 */
} reduced_exponential;

HOT_INLINE reduced_exponential reduce_exponential(quad x) {
  const quad y = quad_min(x, quad_set(708.0));
  const double shift = 6755399441055744.0;
  const quad shifted = y * -1.4426950408889634 + shift;
  const quad k = shifted - shift;
  const quad r = (k * -6.93147180369123816490e-01 - y) - k * 1.90821492927058770002e-10;

  /* e^r − 1 = r + r²·q(r): q of degree 9, interpolated at Chebyshev nodes, relative error 1.6e-17; Estrin's scheme */
  const quad r2 = r * r, r4 = r2 * r2;
  const quad q01 = 0x1.5555555555556p-3 * r + 0x1.0000000000001p-1;
  const quad q23 = 0x1.11111111109b3p-7 * r + 0x1.5555555553d63p-5;
  const quad q45 = 0x1.a01a01a7c41d5p-13 * r + 0x1.6c16c1788bd90p-10;
  const quad q67 = 0x1.71de0dae63bb3p-19 * r + 0x1.a019b90d2ae7ap-16;
  const quad q89 = 0x1.af38a9b0ec855p-26 * r + 0x1.289185613a3d6p-22;
  const quad q = (q89 * r4 + (q67 * r2 + q45)) * r4 + (q23 * r2 + q01);
  return (reduced_exponential){shifted, k, r + r2 * q};
}

HOT_INLINE quad exp_of_minus(quad x) {
  const reduced_exponential e = reduce_exponential(x);
  return quad_scale(1.0 + e.rest, e.shifted);
}

/* 1 − exp(−x) without cancellation */
HOT_INLINE quad one_minus_exp_of_minus(quad x) {
  const reduced_exponential e = reduce_exponential(x);
  const quad large = 1.0 - quad_scale(1.0 + e.rest, e.shifted);
  return quad_select(quad_greater(e.k, quad_set(-0.5)), 0.0 - e.rest, large);
}
