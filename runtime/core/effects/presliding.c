#include "floating_point.h"

#include "presliding.h"

#include <math.h>

#include "friction_law.h"

/* F = ζ·|F(v)|, dζ = (s − ζ)·|dx|/displacement with s = sgn(dx), integrated exactly over each sample (Dahl 1968 with
 * exponent 1). */

/* per velocity of the place */
enum { SHARE, BY_DISPLACEMENT, BY_VELOCITY, MEMORY_ROWS };

static const effect_parameter parameters[] = {
    {.name = "displacement",
     .unit = "m",
     .unit_at_joint = "rad",
     .minimum = 0.0,
     .maximum = 1e9,
     .above_minimum = 1,
     .required = 1,
     .scale = 1e-4},
};

static size_t member_count(effect_place place, size_t joints) {
  return place.joint != EFFECT_NOWHERE ? 1 : joints;
}

static size_t state_count(size_t joints, size_t tendons, effect_place place) {
  (void)tendons;
  return MEMORY_ROWS * member_count(place, joints);
}

/* finite: no slope may be a reason to refuse a sample */
static double bounded(double slope) {
  return slope > 1e290 ? 1e290 : slope < -1e290 ? -1e290 : slope;
}

static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
  const size_t count = member_count(place, sample->joints);
  for (size_t k = 0; k < count; ++k, before += MEMORY_ROWS, after += MEMORY_ROWS) {
    const double v = place.joint != EFFECT_NOWHERE ? sample->velocity[place.joint]
                                                   : sample->tendon_velocity[k * sample->lanes + place.tendon];
    const double travel = sample->first ? 0.0 : v * sample->step, side = travel < 0.0 ? -1.0 : 1.0;
    const double ratio = fabs(travel) / values[0], kept = law_exponential(ratio), left = side - before[SHARE];
    after[SHARE] = travel == 0.0 ? before[SHARE] : side - left * kept;
    /* nothing is left of where it was: slopes of 0, however short the displacement */
    const int lasts = ratio < 700.0;
    after[BY_DISPLACEMENT] =
        lasts ? bounded(kept * (before[BY_DISPLACEMENT] - bounded(left * ratio / values[0]))) : 0.0;
    after[BY_VELOCITY] = lasts && !sample->first ? bounded(left * kept * side * sample->step / values[0]) : 0.0;
  }
}

static void advance_slope(effect_place place, const double* values, const effect_sample* sample, const double* before,
                          const effect_direction* direction, const double* slope_before, double* slope_after) {
  const size_t count = member_count(place, sample->joints);
  double after[MEMORY_ROWS * EFFECT_ALL_JOINTS];
  advance(place, values, sample, before, after);
  for (size_t k = 0; k < count; ++k) {
    const size_t row = MEMORY_ROWS * k, at = k * sample->lanes + place.tendon;
    const int at_joint = place.joint != EFFECT_NOWHERE;
    const double v = at_joint ? sample->velocity[place.joint] : sample->tendon_velocity[at];
    const double slope = at_joint ? direction->velocity[place.joint] : direction->tendon_velocity[at];
    const double kept = sample->first ? 1.0 : law_exponential(fabs(v * sample->step) / values[0]);
    slope_after[row + SHARE] = kept * slope_before[row + SHARE] + after[row + BY_VELOCITY] * slope;
    slope_after[row + BY_DISPLACEMENT] = slope_after[row + BY_VELOCITY] = 0.0; /* only the share is read */
  }
}

static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)values;
  memory += MEMORY_ROWS * member;
  return (effect_grip){.slides = 1,
                       .value = memory[SHARE],
                       .by_velocity = memory[BY_VELOCITY],
                       .by_parameter = {memory[BY_DISPLACEMENT]}};
}

const effect_type effect_presliding = {
    .name = "presliding",
    .id = 20,
    .kind = EFFECT_FRICTION,
    .joint = PLACE_OPTIONAL,
    .tendon = PLACE_OPTIONAL,
    .rule = PLACES_EXACTLY_ONE,
    .once = 1,
    .parameter_count = 1,
    .parameters = parameters,
    .state_count = state_count,
    .advance = advance,
    .advance_slope = advance_slope,
    .grip = grip,
};
