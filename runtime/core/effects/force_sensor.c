#include "floating_point.h"

#include "effect_facts.h"

/* The true force of a tendon is (1 + correction)·f0: T_j = −correction·r_ij·f0 at every joint. */

static void gain_to_joints(effect_place place, const effect_sample* sample, double force, double* torque) {
  for (size_t j = 0; j < sample->joints; ++j) {
    torque[j] -= arm_at(sample, j, place.tendon) * force;
  }
}

static void gain_torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                        double* torque) {
  (void)memory;
  gain_to_joints(place, sample, parameters[0] * sample->force[place.tendon], torque);
}

static void gain_slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                       const effect_direction* direction, double* slope) {
  (void)memory;
  gain_to_joints(place, sample, parameters[0] * direction->force[place.tendon], slope);
}

const effect_type effect_force_gain = {
    FORCE_GAIN_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = gain_torque,
    .slope = gain_slope,
};

/* The true force of a tendon is f0 + correction: T_j = −correction·r_ij at every joint. */

static void offset_torque(effect_place place, const double* parameters, const effect_sample* sample,
                          const double* memory, double* torque) {
  (void)memory;
  for (size_t j = 0; j < sample->joints; ++j) {
    torque[j] -= parameters[0] * arm_at(sample, j, place.tendon);
  }
}

const effect_type effect_force_offset = {
    FORCE_OFFSET_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = offset_torque,
};
