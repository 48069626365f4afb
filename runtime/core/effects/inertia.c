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
enum { OWN = 0, NEXT = 2, NUMBERS = 4 }; /* torques of both joints by SINE and COSINE */

static void by_numbers(effect_place place, const effect_sample* sample, double a, double* torques) {
  const sine_cosine at = sine_cosine_of(2.0 * sample->angle[place.joint + 1]);
  const double v = sample->velocity[place.joint], w = sample->velocity[place.joint + 1];
  torques[OWN + SINE] = at.sine * a + 2.0 * at.cosine * w * v;
  torques[OWN + COSINE] = at.cosine * a - 2.0 * at.sine * w * v;
  torques[NEXT + SINE] = -at.cosine * v * v;
  torques[NEXT + COSINE] = at.sine * v * v;
}

/* Their derivative along a direction in which the acceleration a of the sample changes by a_slope. */
static void slope_by_numbers(effect_place place, const effect_sample* sample, double a, double a_slope,
                             const effect_direction* direction, double* after) {
  const sine_cosine at = sine_cosine_of(2.0 * sample->angle[place.joint + 1]);
  const double v = sample->velocity[place.joint], w = sample->velocity[place.joint + 1];
  const double v_slope = direction->velocity[place.joint], w_slope = direction->velocity[place.joint + 1];
  const double turn = 2.0 * direction->angle[place.joint + 1], product = w_slope * v + w * v_slope;
  after[OWN + SINE] = at.sine * (a_slope - 2.0 * w * v * turn) + at.cosine * (a * turn + 2.0 * product);
  after[OWN + COSINE] = at.cosine * (a_slope - 2.0 * w * v * turn) - at.sine * (a * turn + 2.0 * product);
  after[NEXT + SINE] = at.sine * v * v * turn - 2.0 * at.cosine * v * v_slope;
  after[NEXT + COSINE] = at.cosine * v * v * turn + 2.0 * at.sine * v * v_slope;
}

static void add_torques(const extension_row* row, const double* by_number, double* torque) {
  const double sine = row->parameters[SINE], cosine = row->parameters[COSINE];
  torque[row->place.joint] += sine * by_number[OWN + SINE] + cosine * by_number[OWN + COSINE];
  torque[row->place.joint + 1] += sine * by_number[NEXT + SINE] + cosine * by_number[NEXT + COSINE];
}

static void varied_torque(const extension_row* row, const effect_sample* sample, double* torque) {
  double by_number[NUMBERS];
  by_numbers(row->place, sample, row->now[ACCELERATION], by_number);
  add_torques(row, by_number, torque);
}

static void varied_slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                         double* slope) {
  double by_number[NUMBERS];
  const double a_slope = row->now[STEP] > 0.0 ? direction->velocity[row->place.joint] / row->now[STEP] : 0.0;
  slope_by_numbers(row->place, sample, row->now[ACCELERATION], a_slope, direction, by_number);
  add_torques(row, by_number, slope);
}

const effect_action inertia_variation_action = {.kind = EFFECT_TORQUE,
                                                .memory_count = NUMBERS_REMEMBERED,
                                                .advance = advance,
                                                .torque = varied_torque,
                                                .slope = varied_slope};
