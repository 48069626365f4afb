#include "floating_point.h"

#include "bias_tracker.h"

#include <math.h>

#include "extensions.h"
#include "finger_memory.h"

/* --- jumps ----------------------------------------------------------------------------------------------------------
 */

static int moves_now(const tendonfmu_finger* f, size_t slot) {
  return fabs(f->scratch.velocity[slot]) > threshold_of(f, slot);
}

/* comes to rest or begins to move */
static int changes(const tendonfmu_finger* f, size_t slot) {
  return moves_now(f, slot) != (f->remembered.moving[slot] > 0.5);
}

static transition transition_at(const tendonfmu_finger* f, size_t slot) {
  const finger_state* s = &f->remembered;
  return (transition){.stops = s->moving[slot] > 0.5,
                      .side_before = s->side[slot],
                      .side_now = copysign(1.0, f->scratch.velocity[slot]),
                      .exponent = rest_exponent(f, slot, s->scalar[STATE_ABSORBED]),
                      .threshold = threshold_of(f, slot)};
}

dual jump_of(const transition* t, const effect_laws* laws) {
  const dual speed = {t->threshold, 0.0};
  const dual before = scaled(t->side_before, magnitude_at(laws, t->side_before < 0.0, speed)); /* 0: it never moved */
  if (t->stops) {
    return before;
  }
  const dual now = scaled(t->side_now, magnitude_at(laws, t->side_now < 0.0, speed));
  const double kept = t->side_before == 0.0 ? 0.0 : law_exponential(t->exponent);
  return sum(scaled(-1.0, now), scaled(-kept, difference(before, now)));
}

static void jump_tendon(tendonfmu_finger* f, size_t joint, size_t tendon) {
  const size_t slot = joint * f->tendon_lanes + tendon;
  f->scratch.edge_bias[slot] = f->scratch.pulley_bias[slot] = 0.0;
  if (changes(f, slot)) {
    const transition t = transition_at(f, slot);
    const dual angle = {joint ? f->scratch.angle[joint - 1] : 0.0, 0.0};
    const effect_laws edge = edge_laws(f, joint, tendon, angle);
    const effect_laws pulley = {.below = f->derived.pulley_law + slot * LAW_NUMBERS};
    f->scratch.edge_bias[slot] = jump_of(&t, &edge).value;
    f->scratch.pulley_bias[slot] = jump_of(&t, &pulley).value;
  }
}

static void jump_joint(tendonfmu_finger* f, size_t joint) {
  const size_t slot = f->joints * f->tendon_lanes + joint;
  f->scratch.joint_bias[joint] = f->scratch.load_bias[joint] = 0.0;
  if (changes(f, slot)) {
    const transition t = transition_at(f, slot);
    const effect_laws own = {.below = f->derived.joint_law + joint * LAW_NUMBERS};
    const effect_laws load = {.below = f->derived.load_law + joint * LAW_NUMBERS};
    f->scratch.joint_bias[joint] = jump_of(&t, &own).value;
    f->scratch.load_bias[joint] = jump_of(&t, &load).value;
  }
}

/* Δb_j: eq. (10) with the b in place of the F, at the forces already propagated */
static void sum_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  double steps[MODEL_MAX_JOINTS][4] = {{0.0}};
  for (size_t i = 0; i < lanes; ++i) {
    double sum = 0.0;
    for (size_t j = 0; j < n; ++j) {
      const size_t at = j * lanes + i;
      sum += s->force_at[at] * s->edge_bias[at];
      sum += j + 1 < n ? s->force_between[at] * s->pulley_bias[at + lanes] : 0.0;
      steps[j][i % 4] += f->derived.moment_arm[at] * sum;
    }
  }
  for (size_t j = 0; j < n; ++j) {
    s->bias_step[j] = sum_of_lanes(steps[j]) + (s->joint_bias[j] + s->load_bias[j] * s->load[j]);
  }
}

void find_bias_steps(tendonfmu_finger* f) {
  for (size_t slot = 0; slot < f->joints * f->tendon_lanes; ++slot) {
    jump_tendon(f, slot / f->tendon_lanes, slot % f->tendon_lanes);
  }
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    jump_joint(f, j);
  }
  if (f->extensions.gripped) {
    grip_jumps(f);
  }
  sum_jumps(f);
}

