/* Contacts after LuGre: a dimensionless bristle w that bends over the presliding distance d and then slides.
 *
 *   w' = (v/d) (1 − sgn(v) w/ĝ),   ĝ = g(v)/c       C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new
 *   λ  = level c (w + T_d(v) w') + F_v v             model for control of systems with friction", IEEE TAC 40(3), 1995
 *
 * g: the steady sliding level (Stribeck curve), c: the break-away level, T_d(v) = T_d/(1 + |v| T_d/d): micro-damping
 * that fades with the velocity, so that the contact stays passive (H. Olsson, thesis, Lund 1996, section 3.6).
 *
 * All contacts of a finger at once, in columns, two rows at a time: most time of a simulation is spent here. */
#pragma once

#include <cstddef>
#include <vector>

#include "rig.h"

namespace tendonfmu::plant {

/* Rows of columns for `count` contacts: a multiple of two. */
constexpr std::size_t padded(std::size_t count) {
  return (count + 1) / 2 * 2;
}

/* The law of every contact at its velocity and the present angle:
 *   g = sliding + excess e^(−argument),   argument = (|v|/v_s)^δ
 */
struct law_columns {
  std::vector<double> velocity;       /* m/s, rad/s */
  std::vector<double> inverse_length; /* 1/d */
  std::vector<double> break_away;     /* c */
  std::vector<double> sliding;
  std::vector<double> excess;
  std::vector<double> argument;
  std::vector<double> viscous;

  explicit law_columns(std::size_t count);
};

/* What every contact does: the share λ and the bristle's rate w' in 1/s, with their slopes by bristle and velocity on
 * request: those by velocity at a constant level g. */
struct response_columns {
  std::vector<double> share, rate;
  std::vector<double> share_by_bristle, share_by_velocity, rate_by_bristle, rate_by_velocity;

  explicit response_columns(std::size_t count);
};

/* What holds for all contacts. */
struct response_settings {
  double level = 1.0;        /* of all friction but the viscous */
  double damping_time = 0.0; /* T_d, s */
  bool slopes = true;
};

/* Responses to bristles w [padded count]. */
void respond(const law_columns& laws, const response_settings& settings, const double* w, response_columns* responses);

/* Puts a law into row k: velocity v. */
void set_law(const law& one, double v, int stribeck_exponent, std::size_t k, law_columns* laws);

/* Puts the law of `site` into row k, by working points or by the edge's diversion. angle: rad, of the joint before; v:
 * m/s. */
void set_site_law(const friction_site& site, double angle, double v, int stribeck_exponent, std::size_t k,
                  law_columns* laws);

}  // namespace tendonfmu::plant
