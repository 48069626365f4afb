/* The friction law, eq. (1): the one place where it is written.
 *
 *   F(v) = sgn(v)·(Fc + (Fs − Fc)·exp(−|v|/vs) + Fv·|v|)
 *
 * A law has a side for v > 0 and one for v < 0; a symmetric law has two equal ones. A side is kept as four numbers:
 * Fc, Fs − Fc, 1/vs, Fv (paper VII: 1/vs behaves, vs does not). */
#pragma once

enum { LAW_COULOMB, LAW_DROP, LAW_RATE, LAW_VISCOUS, LAW_SIDE_NUMBERS };

enum { LAW_NUMBERS = 2 * LAW_SIDE_NUMBERS }; /* positive side, negative side */

/* One side at speed |v|, all for v > 0: mirror the value for v < 0. */
typedef struct law_slopes {
  double value;    /* Fc + (Fs − Fc)·exp(−|v|/vs) + Fv·|v| */
  double by_speed; /* ∂/∂|v| */
  double decay;    /* exp(−|v|/vs) */
} law_slopes;

/* side [LAW_SIDE_NUMBERS]; speed >= 0. The value has the bits of the kernels. */
law_slopes law_with_slopes(const double* side, double speed);

/* exp(−x) for x >= 0 as the kernels have it, and 1 − exp(−x) without cancellation. */
double law_exponential(double x);
double law_one_minus_exponential(double x);

/* ln x of a normal x > 0, within an ulp, without the host's libm. */
double law_logarithm(double x);

/* Fills one side of a law from the numbers of a description. */
void law_pack_side(double* side, double fs, double fc, double vs, double fv);
