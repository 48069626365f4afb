#include "floating_point.h"

#include "effect_facts.h"

/* T_j = stiffness·(q_j − rest)³: the cubic part of the plastic cover's spring, beside the linear T_jq of eq. (8). */

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  const double bend = sample->angle[place.joint] - sample->rest_angle[place.joint];
  torque[place.joint] += parameters[0] * bend * bend * bend;
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)memory;
  const double bend = sample->angle[place.joint] - sample->rest_angle[place.joint];
  slope[place.joint] += 3.0 * parameters[0] * bend * bend * direction->angle[place.joint];
}

const effect_type effect_cover_hardening = {
    COVER_HARDENING_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
    .slope = slope,
};
