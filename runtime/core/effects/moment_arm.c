#include "floating_point.h"

#include "effect_facts.h"

#include "elementary.h"

/* The true moment arm is r_ij + c, c a constant or a function of the joint's angle: T_j = −c·f0. Joint angles still
 * come from the described arms. */

/* c and dc/dq_j */
typedef struct arm_correction {
  double value, by_angle;
} arm_correction;

static void add_torque(effect_place place, arm_correction arm, const effect_sample* sample, double* torque) {
  torque[place.joint] -= arm.value * sample->force[place.tendon];
}

static void add_slope(effect_place place, arm_correction arm, const effect_sample* sample,
                      const effect_direction* direction, double* slope) {
  const double by_angle = arm.by_angle * direction->angle[place.joint];
  slope[place.joint] -= by_angle * sample->force[place.tendon] + arm.value * direction->force[place.tendon];
}

/* Torque and slope of an effect from the function that gives its correction. */
#define BY_CORRECTION(effect, correction)                                                                   \
  static void torque_of_##effect(effect_place place, const double* parameters, const effect_sample* sample, \
                                 const double* memory, double* torque) {                                    \
    (void)memory;                                                                                           \
    add_torque(place, correction(parameters, sample->angle[place.joint]), sample, torque);                  \
  }                                                                                                         \
  static void slope_of_##effect(effect_place place, const double* parameters, const effect_sample* sample,  \
                                const double* memory, const effect_direction* direction, double* slope) {   \
    (void)memory;                                                                                           \
    add_slope(place, correction(parameters, sample->angle[place.joint]), sample, direction, slope);         \
  }

static arm_correction constant(const double* parameters, double angle) {
  (void)angle;
  return (arm_correction){.value = parameters[0]};
}
BY_CORRECTION(moment_arm, constant)

/* as where a tendon lifts off its guide */
static arm_correction linear(const double* parameters, double angle) {
  return (arm_correction){.value = parameters[0] * angle, .by_angle = parameters[0]};
}
BY_CORRECTION(moment_arm_variation, linear)

enum { SINE, COSINE, TURNS };

/* A pulley off its centre: with its angle p = turns·q_j, c = sine·sin p + cosine·cos p. One that is fixed to the link
 * turns with the joint; one that the tendon turns, by arm over radius as often. */
static arm_correction eccentric(const double* parameters, double angle) {
  const sine_cosine at = sine_cosine_of(parameters[TURNS] * angle);
  return (arm_correction){
      .value = parameters[SINE] * at.sine + parameters[COSINE] * at.cosine,
      .by_angle = parameters[TURNS] * (parameters[SINE] * at.cosine - parameters[COSINE] * at.sine)};
}
BY_CORRECTION(pulley_eccentricity, eccentric)

const effect_type effect_moment_arm = {
    MOMENT_ARM_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque_of_moment_arm,
    .slope = slope_of_moment_arm,
};
const effect_type effect_moment_arm_variation = {
    MOMENT_ARM_VARIATION_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque_of_moment_arm_variation,
    .slope = slope_of_moment_arm_variation,
};
const effect_type effect_pulley_eccentricity = {
    PULLEY_ECCENTRICITY_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque_of_pulley_eccentricity,
    .slope = slope_of_pulley_eccentricity,
};
