/* Contact: a joint whose residual exceeds its threshold (paper VI), or what bounds learned from free motion say
 * (docs/reference/semantics/detection.md). */
#pragma once

#include <math.h>

#include "bias_tracker.h"
#include "contact_bands.h"

/* base_j + per_force_j·mean|f0| */
HOT_INLINE quad force_dependent(const double* base, const double* per_force, size_t j, double mean_force) {
  return quad_add(quad_load(base + j), quad_mul(quad_load(per_force + j), quad_set(mean_force)));
}

/* |r| over its threshold */
HOT_INLINE quad residual_level(quad size, quad bound) {
  const quad zero = quad_set(0.0), highest = quad_set(LARGEST_SUM);
  const quad_mask bounded = quad_greater(bound, zero);
  const quad level = quad_min(quad_div(size, quad_select(bounded, bound, quad_set(1.0))), highest);
  return quad_select(bounded, level, quad_keep(quad_greater(size, zero), highest));
}

/* The paper's rule, into joint_contact; returns whether any joint is in contact. Lanes without a joint have residual
 * and bounds of 0 and are never. */
HOT_INLINE int exceed_thresholds(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad bound = force_dependent(f->derived.contact_threshold, f->derived.contact_per_force, j, mean_force);
    const quad size = quad_abs(quad_load(s->residual + j));
    const quad_mask exceeds = quad_greater(size, bound);
    quad_store(s->level + j, residual_level(size, bound));
    quad_store(s->joint_contact + j, quad_keep(exceeds, quad_set(1.0)));
    any |= quad_mask_bits(exceeds);
  }
  return any != 0;
}

/* A joint as its bands take it. */
HOT_INLINE band_sample sample_of_bands(const tendonfmu_finger* f, size_t j) {
  const finger_scratch* s = &f->scratch;
  const double reserve = s->limit[j] - fabs(s->slip_torque[j]);
  return (band_sample){.angle = s->angle[j],
                       .residual = s->torque[j] - s->friction[j] - f->remembered.jumped[j],
                       .load = s->motor_load[j],
                       .torque = s->friction[j],
                       .limit = s->limit[j],
                       .reserve = reserve > 0.0 ? reserve : 0.0};
}

/* the first sample, and joints that were not watched */
COLD_STATIC void begin_bands(tendonfmu_finger* f, size_t j, double time) {
  const band_sample sample = sample_of_bands(f, j);
  band_begin(bands_of(f, j), &sample, time, sample.limit, 1);
  f->remembered.level[j] = f->remembered.joint_contact[j] = 0.0;
}

/* The same by the bands. */
HOT_INLINE int exceed_bands(tendonfmu_finger* f, double time, double step) {
  const finger_state* s = &f->remembered;
  const int before = s->scalar[STATE_CONTACT] != 0.0;
  int any = 0;
  band_find_shares(&f->scratch.shares, step);
  for (size_t j = 0; j < f->joints; ++j) {
    f->scratch.unknown[j] = band_unknown(bands_of(f, j));
    if (f->derived.settings.watches_sensors && s->watch[j] != JOINT_WATCHED) {
      begin_bands(f, j, time);
      continue;
    }
    const band_sample sample = sample_of_bands(f, j);
    const double* squares = f->derived.band_square + j * BANDS * BAND_NUMBERS;
    size_t band = 0;
    const int touched = s->joint_contact[j] != 0.0;
    s->level[j] = band_take(bands_of(f, j), &sample, &f->scratch.shares, squares, time, touched, before, &band);
    s->joint_contact[j] = band_decide(bands_of(f, j), &sample, &f->scratch.shares, time, CLOCK_ROUNDING * step, touched,
                                      s->level[j], band);
    any |= s->joint_contact[j] != 0.0;
  }
  return any;
}

HOT_INLINE int detect_contact(tendonfmu_finger* f, double mean_force, double time, double step) {
  return f->derived.settings.has_bands ? exceed_bands(f, time, step) : exceed_thresholds(f, mean_force);
}

/* the bias stays in contact */
HOT_INLINE void hold_bias(tendonfmu_finger* f, double time) {
  restart_rest(f, time);
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(f->remembered.gain + j, quad_set(0.0));
  }
}

/* square of compensated_torque_std */
HOT_INLINE void estimate_variance(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad deviation = force_dependent(f->derived.deviation, f->derived.deviation_per_force, j, mean_force);
    quad_store(s->total_variance + j, quad_add(quad_load(s->variance + j), quad_mul(deviation, deviation)));
  }
}
