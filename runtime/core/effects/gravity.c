#include "floating_point.h"

#include "effect_facts.h"

#include "elementary.h"

/* T_j = w_j·(sine·sin θ + cosine·cos θ) for all j up to the joint l that turns the link, θ = Σ_{k<=l} w_k q_k: its
 * weight, exact where the axes are parallel (w = ±1); w_k is the cosine of the angle between the axes of k and l. */

static double axis_cosine(const effect_sample* sample, size_t joint, size_t link) {
  return sample->axis_cosine[joint * sample->joints + link];
}

/* Σ_{k<=l} w_k·angle_k: θ of the angles, or its derivative along a direction */
static double turned(const effect_sample* sample, size_t link, const double* angle) {
  double sum = 0.0;
  for (size_t k = 0; k <= link; ++k) {
    sum += axis_cosine(sample, k, link) * angle[k];
  }
  return sum;
}

static void add_to_joints(const effect_sample* sample, size_t link, double amount, double* torque) {
  for (size_t j = 0; j <= link; ++j) {
    torque[j] += axis_cosine(sample, j, link) * amount;
  }
}

static void torque(const extension_row* row, const effect_sample* sample, double* torque) {
  const size_t link = row->place.joint;
  const sine_cosine at = sine_cosine_of(turned(sample, link, sample->angle));
  add_to_joints(sample, link, row->parameters[0] * at.sine + row->parameters[1] * at.cosine, torque);
}

static void slope(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                  double* slope) {
  const size_t link = row->place.joint;
  const sine_cosine at = sine_cosine_of(turned(sample, link, sample->angle));
  const double by_angle = row->parameters[0] * at.cosine - row->parameters[1] * at.sine;
  add_to_joints(sample, link, by_angle * turned(sample, link, direction->angle), slope);
}

const effect_action gravity_action = {.kind = EFFECT_TORQUE, .torque = torque, .slope = slope};
