#include "floating_point.h"

#include "effect_facts.h"

/* The true force of a tendon is f0 + correction: T_j = −correction·r_ij at every joint. */

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  for (size_t j = 0; j < sample->joints; ++j) {
    torque[j] -= parameters[0] * arm_at(sample, j, place.tendon);
  }
}

const effect_type effect_force_offset = {
    FORCE_OFFSET_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
};
