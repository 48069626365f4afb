#include "floating_point.h"

#include "pulley_eccentricity.h"

#include "effect_parts.h"
#include "sine_cosine.h"

/* A pulley off its centre, turning with the joint: the true moment arm is r_ij + sine·sin q_j + cosine·cos q_j, and
 * T_j = −(sine·sin q_j + cosine·cos q_j)·f0. */

static const effect_parameter numbers[] = {
    {.name = "sine", .unit = "m", .minimum = -EFFECT_LARGE, .maximum = EFFECT_LARGE, .scale = 5e-4},
    {.name = "cosine", .unit = "m", .minimum = -EFFECT_LARGE, .maximum = EFFECT_LARGE, .scale = 5e-4},
};

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  const sine_cosine at = sine_cosine_of(sample->angle[place.joint]);
  torque[place.joint] -= (parameters[0] * at.sine + parameters[1] * at.cosine) * sample->force[place.tendon];
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)memory;
  const sine_cosine at = sine_cosine_of(sample->angle[place.joint]);
  const double arm = parameters[0] * at.sine + parameters[1] * at.cosine;
  const double arm_by_angle = parameters[0] * at.cosine - parameters[1] * at.sine;
  slope[place.joint] -= arm_by_angle * along(direction->angle, place.joint) * sample->force[place.tendon] +
                        arm * along(direction->force, place.tendon);
}

const effect_type effect_pulley_eccentricity = {
    .name = "pulley_eccentricity",
    .id = 11,
    .kind = EFFECT_TORQUE,
    .joint = PLACE_REQUIRED,
    .tendon = PLACE_REQUIRED,
    .parameter_count = 2,
    .parameters = numbers,
    .torque = torque,
    .slope = slope,
};
