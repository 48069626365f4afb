#include "floating_point.h"

#include "friction_law.h"

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

law_slopes law_with_slopes(const double* side, double speed) {
  const double decay = law_exponential(speed * side[LAW_RATE]);
  const double stribeck = side[LAW_DROP] * decay;
  return (law_slopes){
      .value = side[LAW_COULOMB] + stribeck + side[LAW_VISCOUS] * speed,
      .by_speed = side[LAW_VISCOUS] - side[LAW_RATE] * stribeck,
      .decay = decay,
  };
}

void law_pack_side(double* side, double fs, double fc, double vs, double fv) {
  side[LAW_COULOMB] = fc;
  side[LAW_DROP] = fs - fc;
  /* bounded, so that 0·(1/vs) is 0 for the smallest vs that a double can hold */
  side[LAW_RATE] = 1.0 / vs < 1e300 ? 1.0 / vs : 1e300;
  side[LAW_VISCOUS] = fv;
}
