#include "floating_point.h"

#include "effect_facts.h"

/* The true force of a tendon is (1 + correction)·f0: T_j = −correction·r_ij·f0 at every joint. */

static void force_to_joints(const extension_row* row, const effect_sample* sample, double force, double* torque) {
  for (size_t j = 0; j < sample->joints; ++j) {
    torque[j] -= arm_at(sample, j, row->place.tendon) * force;
  }
}

static void gain_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  force_to_joints(row, sample, row->parameters[0] * sample->force[row->place.tendon], torque);
}

static void gain_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                       double* slope) {
  force_to_joints(row, sample, row->parameters[0] * direction->force[row->place.tendon], slope);
}

const effect_action force_gain_action = {.kind = EFFECT_TORQUE, .torque = gain_torque, .slope = gain_slope};

/* The true force of a tendon is f0 + correction: T_j = −correction·r_ij at every joint. */

static void offset_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  force_to_joints(row, sample, row->parameters[0], torque);
}

const effect_action force_offset_action = {.kind = EFFECT_TORQUE, .torque = offset_torque};
