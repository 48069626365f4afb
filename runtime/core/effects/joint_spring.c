#include "floating_point.h"

#include "effect_facts.h"

/* of a joint from where its cover is at rest */
static double bend_of(const effect_sample* sample, size_t joint) {
  return sample->angle[joint] - sample->rest_angle[joint];
}

/* T_j = (stiffness·b + quadratic)·b², b = q_j − rest: what the plastic cover's spring has beside the linear T_jq of
 * eq. (8). About an angle c from rest it hardens with quadratic = −3·stiffness·c. */

enum { STIFFNESS, QUADRATIC, REACTION = QUADRATIC };

static void cover_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  const double bend = bend_of(sample, row->place.joint);
  torque[row->place.joint] += (row->parameters[STIFFNESS] * bend + row->parameters[QUADRATIC]) * bend * bend;
}

static void cover_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                        double* slope) {
  const double bend = bend_of(sample, row->place.joint);
  const double by_angle = (3.0 * row->parameters[STIFFNESS] * bend + 2.0 * row->parameters[QUADRATIC]) * bend;
  slope[row->place.joint] += by_angle * direction->angle[row->place.joint];
}

const effect_action cover_hardening_action = {.kind = EFFECT_TORQUE, .torque = cover_torque, .slope = cover_slope};

/* A spring between a joint and the next one, at rest where both covers are: T_j = c, T_{j+1} = −reaction·c with
 * c = stiffness·((q_j − rest_j) − (q_{j+1} − rest_{j+1})). With reaction 0 something else takes what the next joint
 * does not: a strap that ends before it, a hose that its motion stiffens. */

static void add_pull(const extension_row* row, double bend, double* torque) {
  const double pull = row->parameters[STIFFNESS] * bend;
  torque[row->place.joint] += pull;
  torque[row->place.joint + 1] -= row->parameters[REACTION] * pull;
}

static void coupling_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  const size_t j = row->place.joint;
  add_pull(row, bend_of(sample, j) - bend_of(sample, j + 1), torque);
}

static void coupling_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                           double* slope) {
  (void)sample;
  const double* angle = direction->angle + row->place.joint;
  add_pull(row, angle[0] - angle[1], slope);
}

const effect_action joint_coupling_action = {.kind = EFFECT_TORQUE, .torque = coupling_torque, .slope = coupling_slope};
