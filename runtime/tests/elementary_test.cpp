// Exponential, logarithm, sine and cosine of the simulated finger against the C library's in long double.
#include "elementary.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace {

using namespace tendonfmu::plant;

/* Error in units of the last place of the true value. */
double ulps(double found, long double truth) {
  const double near = static_cast<double>(truth);
  const double unit = std::nextafter(std::fabs(near), HUGE_VAL) - std::fabs(near);
  return static_cast<double>(std::fabs(found - truth) / unit);
}

template <class Mine, class Theirs>
double worst(double low, double high, Mine mine, Theirs theirs) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> anywhere(low, high);
  double most = 0.0;
  for (int k = 0; k < 100000; ++k) {
    const double x = anywhere(random);
    most = std::max(most, ulps(mine(x), theirs(static_cast<long double>(x))));
  }
  return most;
}

TEST(Exponential, IsWithinTwoUnitsOfTheLastPlace) {
  const auto theirs = [](long double x) { return std::exp(x); };
  for (const auto& [low, high] : {std::pair{-1e-9, 1e-9}, {-1.0, 1.0}, {-30.0, 30.0}, {-708.0, 708.0}}) {
    EXPECT_LT(worst(low, high, exponential<double>, theirs), 2.0) << low << " to " << high;
  }
}

TEST(Exponential, EndsAtTheEndsOfItsRange) {
  EXPECT_EQ(exponential(0.0), 1.0);
  EXPECT_EQ(exponential(-0.0), 1.0);
  for (const double x : {-708.1, -709.0, -1e4, -1e300, -HUGE_VAL}) {
    EXPECT_GE(exponential(x), 0.0) << x;
    EXPECT_LE(exponential(x), 3.4e-308) << x;
  }
  for (const double x : {708.1, 709.0, 1e4, 1e300, HUGE_VAL}) {
    EXPECT_EQ(exponential(x), exponential(708.0)) << x;
  }
  EXPECT_TRUE(std::isnan(exponential(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Logarithm, IsWithinTwoUnitsOfTheLastPlace) {
  const auto theirs = [](long double x) { return std::log(x); };
  for (const auto& [low, high] : {std::pair{1e-16, 1e-3}, {1e-3, 0.5}, {0.5, 0.99}, {1.01, 2.0}, {2.0, 1e9}}) {
    EXPECT_LT(worst(low, high, logarithm, theirs), 2.0) << low << " to " << high;
  }
  EXPECT_EQ(logarithm(1.0), 0.0);
  const double smallest = 1.0 / 18014398509481984.0, largest = 1.0 - 1.0 / 9007199254740992.0;  // of normal_number()
  EXPECT_LT(ulps(logarithm(smallest), std::log(static_cast<long double>(smallest))), 2.0);
  EXPECT_LT(ulps(logarithm(largest), std::log(static_cast<long double>(largest))), 2.0);
}

TEST(SineAndCosine, AreWithinAFewUnitsOfTheLastPlace) {
  const auto sin = [](long double x) { return std::sin(x); };
  const auto cos = [](long double x) { return std::cos(x); };
  for (const auto& [low, high] : {std::pair{-1e-8, 1e-8}, {-0.8, 0.8}, {-7.0, 7.0}, {-1e3, 1e3}, {-1e5, 1e5}}) {
    EXPECT_LT(worst(low, high, sine, sin), 2.5) << low << " to " << high;
    EXPECT_LT(worst(low, high, cosine, cos), 2.5) << low << " to " << high;
  }
}

// At multiples of π/2 one of them is next to nothing: all that is left of the reduction's error shows.
TEST(SineAndCosine, AreRightAtMultiplesOfHalfATurn) {
  for (int k = -60000; k <= 60000; k += 7) {
    const double x = k * (pi / 2);
    const auto [s, c] = sine_cosine(x);
    EXPECT_NEAR(s, static_cast<double>(std::sin(static_cast<long double>(x))), 1.2e-16) << k;
    EXPECT_NEAR(c, static_cast<double>(std::cos(static_cast<long double>(x))), 1.2e-16) << k;
  }
}

}  // namespace
