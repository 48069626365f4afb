#include "floating_point.h"

#include "bias_tracker.h"

#include <math.h>
#include <string.h>

#include "kernel_choice.h"

_Alignas(32) const double band_mean_time[BANDS] = {0.004, 0.02, 0.06, 0.5};
_Alignas(32) const double band_reference_time[BANDS] = {0.05, 0.3, 1.0, 10.0};

#define HELD_TIME    10.0  /* s, H: with which home follows, and references and bases in contact */
#define UNKNOWN_TIME 1.0   /* s */
#define SHORTEST     0.02  /* s, of a contact */
#define HIGHEST      1e300 /* square of a level */
#define TURNED       0.5   /* of all that friction can hold: then the start is behind, */
#define MOVED        0.1   /* rad; or so far from it */
#define END          0.4   /* of its peak, below which a contact has ended */

enum { HOME_BAND = 1, END_BAND = 2 };

/* --- the paper's rule --------------------------------------------------------------------------------------------- */

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

/* --- bands -------------------------------------------------------------------------------------------------------- */

static double larger(double a, double b) {
  return a > b ? a : b;
}

static double smaller(double a, double b) {
  return a < b ? a : b;
}

/* what depends on the step alone */
static void find_shares_of_step(const step_kernel* kernel, band_shares* shares, double step) {
  _Alignas(32) double value[12] = {[8] = step / HELD_TIME, [9] = step / UNKNOWN_TIME};
  for (size_t k = 0; k < BANDS; ++k) {
    value[k] = step / band_mean_time[k];
    value[BANDS + k] = step / band_reference_time[k];
  }
  kernel->one_minus_exponentials(value, value, 12);
  shares->step = step;
  for (size_t k = 0; k < BANDS; ++k) {
    shares->mean[k] = value[k];
    shares->reference[k] = value[BANDS + k];
    shares->kept[k] = 1.0 - shares->reference[k];
  }
  shares->held = value[8];
  shares->unknown = 1.0 - value[9];
}

