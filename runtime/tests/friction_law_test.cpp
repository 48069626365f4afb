// Eq. (1), one side: values by regime, dissipation, slopes.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core_inside.h"

namespace {

struct Side {
  double fs, fc, vs, fv;
  double numbers[LAW_SIDE_NUMBERS];

  Side(double s, double c, double stribeck, double viscous) : fs(s), fc(c), vs(stribeck), fv(viscous) {
    law_pack_side(numbers, fs, fc, vs, fv);
  }
  law_slopes at(double speed) const { return law_with_slopes(numbers, speed); }
};

TEST(FrictionLaw, IsEquationOne) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<> unit(0.0, 1.0);
  for (int i = 0; i < 10000; ++i) {
    const double fc = unit(random), vs = 1e-3 + unit(random);
    const Side side(fc + unit(random), fc, vs, unit(random));
    const double v = unit(random) * 5.0 * vs;
    const double expected = side.fc + (side.fs - side.fc) * std::exp(-v / vs) + side.fv * v;
    EXPECT_NEAR(side.at(v).value, expected, 4e-15 * expected);
  }
}

TEST(FrictionLaw, WithoutStribeckEffectIsFreeOfTheExponential) {
  const Side side(0.02, 0.02, 1e-300, 0.1);
  for (const double v : {0.0, 1e-12, 1e-3, 10.0}) {
    EXPECT_EQ(side.at(v).value, 0.02 + 0.1 * v);
  }
}

TEST(FrictionLaw, StaysFiniteAtTheSmallestStribeckVelocity) {
  const Side side(0.03, 0.02, 5e-324, 0.0);
  EXPECT_EQ(side.at(0.0).value, 0.03);
  EXPECT_EQ(side.at(1e-12).value, 0.02);
  EXPECT_TRUE(std::isfinite(side.at(0.0).by_speed));
}

TEST(FrictionLaw, SlopeIsThatOfCentralDifferences) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<> unit(0.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    const double fc = 0.01 + unit(random), vs = 0.1 + unit(random);
    double side[LAW_SIDE_NUMBERS];
    law_pack_side(side, fc + unit(random), fc, vs, unit(random));
    const double v = 0.01 + 2.0 * unit(random);
    const law_slopes slopes = law_with_slopes(side, v);
    // h = 1e-5: truncation h²/6·|F'''| ~ 1e-8, rounding 1e-16·|F|/h ~ 1e-11
    const double h = 1e-5, tolerance = 3e-7;
    const double by_speed = (law_with_slopes(side, v + h).value - law_with_slopes(side, v - h).value) / (2 * h);
    EXPECT_NEAR(slopes.by_speed, by_speed, tolerance);
  }
}

}  // namespace
