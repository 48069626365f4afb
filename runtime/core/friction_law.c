#include "floating_point.h"

#include "friction_law.h"

double law_exponential(double x) {
  return exp_of_minus(quad_set(x)).lane[0];
}

double law_one_minus_exponential(double x) {
  if (x > 0.01) {
    return 1.0 - law_exponential(x);
  }
  /* alternating series; the first term left out is below x^7/5040 < 1e-17·x at x = 0.01 */
  return x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
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
