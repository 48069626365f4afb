#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

#include "friction_law.h"

/* F × (1 + amplitude·(1 − exp(−(t − t_0)/time_constant))): run-in, warming up. */

enum { AMPLITUDE, TIME_CONSTANT };
enum { FIRST_TIME, ELAPSED, TOLD_CONSTANT, COME, MEMORY_COUNT };

/* the share reached, 1 − e^−age */
static double come_so_far(double elapsed, double time_constant) {
  return elapsed > 0.0 ? law_one_minus_exponential(elapsed / time_constant) : 0.0;
}

static void drift_advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                          double* after) {
  (void)place;
  after[FIRST_TIME] = sample->first ? sample->time : before[FIRST_TIME];
  after[ELAPSED] = sample->time - after[FIRST_TIME];
  after[TOLD_CONSTANT] = values[TIME_CONSTANT];
  after[COME] = come_so_far(after[ELAPSED], values[TIME_CONSTANT]);
}

/* of every velocity of its place the same, so the exponential is remembered; the number may have changed since */
static effect_grip drift_grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)member;
  const int same = memory[TOLD_CONSTANT] == values[TIME_CONSTANT];
  const double come = same ? memory[COME] : come_so_far(memory[ELAPSED], values[TIME_CONSTANT]);
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * come};
}

const effect_type effect_friction_drift = {
    FRICTION_DRIFT_FACTS,     .kind = EFFECT_FRICTION, .memory_count = MEMORY_COUNT,
    .advance = drift_advance, .grip = drift_grip,
};

/* F × (1 + amplitude·exp(−|v|/stribeck_velocity)): friction near standstill differs; amplitude below 0: it rises with
 * speed, as rolling friction does, which no law with static ≥ coulomb can. */

enum { STRIBECK_VELOCITY = 1 }; /* after AMPLITUDE */
/* per velocity of the place */
enum { SPEED, SIDE, MEMORY_ROWS };

static size_t member_count(effect_place place, size_t joints) {
  return place.joint != EFFECT_NOWHERE ? 1 : joints;
}

static size_t stribeck_state_count(size_t joints, size_t tendons, effect_place place) {
  (void)tendons;
  return MEMORY_ROWS * member_count(place, joints);
}

static void stribeck_advance(effect_place place, const double* values, const effect_sample* sample,
                             const double* before, double* after) {
  (void)values;
  (void)before;
  const size_t count = member_count(place, sample->joints);
  for (size_t k = 0; k < count; ++k, after += MEMORY_ROWS) {
    const double v = place.joint != EFFECT_NOWHERE ? sample->velocity[place.joint]
                                                   : sample->tendon_velocity[k * sample->lanes + place.tendon];
    after[SPEED] = fabs(v);
    after[SIDE] = v < 0.0 ? -1.0 : 1.0;
  }
}

static effect_grip stribeck_grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  memory += MEMORY_ROWS * member;
  const double ratio = memory[SPEED] / values[STRIBECK_VELOCITY];
  /* ratio·e^−ratio stays finite; a ratio that is not has come to its end */
  const double near = law_exponential(ratio), change = ratio < 700.0 ? values[AMPLITUDE] * near : 0.0;
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * near,
                       .by_velocity = -change * memory[SIDE] / values[STRIBECK_VELOCITY]};
}

const effect_type effect_stribeck = {
    STRIBECK_FACTS,        .kind = EFFECT_FRICTION, .state_count = stribeck_state_count, .advance = stribeck_advance,
    .grip = stribeck_grip,
};
