/* The law of a tendon's site at the present angle of the joint before it: working points, or the edge's diversion. */
#ifndef TENDONFMU_PLANT_SITE_LAW_H
#define TENDONFMU_PLANT_SITE_LAW_H

#include "bristle.h"
#include "rig.h"

namespace tendonfmu::plant {

/* angle: rad, of the joint before; v: m/s. */
law_values site_law(const friction_site& site, double angle, double v, int stribeck_exponent);

}  // namespace tendonfmu::plant

#endif
