// LuGre's bristle in closed forms, its slopes, and the laws that it slides by.
#include "bristle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "site_law.h"

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
  double share, rate, kept, share_by_bristle, share_by_velocity, share_by_angle, share_by_level, rate_by_bristle,
      rate_by_velocity, rate_by_angle;
};

Response respond_once(const law_columns& laws, const response_settings& with, double w) {
  const double bristles[2] = {w, 0.123};
  response_columns r(1);
  respond(laws, with, bristles, &r);
  return {r.share[0],
          r.rate[0],
          r.kept[0],
          r.share_by_bristle[0],
          r.share_by_velocity[0],
          r.share_by_angle[0],
          r.share_by_level[0],
          r.rate_by_bristle[0],
          r.rate_by_velocity[0],
          r.rate_by_angle[0]};
}

Response respond_once(const law& one, double v, int exponent, const response_settings& with, double w) {
  law_columns laws(1);
  laws.inverse_length[0] = 1.0 / length;
  set_law(one, v, exponent, 0, &laws);
  return respond_once(laws, with, w);
}

/* Stribeck's curve, eq. (1) with exponent δ, without the viscous part. */
double steady(const law_side& side, double speed, int exponent) {
  const double x = speed * side.stribeck_rate;
  return side.sliding + (side.break_away - side.sliding) * std::exp(exponent == 1 ? -x : -x * x);
}

TEST(Bristle, SlidesSteadilyAtTheLevelOfTheLaw) {
  const law one = two_sided();
  for (const int exponent : {1, 2}) {
    for (const double damping : {0.0, 1e-3}) {
      for (const double v : {-0.1, -0.005, -1e-6, 1e-6, 0.003, 0.2}) {
        const law_side& side = v < 0.0 ? one.negative : one.positive;
        const double sign = v < 0.0 ? -1.0 : 1.0, g = steady(side, std::fabs(v), exponent);
        const Response r = respond_once(one, v, exponent, {1.2, damping, 0.0, true}, sign * g / one.break_away);
        EXPECT_NEAR(r.rate, 0.0, 1e-9 * std::fabs(v) / length) << v;
        EXPECT_NEAR(r.share, sign * 1.2 * g + side.viscous * v, 1e-15) << v;
      }
    }
  }
}

// With a span the bristle is where the exact solution has it, and an implicit step comes to just there.
TEST(Bristle, MovesExactlyThroughASpan) {
  const law one = two_sided();
  for (const double v : {-0.05, -1e-5, 2e-6, 1e-4, 0.1}) {
    for (const double span : {1e-6, 2.5e-4, 5e-3}) {
      for (const double w : {-0.6, 0.0, 0.5}) {
        const law_side& side = v < 0.0 ? one.negative : one.positive;
        const double sign = v < 0.0 ? -1.0 : 1.0, g = steady(side, std::fabs(v), 1) / one.break_away;
        const double kept = std::exp(-std::fabs(v) * span / (length * g)), after = sign * g + (w - sign * g) * kept;
        const Response r = respond_once(one, v, 1, {1.0, 0.0, span, true}, w);
        EXPECT_NEAR(w + span * r.rate, after, 1e-13);
        EXPECT_NEAR(r.kept, kept, 1e-14);
        EXPECT_NEAR(r.share, one.break_away * after + side.viscous * v, 1e-14);
      }
    }
  }
}

// Slopes of share and rate by bristle, velocity and level against differences, on both sides, with and without span.
TEST(Bristle, KnowsItsSlopes) {
  std::mt19937 random(5);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const law one = two_sided();
  for (int trial = 0; trial < 300; ++trial) {
    const int exponent = 1 + trial % 2;
    const double v = (trial % 3 ? 1.0 : -1.0) * std::pow(10.0, between(-5.0, -1.0)), w = between(-0.9, 0.9);
    const response_settings with = {between(0.5, 1.5), trial % 5 ? 1e-4 : 0.0, trial % 4 < 2 ? 0.0 : 3e-4, true};
    const Response r = respond_once(one, v, exponent, with, w);
    const auto check = [&](double slope, double high, double low, double h, double scale) {
      EXPECT_NEAR(slope, (high - low) / (2 * h), 1e-5 * std::fabs(slope) + 1e-9 * scale / h) << trial;
    };
    const double hv = 1e-5 * std::fabs(v), h = 1e-5;
    const Response faster = respond_once(one, v + hv, exponent, with, w);
    const Response slower = respond_once(one, v - hv, exponent, with, w);
    // with a span the bristle moves along: to first order through its rate
    const double moved = with.span * r.rate_by_velocity;
    check(r.share_by_velocity + moved * r.share_by_bristle, faster.share, slower.share, hv, 0.05);
    check(r.rate_by_velocity, faster.rate, slower.rate, hv, std::fabs(r.rate));
    response_settings stronger = with, weaker = with;
    stronger.level += h;
    weaker.level -= h;
    check(r.share_by_level, respond_once(one, v, exponent, stronger, w).share,
          respond_once(one, v, exponent, weaker, w).share, h, 0.05);
    if (with.span > 0.0) {
      continue;  // there the bristle has been eliminated
    }
    const Response more = respond_once(one, v, exponent, with, w + h),
                   less = respond_once(one, v, exponent, with, w - h);
    check(r.share_by_bristle, more.share, less.share, h, 0.05);
    check(r.rate_by_bristle, more.rate, less.rate, h, std::fabs(r.rate));
  }
}

