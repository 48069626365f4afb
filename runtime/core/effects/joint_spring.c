#include "floating_point.h"

#include "effect_facts.h"

/* T_j = (stiffness·b + quadratic)·b², b = q_j − rest: what the plastic cover's spring has beside the linear T_jq of
 * eq. (8). About an angle c from rest it hardens with quadratic = −3·stiffness·c. */

enum { STIFFNESS, QUADRATIC, REACTION = QUADRATIC };

static void cover_torque(effect_place place, const double* parameters, const effect_sample* sample,
                         const double* memory, double* torque) {
  (void)memory;
  const double bend = sample->angle[place.joint] - sample->rest_angle[place.joint];
  torque[place.joint] += (parameters[STIFFNESS] * bend + parameters[QUADRATIC]) * bend * bend;
}

static void cover_slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                        const effect_direction* direction, double* slope) {
  (void)memory;
  const double bend = sample->angle[place.joint] - sample->rest_angle[place.joint];
  const double slope_of_bend = (3.0 * parameters[STIFFNESS] * bend + 2.0 * parameters[QUADRATIC]) * bend;
  slope[place.joint] += slope_of_bend * direction->angle[place.joint];
}

const effect_type effect_cover_hardening = {
    COVER_HARDENING_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = cover_torque,
    .slope = cover_slope,
};

/* A spring between a joint and the next one, at rest where both covers are: T_j = c, T_{j+1} = −reaction·c with
 * c = stiffness·((q_j − rest_j) − (q_{j+1} − rest_{j+1})). With reaction 0 something else takes what the next joint
 * does not: a strap that ends before it, a hose that its motion stiffens. */

static double bend_of(effect_place place, const effect_sample* sample) {
  const size_t j = place.joint;
  return (sample->angle[j] - sample->rest_angle[j]) - (sample->angle[j + 1] - sample->rest_angle[j + 1]);
}

static void coupling_torque(effect_place place, const double* parameters, const effect_sample* sample,
                            const double* memory, double* torque) {
  (void)memory;
  const double pull = parameters[STIFFNESS] * bend_of(place, sample);
  torque[place.joint] += pull;
  torque[place.joint + 1] -= parameters[REACTION] * pull;
}

static void coupling_slope(effect_place place, const double* parameters, const effect_sample* sample,
                           const double* memory, const effect_direction* direction, double* slope) {
  (void)sample;
  (void)memory;
  const size_t j = place.joint;
  const double pull = parameters[STIFFNESS] * (direction->angle[j] - direction->angle[j + 1]);
  slope[j] += pull;
  slope[j + 1] -= parameters[REACTION] * pull;
}

const effect_type effect_joint_coupling = {
    JOINT_COUPLING_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = coupling_torque,
    .slope = coupling_slope,
};
