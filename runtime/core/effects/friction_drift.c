#include "floating_point.h"

#include "effect_facts.h"

#include "friction_law.h"

/* F × (1 + amplitude·(1 − exp(−(t − t_0)/time_constant))): run-in, warming up. */

enum { AMPLITUDE, TIME_CONSTANT };
enum { FIRST_TIME, ELAPSED, TOLD_CONSTANT, COME, MEMORY_COUNT };

/* the share reached, 1 − e^−age */
static double come_so_far(double elapsed, double time_constant) {
  return elapsed > 0.0 ? law_one_minus_exponential(elapsed / time_constant) : 0.0;
}

static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
  (void)place;
  after[FIRST_TIME] = sample->first ? sample->time : before[FIRST_TIME];
  after[ELAPSED] = sample->time - after[FIRST_TIME];
  after[TOLD_CONSTANT] = values[TIME_CONSTANT];
  after[COME] = come_so_far(after[ELAPSED], values[TIME_CONSTANT]);
}

/* of every velocity of its place the same, so the exponential is remembered; the number may have changed since */
static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)member;
  const int same = memory[TOLD_CONSTANT] == values[TIME_CONSTANT];
  const double come = same ? memory[COME] : come_so_far(memory[ELAPSED], values[TIME_CONSTANT]);
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * come};
}

const effect_type effect_friction_drift = {
    FRICTION_DRIFT_FACTS, .kind = EFFECT_FRICTION, .memory_count = MEMORY_COUNT, .advance = advance, .grip = grip,
};