/* and what depends on when the means of each joint began */
static void find_shares(const tendonfmu_finger* f, double time, double step) {
  double* young = f->scratch.young;
  int any = 0;
  if (f->scratch.shares->step != step) {
    find_shares_of_step(f->kernel, f->scratch.shares, step);
  }
  for (size_t j = 0; j < f->joints; ++j) {
    const double age = time - bands_of(f, j)->begun_at;
    young[j] = step / age;
    any |= age < band_reference_time[BANDS - 1];
  }
  if (any) {
    f->kernel->one_minus_exponentials(young, young, f->joint_lanes);
  }
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

/* unknown: V. First: at the first sample, where it was not watched, and when it first moves. */
static void begin_joint(band_memory* joint, const band_sample* sample, double time, double unknown, int first) {
  for (size_t k = 0; k < BANDS; ++k) {
    joint->mean[k] = joint->reference[k] = sample->residual;
    joint->load[k] = joint->load_reference[k] = sample->load;
    joint->torque[k] = joint->torque_reference[k] = sample->torque;
    joint->driven[k] = 0.0;
    joint->reserve[k] = first ? 0.0 : joint->reserve[k];
  }
  joint->home = first ? sample->residual : joint->home;
  joint->has_moved = first ? 0.0 : joint->has_moved;
  joint->turned = first ? 0.0 : joint->turned;
  joint->start = first ? sample->angle : joint->start;
  joint->unknown = unknown;
  joint->begun_at = joint->touched_at = time;
  joint->base = joint->sign = joint->peak = 0.0;
  joint->friction = fabs(sample->torque);
  joint->limit = sample->limit;
}

/* the first sample, and joints that were not watched */
static void begin_bands(tendonfmu_finger* f, size_t j, double time) {
  const band_sample sample = sample_of_bands(f, j);
  begin_joint(bands_of(f, j), &sample, time, sample.limit, 1);
  f->remembered.level[j] = f->remembered.joint_contact[j] = 0.0;
}

void begin_detection(tendonfmu_finger* f, double time) {
  for (size_t j = 0; has_option(f, MODEL_DETECTS_BY_BANDS) && j < f->joints; ++j) {
    begin_bands(f, j, time);
  }
}

/* what of a joint is no band */
static void follow_sample(band_memory* joint, const band_sample* sample, const band_shares* shares, int any) {
  if (!any) {
    joint->home += shares->held * (joint->mean[HOME_BAND] - joint->home);
  }
  joint->unknown *= shares->unknown;
  joint->friction = fabs(sample->torque);
  joint->limit = sample->limit;
}

/* friction has turned over, or may have: the joint begins anew if it was not in contact */
static int turns(band_memory* joint, const band_sample* sample, double time, int before) {
  joint->turned = larger(joint->turned, sample->limit - sample->reserve);
  if (!before && joint->turned > TURNED * sample->limit) {
    begin_joint(joint, sample, time, sample->limit, 1);
    joint->has_moved = 1.0;
    return 1;
  }
  if (fabs(sample->angle - joint->start) > MOVED) {
    joint->turned = 0.0;
    joint->has_moved = 1.0;
  }
  return 0;
}

/* takes a sample of a joint; returns its level, and the band that has it */
static double take_bands(const tendonfmu_finger* f, size_t j, const band_sample* sample, double time, size_t* band) {
  const finger_state* s = &f->remembered;
  const int any = s->scalar[STATE_CONTACT] != 0.0; /* in contact before */
  band_memory* joint = bands_of(f, j);
  _Alignas(32) double terms[BAND_TERMS * BANDS];
  *band = 0;
  f->kernel->follow_bands(joint, sample, f->scratch.shares, f->scratch.young[j], time - joint->begun_at, any);
  follow_sample(joint, sample, f->scratch.shares, any);
  if (joint->has_moved == 0.0 && turns(joint, sample, time, s->joint_contact[j] != 0.0)) {
    return 0.0;
  }
  const double* squares = f->derived.band_square + j * BANDS * BAND_NUMBERS;
  return sqrt(smaller(f->kernel->weigh_bands(joint, squares, terms, band), HIGHEST));
}

/* whether a joint is in contact now, from its level and the band that has it */
static int decide(const tendonfmu_finger* f, size_t j, const band_sample* sample, double time, double step,
                  size_t band) {
  band_memory* joint = bands_of(f, j);
  const int before = f->remembered.joint_contact[j] != 0.0;
  if (!before) {
    if (!(f->remembered.level[j] > 1.0)) {
      return 0;
    }
    const double reference = joint->reference[band], home = joint->home;
    joint->sign = joint->mean[band] < reference ? -1.0 : 1.0;
    joint->base = joint->sign < 0.0 ? smaller(reference, home) : larger(reference, home);
    joint->peak = 0.0;
    joint->touched_at = time;
    return 1;
  }
  joint->base += f->scratch.shares->held * (joint->mean[END_BAND] - joint->base);
  const double now = (joint->mean[END_BAND] - joint->base) * joint->sign;
  joint->peak = larger(joint->peak, now);
  if (time - joint->touched_at > SHORTEST + CLOCK_ROUNDING * step && now < END * joint->peak) {
    begin_joint(joint, sample, time, joint->peak, 0);
    return 0;
  }
  return 1;
}

static int exceed_bands(tendonfmu_finger* f, double time, double step) {
  const finger_state* s = &f->remembered;
  int any = 0;
  find_shares(f, time, step);
  for (size_t j = 0; j < f->joints; ++j) {
    size_t band;
    f->scratch.unknown[j] = band_unknown(bands_of(f, j));
    if (has_option(f, MODEL_HAS_SENSOR_FAULT) && s->watch[j] != JOINT_WATCHED) {
      begin_bands(f, j, time);
      continue;
    }
    const band_sample sample = sample_of_bands(f, j);
    s->level[j] = take_bands(f, j, &sample, time, &band);
    s->joint_contact[j] = decide(f, j, &sample, time, step, band);
    any |= s->joint_contact[j] != 0.0;
  }
  return any;
}

int detect_contact(tendonfmu_finger* f, double mean_force, double time, double step) {
  return has_option(f, MODEL_DETECTS_BY_BANDS) ? exceed_bands(f, time, step) : exceed_thresholds(f, mean_force);
}

void estimate_variance(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double deviation = f->derived.deviation[j] + f->derived.deviation_per_force[j] * mean_force;
    s->total_variance[j] = s->variance[j] + deviation * deviation;
  }
}
