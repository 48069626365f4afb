/* What several terms have in common. */
#pragma once

#include "effect.h"

/* r_ij */
static inline double arm_at(const effect_sample* sample, size_t joint, size_t tendon) {
  return sample->moment_arm[joint * sample->lanes + tendon];
}

/* sign of a velocity where it moves, else the one that was held before; 0 as long as it never moved */
static inline double held_side(const effect_sample* sample, double velocity, double threshold, const double* before) {
  if (velocity > threshold) {
    return 1.0;
  }
  if (velocity < -threshold) {
    return -1.0;
  }
  return sample->first ? 0.0 : *before;
}
