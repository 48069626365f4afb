#include "floating_point.h"

#include "effect_facts.h"

/* T_j = inertia·a, a the backward difference of the joint's velocity; 0 at the first sample. */

enum { VELOCITY, ACCELERATION, STEP, NUMBERS_REMEMBERED }; /* STEP: 0 at the first sample */

static void advance(effect_place place, const double* parameters, const effect_sample* sample, const double* before,
                    double* after) {
  (void)parameters;
  const double velocity = sample->velocity[place.joint];
  after[ACCELERATION] = sample->first ? 0.0 : (velocity - before[VELOCITY]) / sample->step;
  after[STEP] = sample->first ? 0.0 : sample->step;
  after[VELOCITY] = velocity;
}

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)sample;
  torque[place.joint] += parameters[0] * memory[ACCELERATION];
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)sample;
  if (memory[STEP] > 0.0) {
    slope[place.joint] += parameters[0] * direction->velocity[place.joint] / memory[STEP];
  }
}

const effect_type effect_inertia = {
    INERTIA_FACTS,      .kind = EFFECT_TORQUE, .memory_count = NUMBERS_REMEMBERED,
    .advance = advance, .torque = torque,      .slope = slope,
};
