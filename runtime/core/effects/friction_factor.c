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

static void drift_advance(const extension_row* row, const effect_sample* sample) {
  const double constant = row->parameters[TIME_CONSTANT];
  row->now[FIRST_TIME] = sample->first ? sample->time : row->before[FIRST_TIME];
  row->now[ELAPSED] = sample->time - row->now[FIRST_TIME];
  row->now[TOLD_CONSTANT] = constant;
  row->now[COME] = come_so_far(row->now[ELAPSED], constant);
}

/* of every velocity of its place the same, so the exponential is remembered; the number may have changed since */
static effect_grip drift_grip(const extension_row* row, size_t member) {
  (void)member;
  const double constant = row->parameters[TIME_CONSTANT];
  const int same = row->now[TOLD_CONSTANT] == constant;
  const double come = same ? row->now[COME] : come_so_far(row->now[ELAPSED], constant);
  return (effect_grip){.value = 1.0 + row->parameters[AMPLITUDE] * come};
}

const effect_action friction_drift_action = {
    .kind = EFFECT_FRICTION, .memory_count = MEMORY_COUNT, .advance = drift_advance, .grip = drift_grip};

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

static void stribeck_advance(const extension_row* row, const effect_sample* sample) {
  const effect_place place = row->place;
  const size_t count = member_count(place, sample->joints);
  for (size_t k = 0; k < count; ++k) {
    const double v = place.joint != EFFECT_NOWHERE ? sample->velocity[place.joint]
                                                   : sample->tendon_velocity[k * sample->lanes + place.tendon];
    row->now[MEMORY_ROWS * k + SPEED] = fabs(v);
    row->now[MEMORY_ROWS * k + SIDE] = v < 0.0 ? -1.0 : 1.0;
  }
}

static effect_grip stribeck_grip(const extension_row* row, size_t member) {
  const double *at = row->now + MEMORY_ROWS * member, *values = row->parameters;
  const double ratio = at[SPEED] / values[STRIBECK_VELOCITY];
  /* ratio·e^−ratio stays finite; a ratio that is not has come to its end */
  const double near = law_exponential(ratio), change = ratio < 700.0 ? values[AMPLITUDE] * near : 0.0;
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * near,
                       .by_velocity = -change * at[SIDE] / values[STRIBECK_VELOCITY]};
}

const effect_action stribeck_action = {
    .kind = EFFECT_FRICTION, .state_count = stribeck_state_count, .advance = stribeck_advance, .grip = stribeck_grip};
