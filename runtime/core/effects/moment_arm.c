#include "floating_point.h"

#include "effect_facts.h"

/* The true moment arm is r_ij + correction: T_j = −correction·f0. Joint angles still come from the described arms. */

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  torque[place.joint] -= parameters[0] * sample->force[place.tendon];
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)sample;
  (void)memory;
  slope[place.joint] -= parameters[0] * direction->force[place.tendon];
}

const effect_type effect_moment_arm = {
    MOMENT_ARM_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
    .slope = slope,
};
