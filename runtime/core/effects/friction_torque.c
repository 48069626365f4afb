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
static size_t from_joint(effect_place place) {
  return place.joint == EFFECT_NOWHERE ? 0 : place.joint;
}

static void preload_advance(effect_place place, const double* parameters, const effect_sample* sample,
                            const double* before, double* after) {
  (void)parameters;
  const size_t from = from_joint(place), count = preload_state_count(sample->joints, sample->tendons, place);
  for (size_t k = 0; k < count; ++k) {
    const double velocity = sample->tendon_velocity[(from + k) * sample->lanes + place.tendon];
    after[k] = held_side(sample, velocity, sample->tendon_threshold, before + k);
  }
}

static size_t preload_slot(effect_place place, size_t joints, size_t lanes, size_t k) {
  (void)joints;
  return (from_joint(place) + k) * lanes + place.tendon;
}

static double preload_size(effect_place place, const double* parameters, const effect_sample* sample) {
  (void)place;
  (void)sample;
  return fabs(parameters[COULOMB]);
}

/* adds own times what is lost before each joint itself, and before times what is lost before the joints before it */
static void add_lost(effect_place place, const effect_sample* sample, const double* memory, double own, double before,
                     double* torque) {
  const size_t from = from_joint(place), count = preload_state_count(sample->joints, sample->tendons, place);
  double lost_before = 0.0;
  for (size_t j = from; j < sample->joints; ++j) {
    const double lost = j - from < count ? memory[j - from] : 0.0;
    torque[j] += arm_at(sample, j, place.tendon) * (own * lost + before * lost_before);
    lost_before += lost;
  }
}

static void preload_torque(effect_place place, const double* parameters, const effect_sample* sample,
                           const double* memory, double* torque) {
  add_lost(place, sample, memory, parameters[COULOMB], parameters[COULOMB] * parameters[BEYOND], torque);
}

const effect_type effect_preload_friction = {
    PRELOAD_FRICTION_FACTS,     .kind = EFFECT_TORQUE,    .state_count = preload_state_count,
    .advance = preload_advance, .torque = preload_torque, .slot = preload_slot,
    .size = preload_size,
};

/* T_j = coulomb·|f0|·s: Coulomb friction in a joint that grows with the force of one tendon, s the sign of the joint's
 * velocity when it last moved. */

static void load_advance(effect_place place, const double* parameters, const effect_sample* sample,
                         const double* before, double* after) {
  (void)parameters;
  after[0] = held_side(sample, sample->velocity[place.joint], sample->joint_threshold, before);
}

static size_t load_slot(effect_place place, size_t joints, size_t lanes, size_t k) {
  (void)k;
  return joints * lanes + place.joint;
}

static double load_size(effect_place place, const double* parameters, const effect_sample* sample) {
  return parameters[0] * fabs(sample->force[place.tendon]);
}

static void load_torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                        double* torque) {
  torque[place.joint] += parameters[0] * memory[0] * fabs(sample->force[place.tendon]);
}

static void load_slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                       const effect_direction* direction, double* slope) {
  const double change = direction->force[place.tendon];
  slope[place.joint] += parameters[0] * memory[0] * (sample->force[place.tendon] < 0.0 ? -change : change);
}

const effect_type effect_load_friction = {
    LOAD_FRICTION_FACTS,   .kind = EFFECT_TORQUE, .memory_count = 1, .advance = load_advance,
    .torque = load_torque, .slope = load_slope,   .slot = load_slot, .size = load_size,
};
