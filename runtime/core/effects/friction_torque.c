#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

/* Friction of a tendon that does not scale with its force (a tight sheath, a seal): before joint j' the tendon loses
 * coulomb·s, s the sign of ẋ_ij' when it last moved, so T_j' = r_ij'·coulomb·s and T_j = beyond·r_ij·coulomb·s for all
 * j > j'. Without a joint, before every joint that the tendon reaches; where no moment arm is left ẋ is 0 and so is s.
 * With beyond 0 it rubs within the joint, and the next ones feel nothing of it. */

enum { COULOMB, BEYOND };

static size_t preload_state_count(size_t joints, size_t tendons, effect_place place) {
  (void)tendons;
  return place.joint == EFFECT_NOWHERE ? joints : 1;
}

/* the first joint before which there is friction */
static size_t from_joint(const extension_row* row) {
  return row->place.joint == EFFECT_NOWHERE ? 0 : row->place.joint;
}

static size_t preload_slot(const extension_row* row, size_t joints, size_t lanes, size_t k) {
  (void)joints;
  return (from_joint(row) + k) * lanes + row->place.tendon;
}

static void preload_advance(const extension_row* row, const effect_sample* sample) {
  for (size_t k = 0; k < row->memory_count; ++k) {
    const double velocity = sample->tendon_velocity[preload_slot(row, sample->joints, sample->lanes, k)];
    row->now[k] = held_side(sample, velocity, sample->tendon_threshold, row->before + k);
  }
}

static double preload_size(const extension_row* row, const effect_sample* sample) {
  (void)sample;
  return fabs(row->parameters[COULOMB]);
}

/* what is lost before each joint itself, and what of that before the joints before it is felt there */
static void preload_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  const double own = row->parameters[COULOMB], beyond = own * row->parameters[BEYOND];
  const size_t from = from_joint(row);
  double lost_before = 0.0;
  for (size_t j = from; j < sample->joints; ++j) {
    const double lost = j - from < row->memory_count ? row->now[j - from] : 0.0;
    torque[j] += arm_at(sample, j, row->place.tendon) * (own * lost + beyond * lost_before);
    lost_before += lost;
  }
}

const effect_action preload_friction_action = {.kind = EFFECT_TORQUE,
                                               .state_count = preload_state_count,
                                               .advance = preload_advance,
                                               .torque = preload_torque,
                                               .slot = preload_slot,
                                               .size = preload_size};

/* T_j = coulomb·|f0|·s: Coulomb friction in a joint that grows with the force of one tendon, s the sign of the joint's
 * velocity when it last moved. */

static void load_advance(const extension_row* row, const effect_sample* sample) {
  row->now[0] = held_side(sample, sample->velocity[row->place.joint], sample->joint_threshold, row->before);
}

static size_t load_slot(const extension_row* row, size_t joints, size_t lanes, size_t k) {
  (void)k;
  return joints * lanes + row->place.joint;
}

static double load_size(const extension_row* row, const effect_sample* sample) {
  return row->parameters[0] * fabs(sample->force[row->place.tendon]);
}

static void load_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  torque[row->place.joint] += row->parameters[0] * row->now[0] * fabs(sample->force[row->place.tendon]);
}

static void load_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                       double* slope) {
  const double change = direction->force[row->place.tendon];
  slope[row->place.joint] +=
      row->parameters[0] * row->now[0] * (sample->force[row->place.tendon] < 0.0 ? -change : change);
}

const effect_action load_friction_action = {.kind = EFFECT_TORQUE,
                                            .memory_count = 1,
                                            .advance = load_advance,
                                            .torque = load_torque,
                                            .slope = load_slope,
                                            .slot = load_slot,
                                            .size = load_size};
