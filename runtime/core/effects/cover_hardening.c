#include "floating_point.h"

#include "cover_hardening.h"
#include "effect.h"

/* T = k3·(q − rest)³: the cubic part of the plastic cover's spring, beside the linear T_jq of eq. (8). */

static const effect_parameter parameters[] = {
    {.name = "stiffness", .unit = "N.m/rad3", .minimum = -1e9, .maximum = 1e9, .required = 1},
};

static size_t state_count(const double* values) {
  (void)values;
  return 0;
}

static effect_torque torque(const double* values, const effect_sample* sample, const double* memory) {
  (void)memory;
  const double bend = sample->joint_angle - sample->rest_angle;
  return (effect_torque){
      .value = values[0] * bend * bend * bend,
      .by_angle = 3.0 * values[0] * bend * bend,
      .by_parameter = {bend * bend * bend},
  };
}

const effect_type cover_hardening = {
    .name = "cover_hardening",
    .id = 1,
    .parameter_count = 1,
    .parameters = parameters,
    .state_count = state_count,
    .torque = torque,
};
