#include "floating_point.h"

#include "effect_facts.h"

#include "sine_cosine.h"

/* A pulley off its centre: with its angle p = turns·q_j the true moment arm is r_ij + sine·sin p + cosine·cos p, and
 * T_j = −(sine·sin p + cosine·cos p)·f0. One that is fixed to the link turns with the joint; one that the tendon turns,
 * by arm over radius as often. */

enum { SINE, COSINE, TURNS };

static sine_cosine pulley_at(effect_place place, const double* parameters, const effect_sample* sample) {
  return sine_cosine_of(parameters[TURNS] * sample->angle[place.joint]);
}

/* dr/dp */
static double arm_by_turn(const double* parameters, sine_cosine at) {
  return parameters[SINE] * at.cosine - parameters[COSINE] * at.sine;
}

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  const sine_cosine at = pulley_at(place, parameters, sample);
  torque[place.joint] -= (parameters[SINE] * at.sine + parameters[COSINE] * at.cosine) * sample->force[place.tendon];
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)memory;
  const sine_cosine at = pulley_at(place, parameters, sample);
  const double arm = parameters[SINE] * at.sine + parameters[COSINE] * at.cosine;
  const double arm_by_angle = parameters[TURNS] * arm_by_turn(parameters, at);
  slope[place.joint] -=
      arm_by_angle * direction->angle[place.joint] * sample->force[place.tendon] + arm * direction->force[place.tendon];
}

const effect_type effect_pulley_eccentricity = {
    PULLEY_ECCENTRICITY_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
    .slope = slope,
};
