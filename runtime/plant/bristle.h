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

/* g and g' of one side at speed |v|, by speed. */
struct level_and_slope {
  double level, slope;
};

inline level_and_slope sliding_level(const law_side& side, double speed, int exponent) {
  const double x = speed / side.stribeck_velocity;
  const double excess = (side.break_away - side.sliding) * exponential(exponent == 1 ? -x : -x * x);
  const double rate = (exponent == 1 ? 1.0 : 2.0 * x) / side.stribeck_velocity;
  return {side.sliding + excess, -excess * rate};
}

inline law_values values_of(const law& one, double v, int exponent) {
  const law_side& side = v < 0.0 ? one.negative : one.positive;
  const level_and_slope g = sliding_level(side, std::fabs(v), exponent);
  law_values values;
  values.break_away = 0.5 * (one.positive.break_away + one.negative.break_away);
  values.sliding = g.level;
  values.sliding_by_velocity = v < 0.0 ? -g.slope : g.slope;
  values.viscous = side.viscous;
  return values;
}

/* What a contact does, and its slopes: first order in bristle, velocity and angle. */
struct bristle_response {
  double share = 0.0; /* λ */
  double share_by_bristle = 0.0, share_by_velocity = 0.0, share_by_angle = 0.0, share_by_level = 0.0;
  double rate = 0.0; /* w' in 1/s */
  double rate_by_bristle = 0.0, rate_by_velocity = 0.0, rate_by_angle = 0.0;
};

inline bristle_response respond(const law_values& law, double level, double presliding, double damping_time, double w,
                                double v) {
  const double sign = v < 0.0 ? -1.0 : 1.0;
  const double c = law.break_away;
  const double inverse_c = c > 0.0 ? 1.0 / c : 0.0;
  // ĝ and its slopes; a contact that is only viscous keeps its bristle free
  const double g = c > 0.0 ? law.sliding * inverse_c : 1.0;
  const double g_by_velocity = law.sliding_by_velocity * inverse_c;
  const double g_by_angle = (law.sliding_by_angle - g * law.break_away_by_angle) * inverse_c;

  bristle_response r;
  const double per_second = std::fabs(v) / presliding;
  const double bent = w / g;
  r.rate = v / presliding - per_second * bent;
  r.rate_by_bristle = -per_second / g;
  r.rate_by_velocity = (1.0 - sign * bent) / presliding + per_second * bent * g_by_velocity / g;
  r.rate_by_angle = per_second * bent * g_by_angle / g;

  // w + T_d(v) w' = w (1 − a/ĝ) + a sgn(v),  a = |v| T_d/d / (1 + |v| T_d/d)
  const double b = per_second * damping_time;
  const double a = b / (1.0 + b);
  const double a_by_velocity = sign * damping_time / (presliding * (1.0 + b) * (1.0 + b));
  const double bending = w - a * bent + a * sign;
  r.share = level * c * bending + law.viscous * v;
  r.share_by_bristle = level * c * (1.0 - a / g);
  r.share_by_velocity = level * c * (a_by_velocity * (sign - bent) + a * bent * g_by_velocity / g) + law.viscous;
  r.share_by_angle =
      level * (law.break_away_by_angle * bending + c * a * bent * g_by_angle / g) + law.viscous_by_angle * v;
  r.share_by_level = c * bending;
  return r;
}

}  // namespace tendonfmu::plant

#endif
