#include "floating_point.h"

#include "effect_facts.h"

#include "elementary.h"

/* The true moment arm is r_ij + c, c a constant or a function of the joint's angle: T_j = −c·f0. Joint angles still
 * come from the described arms. */

/* c and dc/dq_j */
typedef struct arm_correction {
  double value, by_angle;
} arm_correction;

typedef arm_correction correction_of(const double* parameters, double angle);

static void add_torque(const extension_row* row, correction_of correct, const effect_sample* sample, double* torque) {
  const arm_correction arm = correct(row->parameters, sample->angle[row->place.joint]);
  torque[row->place.joint] -= arm.value * sample->force[row->place.tendon];
}

static void add_slope(const extension_row* row, correction_of correct, const effect_sample* sample,
                      const effect_direction* direction, double* slope) {
  const size_t j = row->place.joint, i = row->place.tendon;
  const arm_correction arm = correct(row->parameters, sample->angle[j]);
  slope[j] -= arm.by_angle * direction->angle[j] * sample->force[i] + arm.value * direction->force[i];
}

/* The effect whose correction a function gives. */
#define BY_CORRECTION(effect, correction)                                                                              \
  static void effect##_torque(const extension_row* row, const effect_sample* sample, double* torque) {                 \
    add_torque(row, correction, sample, torque);                                                                       \
  }                                                                                                                    \
  static void effect##_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction, \
                             double* slope) {                                                                          \
    add_slope(row, correction, sample, direction, slope);                                                              \
  }                                                                                                                    \
  const effect_action effect##_action = {.kind = EFFECT_TORQUE, .torque = effect##_torque, .slope = effect##_slope}

static arm_correction constant(const double* parameters, double angle) {
  (void)angle;
  return (arm_correction){.value = parameters[0]};
}
BY_CORRECTION(moment_arm, constant);

enum { SLOPE, CORRECTION };

/* as where a tendon lifts off its guide */
static arm_correction linear(const double* parameters, double angle) {
  return (arm_correction){.value = parameters[SLOPE] * angle + parameters[CORRECTION], .by_angle = parameters[SLOPE]};
}
BY_CORRECTION(moment_arm_variation, linear);

enum { SINE, COSINE, TURNS };

/* A pulley off its centre: with its angle p = turns·q_j, c = sine·sin p + cosine·cos p. One that is fixed to the link
 * turns with the joint; one that the tendon turns, by arm over radius as often. */
static arm_correction eccentric(const double* parameters, double angle) {
  const sine_cosine at = sine_cosine_of(parameters[TURNS] * angle);
  return (arm_correction){
      .value = parameters[SINE] * at.sine + parameters[COSINE] * at.cosine,
      .by_angle = parameters[TURNS] * (parameters[SINE] * at.cosine - parameters[COSINE] * at.sine)};
}
BY_CORRECTION(pulley_eccentricity, eccentric);
