#include "floating_point.h"

#include "joint_coupling.h"

#include "effect_parts.h"

/* A spring between a joint and the next one, at rest where both covers are: T_j = c, T_{j+1} = −c with
 * c = stiffness·((q_j − rest_j) − (q_{j+1} − rest_{j+1})). */

static const effect_parameter numbers[] = {
    {.name = "stiffness",
     .unit = "N.m/rad",
     .minimum = -EFFECT_LARGE,
     .maximum = EFFECT_LARGE,
     .required = 1,
     .scale = 0.02},
};

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  const size_t j = place.joint;
  const double bend = sample->angle[j] - sample->rest_angle[j], next = sample->angle[j + 1] - sample->rest_angle[j + 1];
  torque[j] += parameters[0] * (bend - next);
  torque[j + 1] -= parameters[0] * (bend - next);
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)sample;
  (void)memory;
  const size_t j = place.joint;
  const double apart = along(direction->angle, j) - along(direction->angle, j + 1);
  slope[j] += parameters[0] * apart;
  slope[j + 1] -= parameters[0] * apart;
}

const effect_type effect_joint_coupling = {
    .name = "joint_coupling",
    .id = 4,
    .kind = EFFECT_TORQUE,
    .joint = PLACE_REQUIRED,
    .rule = PLACES_NOT_LAST_JOINT,
    .parameter_count = 1,
    .parameters = numbers,
    .torque = torque,
    .slope = slope,
};
