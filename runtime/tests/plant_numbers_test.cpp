// Numbers of the simulated finger: elementary functions against the C library's in long double, derivatives that come
// with the numbers, Philox against the vectors its authors published, curves over time.
#include "elementary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "motion.h"

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

// --- random numbers -------------------------------------------------------------------------------------------------

struct Known {
  std::uint32_t counter[4], key[2], answer[4];
};

// Random123 1.09, examples/kat_vectors: philox4x32 10
TEST(Philox, GivesThePublishedAnswers) {
  const Known all[] = {
      {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
      {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
       {0xffffffff, 0xffffffff},
       {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
      {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
       {0xa4093822, 0x299f31d0},
       {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
  };
  for (const Known& one : all) {
    std::uint32_t counter[4];
    std::copy(one.counter, one.counter + 4, counter);
    philox(counter, one.key);
    EXPECT_TRUE(std::equal(counter, counter + 4, one.answer)) << std::hex << counter[0];
  }
}

TEST(NormalNumber, HasTheMomentsOfTheNormalDistribution) {
  const std::size_t count = 400000;
  double sum[5] = {};
  std::size_t beyond_two = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = normal_number(11, 3, k);
    ASSERT_TRUE(std::isfinite(x));
    beyond_two += std::fabs(x) > 2.0;
    double power = 1.0;
    for (double& each : sum) {
      each += power;
      power *= x;
    }
  }
  const double n = static_cast<double>(count), one_sigma = 1.0 / std::sqrt(n);
  EXPECT_NEAR(sum[1] / n, 0.0, 4 * one_sigma);
  EXPECT_NEAR(sum[2] / n, 1.0, 4 * std::sqrt(2.0) * one_sigma);
  EXPECT_NEAR(sum[3] / n, 0.0, 4 * std::sqrt(15.0) * one_sigma);
  EXPECT_NEAR(sum[4] / n, 3.0, 4 * std::sqrt(96.0) * one_sigma);
  EXPECT_NEAR(static_cast<double>(beyond_two) / n, 0.0455003, 4 * std::sqrt(0.0455 * 0.9545) * one_sigma);
}

TEST(NormalNumber, DiffersInSeedChannelAndSample) {
  const double x = normal_number(1, 2, 3);
  EXPECT_EQ(normal_number(1, 2, 3), x);
  for (const double other : {normal_number(2, 2, 3), normal_number(1, 3, 3), normal_number(1, 2, 4),
                             normal_number(1 + (1ULL << 32), 2, 3), normal_number(1, 2, 3 + (1ULL << 32))}) {
    EXPECT_NE(other, x);
  }
}

// --- curves ---------------------------------------------------------------------------------------------------------

double slope(const knots& knots, double time) {
  const double h = 1e-6;
  return (at_time(knots, time + h) - at_time(knots, time - h)) / (2 * h);
}

TEST(Knots, PassThroughPositionVelocityAndAcceleration) {
  const knots three_knots = {{0.5, 1.0, 3.0}, {0.1, 0.4, -0.2}, {0.3, -0.5, 0.2}, {1.0, -2.0, 0.7}};
  EXPECT_EQ(at_time(three_knots, 0.5), 0.1);
  EXPECT_NEAR(at_time(three_knots, 1.0), 0.4, 1e-15);
  EXPECT_EQ(at_time(three_knots, 3.0), -0.2);
  EXPECT_NEAR(slope(three_knots, 1.0), -0.5, 1e-8);
  const double h = 1e-4;
  for (const int side : {-1, 1}) {  // the acceleration from either side
    const double a = (at_time(three_knots, 1.0 + 2 * side * h) - 2 * at_time(three_knots, 1.0 + side * h) +
                      at_time(three_knots, 1.0)) /
                     (h * h);
    EXPECT_NEAR(a, -2.0, 0.05) << side;
  }
}

TEST(Knots, AreConstantOutside) {
  const knots two = {{1.0, 2.0}, {0.1, 0.4}, {5.0, 5.0}, {0.0, 0.0}}, one = {{0.0}, {7.0}, {0.0}, {0.0}};
  for (const double time : {-HUGE_VAL, -1.0, 0.0, std::nextafter(1.0, 0.0)}) {
    EXPECT_EQ(at_time(two, time), 0.1);
  }
  for (const double time : {std::nextafter(2.0, 3.0), 1e300, HUGE_VAL}) {
    EXPECT_EQ(at_time(two, time), 0.4);
  }
  for (const double time : {-1.0, 0.0, 1.0}) {
    EXPECT_EQ(at_time(one, time), 7.0);
  }
}

TEST(Elongation, IsTheSpringLawTurnedRound) {
  for (const double hardening : {0.0, 1e3, 1e6, 1e12}) {
    tendon spring;
    spring.stiffness = 5000.0;
    spring.hardening = hardening;
    for (const double force : {0.0, 1e-9, 0.1, 10.0, 1e4}) {
      const double e = elongation_of(spring, force);
      EXPECT_NEAR(e * (spring.stiffness + hardening * e), force, 1e-14 * force + 1e-300);
    }
    EXPECT_LT(elongation_of(spring, -1.0), 0.0);
  }
}

}  // namespace
