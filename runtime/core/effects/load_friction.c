#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

/* T_j = coulomb·|f0|·s: Coulomb friction in a joint that grows with the force of one tendon, s the sign of the joint's
 * velocity when it last moved. */

static void advance(effect_place place, const double* parameters, const effect_sample* sample, const double* before,
                    double* after) {
  (void)parameters;
  after[0] = held_side(sample, sample->velocity[place.joint], sample->joint_threshold, before);
}

static size_t slot(effect_place place, size_t joints, size_t lanes, size_t k) {
  (void)k;
  return joints * lanes + place.joint;
}

static double size(effect_place place, const double* parameters, const effect_sample* sample) {
  return parameters[0] * fabs(sample->force[place.tendon]);
}

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  torque[place.joint] += parameters[0] * memory[0] * fabs(sample->force[place.tendon]);
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  const double change = direction->force[place.tendon];
  slope[place.joint] += parameters[0] * memory[0] * (sample->force[place.tendon] < 0.0 ? -change : change);
}

const effect_type effect_load_friction = {
    LOAD_FRICTION_FACTS, .kind = EFFECT_TORQUE, .memory_count = 1, .advance = advance,
    .torque = torque,    .slope = slope,        .slot = slot,      .size = size,
};