// --- laws by the angle ---

friction_site with_points(double second_rate) {
  friction_site site;
  site.bends = true;
  law low = two_sided(), high;
  high.positive = {0.06, 0.05, second_rate, 0.1};
  high.negative = {0.02, 0.02, 1.0 / 0.006, 0.2};
  high.break_away = 0.04;
  site.friction = {{-0.5, 0.2, 0.7}, {low, high, low}};
  return site;
}

friction_site diverted(diversion::form form) {
  friction_site site;
  site.bends = true;
  site.friction.laws = {two_sided()};
  site.turn.shape = form;
  site.turn.rest = 0.3;
  site.turn.slope = 0.8;
  site.turn.centre = 0.1;
  site.turn.normal = 0.02;
  site.turn.coefficient = 0.06;
  site.turn.negative_coefficient = 0.03;
  return site;
}

Response at_angle(const friction_site& site, double angle, double v, double w, const response_settings& with) {
  law_columns laws(1);
  laws.inverse_length[0] = 1.0 / length;
  set_site_law(site, angle, v, 1, 0, &laws);
  return respond_once(laws, with, w);
}

/* Level of steady sliding, without the viscous part. */
double sliding_at(const friction_site& site, double angle, double v) {
  law_columns laws(1);
  set_site_law(site, angle, v, 1, 0, &laws);
  return laws.sliding[0] + laws.excess[0] * std::exp(-laws.argument[0]);
}

TEST(SiteLaw, IsInterpolatedBetweenWorkingPointsAndConstantOutside) {
  for (const double rate : {1.0 / 0.004, 1.0 / 0.009}) {
    const friction_site site = with_points(rate);
    const auto of = [](const law& one, double v) {
      return steady(v < 0 ? one.negative : one.positive, std::fabs(v), 1);
    };
    for (const double v : {-0.01, 0.002}) {
      const double low = of(site.friction.laws[0], v), high = of(site.friction.laws[1], v);
      for (const double angle : {-9.0, -0.5, 0.7, 1.0}) {
        EXPECT_DOUBLE_EQ(sliding_at(site, angle, v), low) << angle;
      }
      EXPECT_DOUBLE_EQ(sliding_at(site, 0.2, v), high);
      EXPECT_NEAR(sliding_at(site, -0.15, v), 0.5 * (low + high), 1e-15);
      EXPECT_NEAR(sliding_at(site, 0.45, v), 0.5 * (low + high), 1e-15);
    }
  }
}

TEST(SiteLaw, KnowsItsSlopesByTheAngle) {
  const std::vector<friction_site> sites = {with_points(1.0 / 0.004), with_points(1.0 / 0.009),
                                            diverted(diversion::form::sine), diverted(diversion::form::capstan_share),
                                            diverted(diversion::form::capstan_exponent)};
  const double h = 1e-6;
  for (std::size_t s = 0; s < sites.size(); ++s) {
    for (const double angle : {-0.7, -0.45, -0.1, 0.3, 0.6, 0.9}) {
      for (const double v : {-0.02, -1e-4, 3e-4, 0.01}) {
        for (const double span : {0.0, 3e-4}) {
          const response_settings with = {1.1, 1e-4, span, true};
          const Response r = at_angle(sites[s], angle, v, 0.4, with);
          const Response up = at_angle(sites[s], angle + h, v, 0.4, with);
          const Response down = at_angle(sites[s], angle - h, v, 0.4, with);
          EXPECT_NEAR(r.share_by_angle + span * r.rate_by_angle * r.share_by_bristle, (up.share - down.share) / (2 * h),
                      1e-8)
              << s << " " << angle << " " << v;
          EXPECT_NEAR(r.rate_by_angle, (up.rate - down.rate) / (2 * h),
                      1e-5 * std::fabs(r.rate_by_angle) + 1e-8 * std::fabs(r.rate) / h * 1e-2)
              << s << " " << angle << " " << v;
        }
      }
    }
  }
}

}  // namespace
