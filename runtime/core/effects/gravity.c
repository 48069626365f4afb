#include "floating_point.h"

#include "effect_facts.h"

#include "elementary.h"

/* T_j = w_j·(sine·sin θ + cosine·cos θ) for all j up to the joint l that turns the link, θ = Σ_{k<=l} w_k q_k: its
 * weight, exact where the axes are parallel (w = ±1); w_k is the cosine of the angle between the axes of k and l. */

static double axis_cosine(const effect_sample* sample, size_t joint, size_t link) {
  return sample->axis_cosine[joint * sample->joints + link];
}

/* Σ_{k<=l} w_k·row_k: θ of the angles, or its derivative along a direction */
static double turned(const effect_sample* sample, size_t link, const double* row) {
  double sum = 0.0;
  for (size_t k = 0; k <= link; ++k) {
    sum += axis_cosine(sample, k, link) * row[k];
  }
  return sum;
}

static void add_to_joints(const effect_sample* sample, size_t link, double amount, double* torque) {
  for (size_t j = 0; j <= link; ++j) {
    torque[j] += axis_cosine(sample, j, link) * amount;
  }
}

static void torque(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                   double* torque) {
  (void)memory;
  const sine_cosine at = sine_cosine_of(turned(sample, place.joint, sample->angle));
  add_to_joints(sample, place.joint, parameters[0] * at.sine + parameters[1] * at.cosine, torque);
}

static void slope(effect_place place, const double* parameters, const effect_sample* sample, const double* memory,
                  const effect_direction* direction, double* slope) {
  (void)memory;
  const sine_cosine at = sine_cosine_of(turned(sample, place.joint, sample->angle));
  const double by_angle = parameters[0] * at.cosine - parameters[1] * at.sine;
  add_to_joints(sample, place.joint, by_angle * turned(sample, place.joint, direction->angle), slope);
}

const effect_type effect_gravity = {
    GRAVITY_FACTS,
    .kind = EFFECT_TORQUE,
    .torque = torque,
    .slope = slope,
};
