#include "floating_point.h"

#include "effect_facts.h"

#include "elementary.h"

/* --- inertia: T_j = inertia·a, a the backward difference of the joint's velocity; 0 at the first sample. */

enum { VELOCITY, ACCELERATION, STEP, NUMBERS_REMEMBERED }; /* STEP: 0 at the first sample */

static void advance(const extension_row* row, const effect_sample* sample) {
  const double velocity = sample->velocity[row->place.joint];
  row->now[ACCELERATION] = sample->first ? 0.0 : (velocity - row->before[VELOCITY]) / sample->step;
  row->now[STEP] = sample->first ? 0.0 : sample->step;
  row->now[VELOCITY] = velocity;
}

static void constant_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  (void)sample;
  torque[row->place.joint] += row->parameters[0] * row->now[ACCELERATION];
}

static void constant_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                           double* slope) {
  (void)sample;
  if (row->now[STEP] > 0.0) {
    slope[row->place.joint] += row->parameters[0] * direction->velocity[row->place.joint] / row->now[STEP];
  }
}

const effect_action inertia_action = {.kind = EFFECT_TORQUE,
                                      .memory_count = NUMBERS_REMEMBERED,
                                      .advance = advance,
                                      .torque = constant_torque,
                                      .slope = constant_slope};

/* --- inertia_variation: what turns about a joint comes nearer to its axis as the next joint, whose axis is
 * perpendicular, turns: I = sine·sin 2q_{j+1} + cosine·cos 2q_{j+1}, beside a constant. From the energy ½·I·q̇_j²: T_j =
 * I·a_j + I'·q̇_{j+1}·q̇_j and T_{j+1} = −½·I'·q̇_j², with I' = dI/dq_{j+1} and a_j as above. */

enum { SINE, COSINE };

/* I and I'; I'' = −4·I */
typedef struct variation {
  double value, by_angle;
} variation;

static variation variation_at(const extension_row* row, const effect_sample* sample) {
  const sine_cosine at = sine_cosine_of(2.0 * sample->angle[row->place.joint + 1]);
  const double sine = row->parameters[SINE], cosine = row->parameters[COSINE];
  return (variation){.value = sine * at.sine + cosine * at.cosine,
                     .by_angle = 2.0 * (sine * at.cosine - cosine * at.sine)};
}

static void varied_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  const variation of = variation_at(row, sample);
  const size_t j = row->place.joint;
  const double v = sample->velocity[j], w = sample->velocity[j + 1];
  torque[j] += of.value * row->now[ACCELERATION] + of.by_angle * w * v;
  torque[j + 1] -= 0.5 * of.by_angle * v * v;
}

static void varied_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                         double* slope) {
  const variation of = variation_at(row, sample);
  const size_t j = row->place.joint;
  const double v = sample->velocity[j], w = sample->velocity[j + 1];
  const double v_slope = direction->velocity[j], w_slope = direction->velocity[j + 1];
  const double a_slope = row->now[STEP] > 0.0 ? v_slope / row->now[STEP] : 0.0;
  const double value_slope = of.by_angle * direction->angle[j + 1];
  const double by_angle_slope = -4.0 * of.value * direction->angle[j + 1];
  slope[j] += value_slope * row->now[ACCELERATION] + of.value * a_slope + by_angle_slope * w * v +
              of.by_angle * (w_slope * v + w * v_slope);
  slope[j + 1] -= 0.5 * by_angle_slope * v * v + of.by_angle * v * v_slope;
}

const effect_action inertia_variation_action = {.kind = EFFECT_TORQUE,
                                                .memory_count = NUMBERS_REMEMBERED,
                                                .advance = advance,
                                                .torque = varied_torque,
                                                .slope = varied_slope};
