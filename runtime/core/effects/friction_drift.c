#include "floating_point.h"

#include "effect_facts.h"

#include "friction_law.h"

/* F × (1 + amplitude·(1 − exp(−(t − t_0)/time_constant))): run-in, warming up. */

enum { AMPLITUDE, TIME_CONSTANT };
/* what has come of it, 1 − e^−age, and how fast it comes with age, −age·e^−age, for the time constant it was told */
enum { FIRST_TIME, ELAPSED, TOLD_CONSTANT, COME, BY_AGE, MEMORY_COUNT };

static void come_so_far(double elapsed, double time_constant, double* come, double* by_age) {
  const double age = elapsed > 0.0 ? elapsed / time_constant : 0.0;
  *come = law_one_minus_exponential(age);
  *by_age = age < 700.0 ? -age * law_exponential(age) : 0.0; /* beyond it may be infinite times 0 */
}

static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
  (void)place;
  after[FIRST_TIME] = sample->first ? sample->time : before[FIRST_TIME];
  after[ELAPSED] = sample->time - after[FIRST_TIME];
  after[TOLD_CONSTANT] = values[TIME_CONSTANT];
  come_so_far(after[ELAPSED], values[TIME_CONSTANT], after + COME, after + BY_AGE);
}

/* of every velocity of its place the same, so the exponentials are remembered; the number may have changed since */
static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)member;
  double come = memory[COME], by_age = memory[BY_AGE];
  if (memory[TOLD_CONSTANT] != values[TIME_CONSTANT]) {
    come_so_far(memory[ELAPSED], values[TIME_CONSTANT], &come, &by_age);
  }
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * come,
                       .by_parameter = {come, values[AMPLITUDE] * by_age / values[TIME_CONSTANT]}};
}

const effect_type effect_friction_drift = {
    FRICTION_DRIFT_FACTS, .kind = EFFECT_FRICTION, .memory_count = MEMORY_COUNT, .advance = advance, .grip = grip,
};
