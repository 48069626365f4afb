/* The law of a tendon's site at the present angle of the joint before it: working points, or the edge's diversion. */
#pragma once

#include "bristle.h"
#include "rig.h"

namespace tendonfmu::plant {

/* Puts the law of `site` into row k. angle: rad, of the joint before; v: m/s. */
void set_site_law(const friction_site& site, double angle, double v, int stribeck_exponent, std::size_t k,
                  law_columns* laws);

}  // namespace tendonfmu::plant
