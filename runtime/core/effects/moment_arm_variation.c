#include "floating_point.h"

#include "effect_facts.h"

/* The true moment arm is r_ij + slope·q_j, as where a tendon lifts off its guide: T_j = −slope·q_j·f0. */

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  torque[place.joint] -= parameters[0] * sample->angle[place.joint] * sample->force[place.tendon];
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)memory;
  const double by_angle = direction->angle[place.joint] * sample->force[place.tendon];
  const double by_force = sample->angle[place.joint] * direction->force[place.tendon];
  slope[place.joint] -= parameters[0] * (by_angle + by_force);
}

const effect_type effect_moment_arm_variation = {
    MOMENT_ARM_VARIATION_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
    .slope = slope,
};
