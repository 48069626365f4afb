/* One contact after LuGre: a dimensionless bristle w that bends over the presliding distance d and then slides.
 *
 *   w' = (v/d) (1 − sgn(v) w/ĝ),   ĝ = g(v)/c       C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new
 *   λ  = level c (w + T_d(v) w') + F_v v             model for control of systems with friction", IEEE TAC 40(3), 1995
 *
 * g: the steady sliding level (Stribeck curve), c: the break-away level, T_d(v) = T_d/(1 + |v| T_d/d): micro-damping
 * that fades with the velocity, so that the contact stays passive (H. Olsson, thesis, Lund 1996, section 3.6). */
#ifndef TENDONFMU_PLANT_BRISTLE_H
#define TENDONFMU_PLANT_BRISTLE_H

#include <cmath>

#include "elementary.h"
#include "rig.h"

namespace tendonfmu::plant {

/* Values of a law at velocity v and the present angle, with slopes by velocity and angle. */
struct law_values {
  double break_away = 0.0, break_away_by_angle = 0.0;                      /* c */
  double sliding = 0.0, sliding_by_velocity = 0.0, sliding_by_angle = 0.0; /* g */
  double viscous = 0.0, viscous_by_angle = 0.0;
};

struct level_and_slope {
  double level, slope;
};

/* How much of (static − coulomb) is left at speed |v|, and its slope by |v|. */
inline level_and_slope stribeck_excess(const law_side& side, double speed, int exponent) {
  const double x = speed * side.stribeck_rate;
  const double left = exponential(exponent == 1 ? -x : -x * x);
  return {left, -left * (exponent == 1 ? side.stribeck_rate : 2.0 * x * side.stribeck_rate)};
}

inline const law_side& side_of(const law& one, double v) {
  return v < 0.0 ? one.negative : one.positive;
}

inline law_values values_of(const law& one, double v, const level_and_slope& excess) {
  const law_side& side = side_of(one, v);
  law_values values;
  values.break_away = one.break_away;
  values.sliding = side.sliding + (side.break_away - side.sliding) * excess.level;
  values.sliding_by_velocity = (v < 0.0 ? -1.0 : 1.0) * (side.break_away - side.sliding) * excess.slope;
  values.viscous = side.viscous;
  return values;
}

inline law_values values_of(const law& one, double v, int exponent) {
  return values_of(one, v, stribeck_excess(side_of(one, v), std::fabs(v), exponent));
}

/* What a contact does, and its slopes: first order in bristle, velocity and angle. Slopes are filled in on request. */
struct bristle_response {
  double share = 0.0; /* λ */
  double rate = 0.0;  /* w' in 1/s */
  double share_by_bristle = 0.0, share_by_velocity = 0.0, share_by_angle = 0.0, share_by_level = 0.0;
  double rate_by_bristle = 0.0, rate_by_velocity = 0.0, rate_by_angle = 0.0;
  double kept = 1.0; /* respond_after(): what is left of the way to the end of bending after `span` */
};

/* ĝ = g/c and its slopes. A contact that is only viscous keeps its bristle free. */
struct relative_level {
  double level, inverse, by_velocity, by_angle;
};

inline relative_level relative(const law_values& law) {
  if (!(law.break_away > 0.0)) return {1.0, 1.0, 0.0, 0.0};
  const double inverse_c = 1.0 / law.break_away;
  const double g = law.sliding * inverse_c;
  return {g, 1.0 / g, law.sliding_by_velocity * inverse_c,
          (law.sliding_by_angle - g * law.break_away_by_angle) * inverse_c};
}

/* The share λ with its slopes; the rates are left to the callers. inverse_length: 1/d. */
inline void share_of(const law_values& law, const relative_level& g, double level, double inverse_length,
                     double damping_time, double w, double v, bool slopes, bristle_response* r) {
  const double sign = v < 0.0 ? -1.0 : 1.0;
  const double c = law.break_away;
  const double bent = w * g.inverse;
  // w + T_d(v) w' = w (1 − a/ĝ) + a sgn(v),  a = |v| T_d/d / (1 + |v| T_d/d)
  const double fade = 1.0 / (1.0 + std::fabs(v) * inverse_length * damping_time);
  const double a = 1.0 - fade;
  const double bending = w - a * bent + a * sign;
  r->share = level * c * bending + law.viscous * v;
  if (!slopes) return;
  const double a_by_velocity = sign * damping_time * inverse_length * fade * fade;
  const double stiffer = a * bent * g.inverse;
  r->share_by_bristle = level * c * (1.0 - a * g.inverse);
  r->share_by_velocity = level * c * (a_by_velocity * (sign - bent) + stiffer * g.by_velocity) + law.viscous;
  r->share_by_angle = level * (law.break_away_by_angle * bending + c * stiffer * g.by_angle) + law.viscous_by_angle * v;
  r->share_by_level = c * bending;
}

inline void respond(const law_values& law, double level, double inverse_length, double damping_time, double w, double v,
                    bool slopes, bristle_response* r) {
  const relative_level g = relative(law);
  share_of(law, g, level, inverse_length, damping_time, w, v, slopes, r);
  const double sign = v < 0.0 ? -1.0 : 1.0;
  const double per_second = std::fabs(v) * inverse_length, bent = w * g.inverse;
  r->rate = v * inverse_length - per_second * bent;
  if (!slopes) return;
  r->rate_by_bristle = -per_second * g.inverse;
  r->rate_by_velocity = (1.0 - sign * bent) * inverse_length + per_second * bent * g.by_velocity * g.inverse;
  r->rate_by_angle = per_second * bent * g.by_angle * g.inverse;
}

/* The response with the bristle first moved on by `span` seconds at constant velocity, which is solved exactly. Its
 * rates are such that an implicit step of size `span` moves the bristle, by span·rate, to just there. */
inline void respond_after(const law_values& law, double level, double inverse_length, double damping_time, double w,
                          double v, double span, bool slopes, bristle_response* r) {
  const relative_level g = relative(law);
  const double sign = v < 0.0 ? -1.0 : 1.0;
  const double per_metre = span * inverse_length * g.inverse;  // travel to bend by e, as a share of v
  const double travel = std::fabs(v) * per_metre;
  const double rest = exponential(-travel), from_end = w - sign * g.level;
  const double after = sign * g.level + from_end * rest;
  share_of(law, g, level, inverse_length, damping_time, after, v, slopes, r);
  const double frequency = 1.0 / span;
  r->kept = rest;
  r->rate = (after - w) * frequency;
  if (!slopes) return;
  const double by_g = sign * (1.0 - rest) + from_end * rest * travel * g.inverse;
  r->rate_by_bristle = 0.0;
  r->rate_by_velocity = (by_g * g.by_velocity - from_end * rest * sign * per_metre) * frequency;
  r->rate_by_angle = by_g * g.by_angle * frequency;
}

}  // namespace tendonfmu::plant

#endif
