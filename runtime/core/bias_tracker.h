/* The bias procedure of fig. 5: what happens when an effect comes to rest or begins to move, and a Kalman filter per
 * joint that tracks what sticks. */
#ifndef TENDONFMU_BIAS_TRACKER_H
#define TENDONFMU_BIAS_TRACKER_H

#include "force_propagation.h"

/* Four slots at a transition. */
typedef struct transition {
  quad_mask stops, starts;
  quad side_before; /* s1 = sgn(v) of the last moving sample, 0: never moved */
  quad side_now;    /* s2 = sgn(v) */
  quad kept;        /* exp(−forget_rate·(last_stuck − stuck_since)) */
  int negative_before, negative_now;
} transition;

static inline quad velocity_thresholds(const tendonfmu_finger* f, size_t slot) {
  const finger_settings* settings = &f->derived.settings;
  return quad_set(slot < f->joints * f->tendon_lanes ? settings->tendon_threshold : settings->joint_threshold);
}

static inline quad_mask moving_now(const tendonfmu_finger* f, size_t slot) {
  return quad_greater(quad_abs(quad_load(f->scratch.velocity + slot)), velocity_thresholds(f, slot));
}

static inline quad_mask moving_before(const tendonfmu_finger* f, size_t slot) {
  return quad_greater(quad_load(f->remembered.moving + slot), quad_set(0.5));
}

/* whether any slot comes to rest or begins to move: rare, so that the rest of this file costs little */
static inline int any_transition(const tendonfmu_finger* f) {
  int changed = 0;
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    changed |= quad_mask_bits(quad_differ(moving_now(f, slot), moving_before(f, slot)));
  }
  return changed;
}

static inline transition transition_at(const tendonfmu_finger* f, size_t slot) {
  const finger_state* s = &f->remembered;
  const quad velocity = quad_load(f->scratch.velocity + slot);
  const quad_mask now = moving_now(f, slot), before = moving_before(f, slot);
  const quad rested = quad_sub(quad_load(s->last_stuck + slot), quad_load(s->stuck_since + slot));
  const quad side = quad_load(s->side + slot);
  return (transition){
      .stops = quad_only_first(before, now),
      .starts = quad_only_first(now, before),
      .side_before = side,
      .side_now = quad_with_sign(quad_set(1.0), velocity),
      .kept = exp_of_minus(quad_mul(quad_set(f->derived.settings.forget_rate), rested)),
      .negative_before = negative_bits(side),
      .negative_now = negative_bits(velocity),
  };
}

/* b of fig. 5, from |F| at v_min on the side before and on the side now */
static inline quad bias_jump(const transition* t, quad magnitude_before, quad magnitude_now) {
  const quad before = quad_mul(t->side_before, magnitude_before); /* 0 where it never moved */
  const quad now = quad_mul(t->side_now, magnitude_now);
  const quad_mask moved = quad_greater(quad_abs(t->side_before), quad_set(0.5));
  const quad remembered = quad_keep(moved, quad_mul(quad_sub(before, now), t->kept));
  const quad starting = quad_sub(quad_sub(quad_set(0.0), now), remembered);
  return quad_select(t->stops, before, quad_keep(t->starts, starting));
}

static inline quad bias_jump_of_laws(const double* laws, const transition* t, quad threshold) {
  return bias_jump(t, laws_magnitude(laws, t->negative_before, threshold),
                   laws_magnitude(laws, t->negative_now, threshold));
}

static inline void tendon_bias_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t lanes = f->tendon_lanes;
  const quad threshold = quad_set(f->derived.settings.tendon_threshold);
  for (size_t j = 0; j < f->joints; ++j) {
    const double before = angle_before(s->angle, j);
    for (size_t i = 0; i < lanes; i += 4) {
      const size_t at = j * lanes + i;
      const transition t = transition_at(f, at);
      quad edge = quad_set(0.0), pulley = quad_set(0.0);
      if (quad_mask_bits(t.stops) | quad_mask_bits(t.starts)) {
        edge = bias_jump(&t, edges_magnitude(f, j, i, before, t.negative_before, threshold),
                         edges_magnitude(f, j, i, before, t.negative_now, threshold));
        pulley = bias_jump_of_laws(f->derived.pulley_law + at * LAW_NUMBERS, &t, threshold);
      }
      quad_store(s->edge_bias + at, edge);
      quad_store(s->pulley_bias + at, pulley);
    }
  }
}

