#include "floating_point.h"

#include "friction_drift.h"

#include "friction_law.h"

/* F × (1 + amplitude·(1 − exp(−(t − t_0)/time_constant))): run-in, warming up. */

enum { AMPLITUDE, TIME_CONSTANT };
enum { FIRST_TIME, ELAPSED, MEMORY_COUNT };

static const effect_parameter parameters[] = {
    {.name = "amplitude", .unit = "1", .minimum = -0.9, .maximum = 1e9, .required = 1, .scale = 0.3},
    {.name = "time_constant",
     .unit = "s",
     .minimum = 0.0,
     .maximum = 1e9,
     .above_minimum = 1,
     .required = 1,
     .scale = 100.0},
};

static size_t state_count(size_t joints, size_t tendons, effect_place place) {
  (void)joints;
  (void)tendons;
  (void)place;
  return MEMORY_COUNT;
}

static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
  (void)place;
  (void)values;
  after[FIRST_TIME] = sample->first ? sample->time : before[FIRST_TIME];
  after[ELAPSED] = sample->time - after[FIRST_TIME];
}

static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)member;
  const double elapsed = memory[ELAPSED] > 0.0 ? memory[ELAPSED] : 0.0, age = elapsed / values[TIME_CONSTANT];
  const double come = law_one_minus_exponential(age);
  /* age² e^−age stays finite; an age that is not has come to its end */
  const double by_time = age < 700.0 ? -values[AMPLITUDE] * law_exponential(age) * age / values[TIME_CONSTANT] : 0.0;
  return (effect_grip){.value = 1.0 + values[AMPLITUDE] * come, .by_parameter = {come, by_time}};
}

const effect_type effect_friction_drift = {
    .name = "friction_drift",
    .id = 21,
    .kind = EFFECT_FRICTION,
    .joint = PLACE_OPTIONAL,
    .tendon = PLACE_OPTIONAL,
    .rule = PLACES_AT_MOST_ONE,
    .parameter_count = 2,
    .parameters = parameters,
    .state_count = state_count,
    .advance = advance,
    .grip = grip,
};
