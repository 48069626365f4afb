#include "site_law.h"

namespace tendonfmu::plant {
namespace {

/* (1 − u) x + u y, whose slope by the angle is (y − x)/width. */
void blend(double u, double width, double x, double y, double* value, double* slope) {
  *value = x + u * (y - x);
  *slope = (y - x) / width;
}

law_values interpolated(const law_by_angle& points, double angle, double v, int exponent) {
  const std::vector<double>& angles = points.angles;
  if (angles.size() < 2 || angle <= angles.front()) return values_of(points.laws.front(), v, exponent);
  if (angle >= angles.back()) return values_of(points.laws.back(), v, exponent);
  std::size_t k = 1;
  while (angles[k] <= angle) ++k;  // few points: a search would take longer
  const double width = angles[k] - angles[k - 1];
  const double u = (angle - angles[k - 1]) / width;
  // neighbours mostly share the Stribeck velocity: one exponential does
  const law_side &low_side = side_of(points.laws[k - 1], v), &high_side = side_of(points.laws[k], v);
  const level_and_slope excess = stribeck_excess(low_side, std::fabs(v), exponent);
  const law_values low = values_of(points.laws[k - 1], v, excess);
  const law_values high = values_of(
      points.laws[k], v,
      low_side.stribeck_rate == high_side.stribeck_rate ? excess : stribeck_excess(high_side, std::fabs(v), exponent));

  law_values both;
  blend(u, width, low.break_away, high.break_away, &both.break_away, &both.break_away_by_angle);
  blend(u, width, low.sliding, high.sliding, &both.sliding, &both.sliding_by_angle);
  blend(u, width, low.viscous, high.viscous, &both.viscous, &both.viscous_by_angle);
  both.sliding_by_velocity = low.sliding_by_velocity + u * (high.sliding_by_velocity - low.sliding_by_velocity);
  return both;
}

/* Level of the sliding friction by the angle of diversion θ, and its slope by θ. The sine with its own coefficient for
 * each sign of θ is the form of Ludovico et al. (reference [4] of the paper); 1 − e^(−μ|θ|) and, where the tension
 * falls exponentially anyway, μ|θ| are the capstan's (L. Euler, 1769). */
level_and_slope diversion_level(const diversion& turn, double theta) {
  const double sign = theta < 0.0 ? -1.0 : 1.0;
  const double coefficient = theta < 0.0 ? turn.negative_coefficient : turn.coefficient;
  switch (turn.shape) {
    case diversion::form::sine: {
      const sine_and_cosine both = sine_cosine(theta);
      const double turned = both.sine < 0.0 ? -1.0 : 1.0;
      return {coefficient * turned * both.sine, coefficient * turned * both.cosine};
    }
    case diversion::form::capstan_share: {
      const double rest = exponential(-coefficient * sign * theta);
      return {1.0 - rest, sign * coefficient * rest};
    }
    default: return {coefficient * sign * theta, sign * coefficient};
  }
}

law_values diverted(const friction_site& site, double angle, double v, int exponent) {
  const law& shape = site.friction.laws.front();
  const double theta = site.turn.rest + site.turn.slope * (angle - site.turn.centre);
  const level_and_slope level = diversion_level(site.turn, theta);
  const double normal = site.turn.normal;
  const double scale = level.level / normal, scale_by_angle = site.turn.slope * level.slope / normal;

  const law_values one = values_of(shape, v, exponent);
  law_values values;
  values.break_away = scale * one.break_away;
  values.break_away_by_angle = scale_by_angle * one.break_away;
  values.sliding = scale * one.sliding;
  values.sliding_by_angle = scale_by_angle * one.sliding;
  values.sliding_by_velocity = scale * one.sliding_by_velocity;
  values.viscous = scale * one.viscous;
  values.viscous_by_angle = scale_by_angle * one.viscous;
  return values;
}

}  // namespace

law_values site_law(const friction_site& site, double angle, double v, int stribeck_exponent) {
  return site.turn.shape == diversion::form::none ? interpolated(site.friction, angle, v, stribeck_exponent)
                                                  : diverted(site, angle, v, stribeck_exponent);
}

}  // namespace tendonfmu::plant
