#include "floating_point.h"

#include "force_offset.h"

#include "effect_parts.h"

/* The true force of a tendon is f0 + correction: T_j = −correction·r_ij at every joint. */

static const effect_parameter numbers[] = {
    {.name = "correction", .unit = "N", .minimum = -EFFECT_LARGE, .maximum = EFFECT_LARGE, .required = 1, .scale = 0.5},
};

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  for (size_t j = 0; j < sample->joints; ++j) {
    torque[j] -= parameters[0] * arm_at(sample, j, place.tendon);
  }
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)place; /* constant */
  (void)parameters;
  (void)sample;
  (void)memory;
  (void)direction;
  (void)slope;
}

const effect_type effect_force_offset = {
    .name = "force_offset",
    .id = 8,
    .kind = EFFECT_TORQUE,
    .tendon = PLACE_REQUIRED,
    .parameter_count = 1,
    .parameters = numbers,
    .torque = torque,
    .slope = slope,
};
