#include "bristle.h"

#include <cmath>
#include <cstring>

#include "elementary.h"

namespace tendonfmu::plant {

law_columns::law_columns(std::size_t count) {
  for (std::vector<double>* column :
       {&velocity, &inverse_length, &break_away, &sliding, &excess, &argument, &viscous}) {
    column->assign(padded(count), 0.0);
  }
}

response_columns::response_columns(std::size_t count) {
  for (std::vector<double>* column :
       {&share, &rate, &share_by_bristle, &share_by_velocity, &rate_by_bristle, &rate_by_velocity}) {
    column->assign(padded(count), 0.0);
  }
}

void set_law(const law& one, double v, int stribeck_exponent, std::size_t k, law_columns* laws) {
  const law_side& side = v < 0.0 ? one.negative : one.positive;
  const double x = std::fabs(v) * side.stribeck_rate;
  laws->velocity[k] = v;
  laws->break_away[k] = one.break_away;
  laws->sliding[k] = side.sliding;
  laws->excess[k] = side.break_away - side.sliding;
  laws->argument[k] = stribeck_exponent == 1 ? x : x * x;
  laws->viscous[k] = side.viscous;
}

namespace {

inline __attribute__((always_inline)) pair load(const std::vector<double>& column, std::size_t k) {
  pair values;
  std::memcpy(&values, &column[k], sizeof values);
  return values;
}

inline __attribute__((always_inline)) void store(const pair& values, std::size_t k, std::vector<double>* column) {
  std::memcpy(&(*column)[k], &values, sizeof values);
}

/* Rows k and k + 1. What is not asked for is left out when this is compiled. */
template <bool with_slopes>
inline __attribute__((always_inline)) void respond_two(const law_columns& law, const response_settings& with,
                                                       const pair& w, std::size_t k, response_columns* r) {
  const pair zero = {}, one = zero + 1.0;
  const pair v = load(law.velocity, k), inverse_length = load(law.inverse_length, k);
  const pair sign = v < zero ? -one : one, speed = v * sign;
  // ĝ; a contact that is only viscous keeps its bristle free
  const pair c = load(law.break_away, k), excess = load(law.excess, k);
  const pair left = exponential(-load(law.argument, k));
  const auto rubs = c > zero;
  const pair inverse_c = 1.0 / (rubs ? c : one);
  const pair level = (load(law.sliding, k) + excess * left) * inverse_c;
  const pair g = rubs ? level : one, inverse_g = 1.0 / g;

  // w + T_d(v) w' = w (1 − a/ĝ) + a sgn(v),  a = |v| T_d/d / (1 + |v| T_d/d)
  const pair per_second = speed * inverse_length, bent = w * inverse_g;
  const pair fade = 1.0 / (1.0 + per_second * with.damping_time), a = 1.0 - fade;
  const pair bending = w - a * bent + a * sign;
  const pair strength = with.level * c, viscous = load(law.viscous, k);
  store(strength * bending + viscous * v, k, &r->share);
  store(v * inverse_length - per_second * bent, k, &r->rate);
  if (!with_slopes) {
    return;
  }

  const pair a_by_velocity = sign * with.damping_time * inverse_length * fade * fade;
  store(strength * (1.0 - a * inverse_g), k, &r->share_by_bristle);
  store(strength * a_by_velocity * (sign - bent) + viscous, k, &r->share_by_velocity);
  store(-per_second * inverse_g, k, &r->rate_by_bristle);
  store((1.0 - sign * bent) * inverse_length, k, &r->rate_by_velocity);
}

template <bool with_slopes>
void respond_all(const law_columns& laws, const response_settings& with, const double* w, response_columns* responses) {
  for (std::size_t k = 0; k < laws.velocity.size(); k += pair_size) {
    pair start;
    std::memcpy(&start, w + k, sizeof start);
    respond_two<with_slopes>(laws, with, start, k, responses);
  }
}

}  // namespace

void respond(const law_columns& laws, const response_settings& with, const double* w, response_columns* responses) {
  (with.slopes ? respond_all<true> : respond_all<false>)(laws, with, w, responses);
}

/* --- the law of a site at the present angle ----------------------------------------------------------------------- */

namespace {

const law_side& side_of(const law& one, double v) {
  return v < 0.0 ? one.negative : one.positive;
}

/* Values are interpolated, not numbers of laws: where neighbours share the Stribeck velocity that is the same; where
 * they do not, both values are taken here and the row keeps nothing to add. */
void set_between(const law& low, const law& high, double share, double v, int exponent, std::size_t k,
                 law_columns* laws) {
  set_law(low, v, exponent, k, laws);
  const law_side &a = side_of(low, v), &b = side_of(high, v);
  const auto between = [share](double x, double y) { return x + share * (y - x); };
  laws->break_away[k] = between(low.break_away, high.break_away);
  laws->viscous[k] = between(a.viscous, b.viscous);
  double excess_of_a = a.break_away - a.sliding, excess_of_b = b.break_away - b.sliding;
  if (a.stribeck_rate == b.stribeck_rate) {
    laws->sliding[k] = between(a.sliding, b.sliding);
    laws->excess[k] = between(excess_of_a, excess_of_b);
    return;
  }
  const double x = std::fabs(v) * b.stribeck_rate;
  excess_of_a *= exponential(-laws->argument[k]);
  excess_of_b *= exponential(exponent == 1 ? -x : -x * x);
  laws->sliding[k] = between(a.sliding + excess_of_a, b.sliding + excess_of_b);
  laws->excess[k] = 0.0;
}

void set_interpolated(const law_by_angle& points, double angle, double v, int exponent, std::size_t k,
                      law_columns* laws) {
  const std::vector<double>& angles = points.angles;
  if (angles.size() < 2 || angle <= angles.front()) {
    return set_law(points.laws.front(), v, exponent, k, laws);
  }
  if (angle >= angles.back()) {
    return set_law(points.laws.back(), v, exponent, k, laws);
  }
  std::size_t upper = 1;
  while (angles[upper] <= angle) {
    ++upper;  // few points: a search would take longer
  }
  const double share = (angle - angles[upper - 1]) * (1.0 / (angles[upper] - angles[upper - 1]));
  set_between(points.laws[upper - 1], points.laws[upper], share, v, exponent, k, laws);
}

/* Level of the sliding friction by the angle of diversion θ. The sine with its own coefficient for
 * each sign of θ is the form of Ludovico et al. (reference [4] of the paper); 1 − e^(−μ|θ|) and, where the tension
 * falls exponentially anyway, μ|θ| are the capstan's (L. Euler, 1769). */
double diversion_level(const diversion& turn, double theta) {
  const double sign = theta < 0.0 ? -1.0 : 1.0;
  const double coefficient = theta < 0.0 ? turn.negative_coefficient : turn.coefficient;
  switch (turn.shape) {
    case diversion::form::sine: return coefficient * std::fabs(sine(theta));
    case diversion::form::capstan_share: return 1.0 - exponential(-coefficient * sign * theta);
    default: return coefficient * sign * theta;
  }
}

void set_diverted(const friction_site& site, double angle, double v, int exponent, std::size_t k, law_columns* laws) {
  const double theta = site.turn.rest + site.turn.slope * (angle - site.turn.centre);
  const double scale = diversion_level(site.turn, theta) / site.turn.normal;
  set_law(site.friction.laws.front(), v, exponent, k, laws);
  for (std::vector<double>* column : {&laws->break_away, &laws->sliding, &laws->excess, &laws->viscous}) {
    (*column)[k] *= scale;
  }
}

}  // namespace

void set_site_law(const friction_site& site, double angle, double v, int stribeck_exponent, std::size_t k,
                  law_columns* laws) {
  if (site.turn.shape == diversion::form::none) {
    set_interpolated(site.friction, angle, v, stribeck_exponent, k, laws);
  } else {
    set_diverted(site, angle, v, stribeck_exponent, k, laws);
  }
}

}  // namespace tendonfmu::plant