static inline void joint_bias_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t joint_row = f->joints * f->tendon_lanes;
  const quad threshold = quad_set(f->derived.settings.joint_threshold);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const transition t = transition_at(f, joint_row + j);
    const quad joint = bias_jump_of_laws(f->derived.joint_law + j * LAW_NUMBERS, &t, threshold);
    const quad load = bias_jump_of_laws(f->derived.load_law + j * LAW_NUMBERS, &t, threshold);
    quad_store(s->joint_bias + j, joint);
    quad_store(s->load_bias + j, load);
  }
}

/* Δb_j: eq. (10) with the b in place of the F, at the forces already propagated */
static inline void sum_bias_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  quad step[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    step[j] = quad_set(0.0);
  }
  for (size_t i = 0; i < lanes; i += 4) {
    quad sum = quad_set(0.0);
    for (size_t j = 0; j < n; ++j) {
      const size_t at = j * lanes + i;
      sum = quad_add(sum, quad_mul(quad_load(s->force_at + at), quad_load(s->edge_bias + at)));
      if (j + 1 < n) {
        sum = quad_add(sum, quad_mul(quad_load(s->force_between + at), quad_load(s->pulley_bias + at + lanes)));
      }
      step[j] = quad_add(step[j], quad_mul(quad_load(f->derived.moment_arm + at), sum));
    }
  }
  for (size_t j = 0; j < n; ++j) {
    s->bias_step[j] = quad_sum(step[j]) + (s->joint_bias[j] + s->load_bias[j] * s->load[j]);
  }
}

/* bias_step [n] of this sample */
static inline void bias_steps(tendonfmu_finger* f) {
  if (any_transition(f)) {
    tendon_bias_jumps(f);
    joint_bias_jumps(f);
    sum_bias_jumps(f);
  } else {
    for (size_t j = 0; j < f->joint_lanes; j += 4) {
      quad_store(f->scratch.bias_step + j, quad_set(0.0));
    }
  }
}

/* brings the memory of every slot up to this sample */
static inline void remember_slots(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const quad now_time = quad_set(time);
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    const quad_mask now = moving_now(f, slot), before = moving_before(f, slot);
    const quad_mask stops = quad_only_first(before, now), starts = quad_only_first(now, before);
    const quad side = quad_load(s->side + slot);
    const quad one = quad_set(1.0);
    const quad velocity_side = quad_with_sign(one, quad_load(f->scratch.velocity + slot));
    quad_store(s->side_before + slot, side);
    quad_store(s->side + slot, quad_select(now, velocity_side, side));
    quad_store(s->moving + slot, quad_keep(now, one));
    quad_store(s->event + slot, quad_sub(quad_keep(stops, one), quad_keep(starts, one)));
    quad_store(s->stuck_since + slot, quad_select(stops, now_time, quad_load(s->stuck_since + slot)));
    quad_store(s->last_stuck + slot, quad_select(now, quad_load(s->last_stuck + slot), now_time));
  }
}

/* fig. 5, contact: what sticks counts as having come to rest just now */
static inline void restart_rest(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    const quad since = quad_load(s->stuck_since + slot);
    quad_store(s->stuck_since + slot, quad_select(moving_before(f, slot), since, quad_set(time)));
  }
}

/* variance of the noise on the torque at this mean tendon force, (N·m)² */
static inline double noise_variance(const finger_settings* settings, double mean_force, double scale) {
  const double noise = settings->noise_std + settings->noise_std_per_force * mean_force;
  return noise * noise * scale;
}

/* one Kalman step per joint on the residual r = τ − T_eff; friction and bias take their share of it */
static inline void track_bias(tendonfmu_finger* f, double step, double noise) {
  const finger_state* s = &f->remembered;
  const quad zero = quad_set(0.0), one = quad_set(1.0);
  const quad drift = quad_set(f->derived.settings.drift_variance * step);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad predicted = quad_add(quad_load(s->variance + j), drift);
    const quad total = quad_add(predicted, quad_set(noise));
    const quad_mask known = quad_greater(total, zero);
    const quad gain = quad_keep(known, quad_div(predicted, quad_select(known, total, one)));
    const quad correction = quad_mul(gain, quad_sub(quad_load(s->torque + j), quad_load(s->friction + j)));
    quad_store(s->bias + j, quad_add(quad_load(s->bias + j), correction));
    quad_store(s->friction + j, quad_add(quad_load(s->friction + j), correction));
    quad_store(s->predicted_variance + j, predicted);
    quad_store(s->variance + j, quad_mul(quad_sub(one, gain), predicted));
    quad_store(s->gain + j, gain);
  }
}

#endif
