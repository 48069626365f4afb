/* Elementary functions with the same bits everywhere, without the host's libm. */
#pragma once

/* exp(−x) for x >= 0 as the kernels have it, and 1 − exp(−x) without cancellation. */
double law_exponential(double x);
double law_one_minus_exponential(double x);

/* ln x of a normal x > 0, within an ulp. */
double law_logarithm(double x);

typedef struct sine_cosine {
  double sine, cosine;
} sine_cosine;

/* Within 1 ulp of 1 for the angles of joints; angles beyond ±1e5 rad count as ±1e5. */
sine_cosine sine_cosine_of(double angle);
