/* The friction law, eq. (1): the one place where it is written.
 *
 *   F(v) = sgn(v)·(Fc + (Fs − Fc)·exp(−|v|/vs) + Fv·|v|)
 *
 * A law has a side for v > 0 and one for v < 0; a symmetric law has two equal ones. A side is kept as four numbers:
 * Fc, Fs − Fc, 1/vs, Fv (paper VII: 1/vs behaves, vs does not). */
#pragma once

#include "elementary.h"

enum { LAW_COULOMB, LAW_DROP, LAW_RATE, LAW_VISCOUS, LAW_SIDE_NUMBERS };

enum { LAW_NUMBERS = 2 * LAW_SIDE_NUMBERS }; /* positive side, negative side */

/* A number and its derivative along a direction. */
typedef struct dual {
  double value, slope;
} dual;

static inline dual product(dual a, dual b) {
  return (dual){a.value * b.value, a.slope * b.value + a.value * b.slope};
}
static inline dual sum(dual a, dual b) {
  return (dual){a.value + b.value, a.slope + b.slope};
}
static inline dual difference(dual a, dual b) {
  return (dual){a.value - b.value, a.slope - b.slope};
}
static inline dual scaled(double factor, dual a) {
  return (dual){factor * a.value, factor * a.slope};
}

/* One side at speed |v|, all for v > 0: mirror the value for v < 0. */
typedef struct law_slopes {
  double value;    /* Fc + (Fs − Fc)·exp(−|v|/vs) + Fv·|v| */
  double by_speed; /* ∂/∂|v| */
  double decay;    /* exp(−|v|/vs) */
} law_slopes;

/* side [LAW_SIDE_NUMBERS]; speed >= 0. The value has the bits of the kernels. */
static inline law_slopes law_with_slopes(const double* side, double speed) {
  const double decay = law_exponential(speed * side[LAW_RATE]);
  const double stribeck = side[LAW_DROP] * decay;
  law_slopes of;
  of.value = side[LAW_COULOMB] + stribeck + side[LAW_VISCOUS] * speed;
  of.by_speed = side[LAW_VISCOUS] - side[LAW_RATE] * stribeck;
  of.decay = decay;
  return of;
}

/* Fills one side of a law from the numbers of a description. */
static inline void law_pack_side(double* side, double fs, double fc, double vs, double fv) {
  side[LAW_COULOMB] = fc;
  side[LAW_DROP] = fs - fc;
  /* bounded, so that 0·(1/vs) is 0 for the smallest vs that a double can hold */
  side[LAW_RATE] = 1.0 / vs < 1e300 ? 1.0 / vs : 1e300;
  side[LAW_VISCOUS] = fv;
}