void remember_transitions(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const double clock = has_option(f, MODEL_FORGETS_BY_ABSORPTION) ? s->scalar[STATE_ABSORBED] : time;
  for (size_t slot = 0; slot < f->slots; ++slot) {
    const int now = moves_now(f, slot), before = s->moving[slot] > 0.5;
    s->event[slot] = now && !before ? s->side[slot] - 2.0 : before && !now ? 1.0 : 0.0;
    s->stuck_since[slot] = before && !now ? clock : s->stuck_since[slot];
    s->moving[slot] = now;
  }
}

void hold_bias(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  clear_lanes(s->gain, f->joint_lanes);
  for (size_t slot = 0; !has_option(f, MODEL_FORGETS_BY_ABSORPTION) && slot < f->slots; ++slot) {
    s->stuck_since[slot] = s->moving[slot] > 0.5 ? s->stuck_since[slot] : time;
  }
}

/* --- the filter -----------------------------------------------------------------------------------------------------
 */

/* variance of the noise on the torque at this mean tendon force, (N·m)² */
static double noise_variance(const finger_settings* settings, double mean_force, double scale) {
  const double noise = settings->noise_std + settings->noise_std_per_force * mean_force;
  return noise * noise * scale;
}

double noise_of_step(const tendonfmu_finger* f, double step, double mean_force) {
  const finger_settings* settings = &f->derived.settings;
  const double wanted = settings->noise_time >= 0.0 ? settings->noise_time / step : 1.0;
  const double scale = wanted < 1e300 ? wanted : 1e300; /* finite, however short the step */
  return noise_variance(settings, mean_force, scale);
}

void begin_bias(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const double variance =
      settings->initial_variance >= 0.0 ? settings->initial_variance : noise_variance(settings, mean_force, 1.0);
  for (size_t j = 0; j < f->joints; ++j) {
    s->bias[j] = settings->has_initial_torque ? f->derived.initial_torque[j] : s->torque[j] - f->scratch.friction[j];
    s->variance[j] = variance;
    s->gain[j] = 0.0;
    /* without a given torque the same to the last bit */
    s->friction[j] = settings->has_initial_torque ? s->bias[j] + f->scratch.friction[j] : s->torque[j];
  }
}

void predict_residual(tendonfmu_finger* f, double step, double noise) {
  const finger_state* s = &f->remembered;
  const double drift = f->derived.settings.drift_variance * step;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    f->scratch.residual_variance[j] = s->variance[j] + drift + noise;
    if (!f->guide.learns) {
      s->variance[j] += drift;
      s->gain[j] = 0.0;
    }
  }
}

/* K, 0 where nothing is known to be uncertain */
static double kalman_gain(double predicted, double noise) {
  const double total = predicted + noise;
  return total > 0.0 ? predicted / total : 0.0;
}

/* K with the variance of friction whose state nobody knows beside P⁻: it is distributed evenly */
static double gain_of_joint(const tendonfmu_finger* f, size_t j, double predicted, double noise, double gain) {
  if (!has_option(f, MODEL_DETECTS_BY_BANDS) || f->guide.guides) {
    return gain;
  }
  const double unknown = f->scratch.unknown[j];
  return kalman_gain(predicted + unknown * unknown * (1.0 / 3.0), noise);
}

/* Λ: what the filter absorbs */
static void count_absorbed(tendonfmu_finger* f, double left) {
  const double absorbed = left > 0.0 ? -law_logarithm(left) : 700.0;
  f->remembered.scalar[STATE_ABSORBED] += absorbed < 700.0 ? absorbed : 700.0;
}

void track_bias(tendonfmu_finger* f, double step, double noise) {
  const finger_state* s = &f->remembered;
  const double drift = f->derived.settings.drift_variance * step;
  double left = 1.0; /* without what is unknown the same at all joints */
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double predicted = s->variance[j] + drift, gain = kalman_gain(predicted, noise);
    s->gain[j] = gain_of_joint(f, j, predicted, noise, gain);
    s->bias[j] += s->gain[j] * s->residual[j];
    s->friction[j] += s->gain[j] * s->residual[j];
    s->variance[j] = (1.0 - gain) * predicted;
    left = j ? left : 1.0 - gain;
  }
  if (has_option(f, MODEL_FORGETS_BY_ABSORPTION)) {
    count_absorbed(f, left);
  }
}
