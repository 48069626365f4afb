// LuGre's bristle: its share and rate, and their slopes.
#include "bristle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace {

using namespace tendonfmu::plant;

constexpr double length = 25e-6;  // presliding distance, m

law two_sided() {
  law one;
  one.positive = {0.03, 0.02, 1.0 / 0.004, 0.3};
  one.negative = {0.05, 0.025, 1.0 / 0.006, 0.1};
  one.break_away = 0.04;
  return one;
}

/* One contact's response in the first row; what stands in the second must not matter. */
struct Response {
  double share, rate, share_by_bristle, share_by_velocity, rate_by_bristle, rate_by_velocity;
};

Response respond_once(const law& one, double v, int exponent, const response_settings& with, double w) {
  law_columns laws(1);
  laws.inverse_length[0] = 1.0 / length;
  set_law(one, v, exponent, 0, &laws);
  const double bristles[2] = {w, 0.123};
  response_columns r(1);
  respond(laws, with, bristles, &r);
  return {r.share[0],           r.rate[0], r.share_by_bristle[0], r.share_by_velocity[0], r.rate_by_bristle[0],
          r.rate_by_velocity[0]};
}

/* Stribeck's curve, eq. (1) with exponent δ, without the viscous part. */
double steady(const law_side& side, double speed, int exponent) {
  const double x = speed * side.stribeck_rate;
  return side.sliding + (side.break_away - side.sliding) * std::exp(exponent == 1 ? -x : -x * x);
}

// Slow sliding ends where the law has it, on either side, and the bristle rests there.
TEST(Bristle, SlidesAtTheSteadyLevel) {
  const law one = two_sided();
  for (const double v : {-0.05, -1e-5, 2e-6, 1e-4, 0.1}) {
    for (const int exponent : {1, 2}) {
      const law_side& side = v < 0.0 ? one.negative : one.positive;
      const double sign = v < 0.0 ? -1.0 : 1.0, level = steady(side, std::fabs(v), exponent);
      const Response r = respond_once(one, v, exponent, {1.0, 1e-3, true}, sign * level / one.break_away);
      EXPECT_NEAR(r.rate * length / v, 0.0, 1e-13);
      EXPECT_NEAR(r.share, sign * level + side.viscous * v, 1e-14);
      EXPECT_NEAR(respond_once(one, v, exponent, {1.0, 0.0, true}, 0.0).rate, v / length,
                  1e-13 * std::fabs(v) / length);
    }
  }
}

// Slopes of share and rate by bristle and velocity against differences, on both sides, at one level of
// sliding.
TEST(Bristle, KnowsItsSlopes) {
  std::mt19937 random(5);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  law one = two_sided();
  one.positive.break_away = one.positive.sliding;
  one.negative.break_away = one.negative.sliding;
  for (int trial = 0; trial < 300; ++trial) {
    const int exponent = 1 + trial % 2;
    const double v = (trial % 3 ? 1.0 : -1.0) * std::pow(10.0, between(-5.0, -1.0)), w = between(-0.9, 0.9);
    const response_settings with = {between(0.5, 1.5), trial % 5 ? 1e-4 : 0.0, true};
    const Response r = respond_once(one, v, exponent, with, w);
    const auto check = [&](double slope, double high, double low, double h, double scale) {
      EXPECT_NEAR(slope, (high - low) / (2 * h), 1e-5 * std::fabs(slope) + 1e-9 * scale / h) << trial;
    };
    const double hv = 1e-5 * std::fabs(v), h = 1e-5;
    const Response faster = respond_once(one, v + hv, exponent, with, w);
    const Response slower = respond_once(one, v - hv, exponent, with, w);
    check(r.share_by_velocity, faster.share, slower.share, hv, 0.05);
    check(r.rate_by_velocity, faster.rate, slower.rate, hv, std::fabs(r.rate));
    const Response more = respond_once(one, v, exponent, with, w + h),
                   less = respond_once(one, v, exponent, with, w - h);
    check(r.share_by_bristle, more.share, less.share, h, 0.05);
    check(r.rate_by_bristle, more.rate, less.rate, h, std::fabs(r.rate));
  }
}

}  // namespace
