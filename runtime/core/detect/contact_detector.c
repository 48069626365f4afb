#include "floating_point.h"

#include "bias_tracker.h"

#include <math.h>

#include "kernel_choice.h"

/* |r| over its threshold */
static double residual_level(double size, double bound) {
  const double level = bound > 0.0 ? size / bound : size > 0.0 ? LARGEST_SUM : 0.0;
  return level < LARGEST_SUM ? level : LARGEST_SUM;
}

/* the paper's rule; lanes without a joint have residual and bounds of 0 and are never in contact */
static int exceed_thresholds(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double bound = f->derived.contact_threshold[j] + f->derived.contact_per_force[j] * mean_force;
    const double size = fabs(s->residual[j]);
    s->level[j] = residual_level(size, bound);
    s->joint_contact[j] = size > bound;
    any |= size > bound;
  }
  return any;
}

/* a joint as its bands take it */
static band_sample sample_of_bands(const tendonfmu_finger* f, size_t j) {
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
static void begin_bands(tendonfmu_finger* f, size_t j, double time) {
  const band_sample sample = sample_of_bands(f, j);
  band_begin(bands_of(f, j), &sample, time, sample.limit, 1);
  f->remembered.level[j] = f->remembered.joint_contact[j] = 0.0;
}

void begin_detection(tendonfmu_finger* f, double time) {
  for (size_t j = 0; f->derived.settings.has_bands && j < f->joints; ++j) {
    begin_bands(f, j, time);
  }
}

static int exceed_bands(tendonfmu_finger* f, double time, double step) {
  const finger_state* s = &f->remembered;
  const int before = s->scalar[STATE_CONTACT] != 0.0;
  int any = 0;
  band_find_shares(&f->scratch.shares, f->scratch.young, bands_of(f, 0), f->joints, time, step,
                   f->kernel->one_minus_exponentials);
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
    s->level[j] = band_take(bands_of(f, j), &sample, &f->scratch.shares, f->scratch.young[j], squares, time, touched,
                            before, &band);
    s->joint_contact[j] = band_decide(bands_of(f, j), &sample, &f->scratch.shares, time, CLOCK_ROUNDING * step, touched,
                                      s->level[j], band);
    any |= s->joint_contact[j] != 0.0;
  }
  return any;
}

int detect_contact(tendonfmu_finger* f, double mean_force, double time, double step) {
  return f->derived.settings.has_bands ? exceed_bands(f, time, step) : exceed_thresholds(f, mean_force);
}

void estimate_variance(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double deviation = f->derived.deviation[j] + f->derived.deviation_per_force[j] * mean_force;
    s->total_variance[j] = s->variance[j] + deviation * deviation;
  }
}
