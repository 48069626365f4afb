#include "floating_point.h"

#include "elementary.h"

#include "exponential.h"

double law_exponential(double x) {
  return exp_of_minus(x);
}

double law_one_minus_exponential(double x) {
  return one_minus_exp_of_minus(x);
}

/* as fdlibm has it: x = 2^k·(1 + f), s = f/(2 + f), ln(1 + f) = f − f²/2 + s·(f²/2 + R(s²)) */
double law_logarithm(double x) {
  const uint64_t bits = bits_of(x), half = (uint64_t)1 << 51, fraction = bits & (((uint64_t)1 << 52) - 1);
  const int above = fraction > half - half / 6; /* 1 + f is 0.708 to 1.417 */
  const double k = (double)((int)(bits >> 52) - 1023 + above);
  const double f = double_of(fraction | (uint64_t)(1023 - above) << 52) - 1.0;
  const double s = f / (2.0 + f), z = s * s, w = z * z, square = 0.5 * f * f;
  const double even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
  const double odd =
      z * (6.666666666666735130e-01 +
           w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
  const double tail = s * (square + (odd + even)) + k * 1.90821492927058770002e-10;
  return k * 6.93147180369123816490e-01 - ((square - tail) - f);
}

sine_cosine sine_cosine_of(double angle) {
  const double limit = 1e5, x = angle > -limit ? (angle < limit ? angle : limit) : -limit; /* NaN: −1e5 too */

  /* x = k·π/2 + r with |r| <= π/4; adding 1.5·2^52 rounds to the integer k. π/2 in three parts, of which the products
   * with k are exact */
  const double shift = 6755399441055744.0;
  const double shifted = x * 0.63661977236758134308 + shift;
  const double k = shifted - shift;
  const double r =
      ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21;

  /* minimax polynomials of fdlibm on [−π/4, π/4] */
  const double z = r * r;
  const double sine_series =
      8.33333333332248946124e-03 +
      z * (-1.98412698298579493134e-04 +
           z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  const double cosine_series =
      4.16666666666666019037e-02 +
      z * (-1.38888888888741095749e-03 +
           z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 +
                                                  z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  const double s = r + r * z * (-1.66666666666666324348e-01 + z * sine_series);
  const double c = 1.0 - (0.5 * z - z * z * cosine_series);
  const int quarters = (int)k & 3;
  return quarters == 0   ? (sine_cosine){s, c}
         : quarters == 1 ? (sine_cosine){c, -s}
         : quarters == 2 ? (sine_cosine){-s, -c}
                         : (sine_cosine){-c, s};
}
