#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

#include "friction_law.h"

/* F × (1 + amplitude·exp(−|v|/stribeck_velocity)): friction near standstill differs; amplitude below 0: it rises with
 * speed, as rolling friction does, which no law with static ≥ coulomb can. */

enum { AMPLITUDE, STRIBECK_VELOCITY };
/* per velocity of the place */
enum { SPEED, SIDE, MEMORY_ROWS };

static size_t member_count(effect_place place, size_t joints) {
  return place.joint != EFFECT_NOWHERE ? 1 : joints;
}

static size_t state_count(size_t joints, size_t tendons, effect_place place) {
  (void)tendons;
  return MEMORY_ROWS * member_count(place, joints);
}

static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
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

static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  memory += MEMORY_ROWS * member;
  const double ratio = memory[SPEED] / values[STRIBECK_VELOCITY];
  /* ratio·e^−ratio stays finite; a ratio that is not has come to its end */
  const double near = law_exponential(ratio), change = ratio < 700.0 ? values[AMPLITUDE] * near : 0.0;
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * near,
                       .by_velocity = -change * memory[SIDE] / values[STRIBECK_VELOCITY]};
}

const effect_type effect_stribeck = {
    STRIBECK_FACTS, .kind = EFFECT_FRICTION, .state_count = state_count, .advance = advance, .grip = grip,
};
