/* The bias procedure of fig. 5: what happens when an effect comes to rest or begins to move, and a Kalman filter per
 * joint that tracks what sticks. */
#pragma once

#include "extensions.h"
#include "force_propagation.h"

/* Four slots at a transition. */
typedef struct transition {
  quad_mask stops, starts;
  quad side_before;    /* s1 = sgn(v) of the last moving sample, 0: never moved */
  quad side_now;       /* s2 = sgn(v) */
  quad kept;           /* exp(−forget_rate·(last_stuck − stuck_since)) */
  int negative_before; /* one bit a lane: s1 < 0 */
} transition;

/* before remember_transitions(), which overwrites what moved at the sample before */
HOT_INLINE quad_mask moving_now(const tendonfmu_finger* f, size_t slot) {
  const finger_settings* settings = &f->derived.settings;
  const int own = slot >= f->joints * f->tendon_lanes;
  return moves_at(quad_abs(quad_load(f->scratch.velocity + slot)),
                  own ? settings->joint_threshold : settings->tendon_threshold);
}

/* the exponent of forgetting: what time or the filter has taken from a slot's torque since it came to rest */
HOT_INLINE quad forgotten(const tendonfmu_finger* f, size_t slot) {
  const finger_state* s = &f->remembered;
  const quad since = quad_load(s->stuck_since + slot);
  if (f->derived.settings.forgets_by_absorption) {
    return quad_sub(quad_set(s->scalar[STATE_ABSORBED]), since);
  }
  return quad_mul(quad_set(f->derived.settings.forget_rate), quad_sub(quad_load(s->last_stuck + slot), since));
}

COLD_STATIC transition transition_at(const tendonfmu_finger* f, size_t slot) {
  const finger_state* s = &f->remembered;
  const quad velocity = quad_load(f->scratch.velocity + slot);
  const quad_mask now = moving_now(f, slot), before = moved_before(f, slot);
  const quad side = quad_load(s->side + slot);
  return (transition){
      .stops = quad_only_first(before, now),
      .starts = quad_only_first(now, before),
      .side_before = side,
      .side_now = quad_with_sign(quad_set(1.0), velocity),
      .kept = exp_of_minus(forgotten(f, slot)),
      .negative_before = negative_bits(side),
  };
}

/* lanes that have moved at all */
HOT_INLINE quad_mask has_moved(const transition* t) {
  return quad_greater(quad_abs(t->side_before), quad_set(0.5));
}

/* b of fig. 5, from |F| at v_min on the side before and on the side now */
HOT_INLINE quad bias_jump(const transition* t, quad magnitude_before, quad magnitude_now) {
  const quad before = quad_mul(t->side_before, magnitude_before); /* 0 where it never moved */
  const quad now = quad_mul(t->side_now, magnitude_now);
  const quad remembered = quad_keep(has_moved(t), quad_mul(quad_sub(before, now), t->kept));
  const quad starting = quad_sub(quad_sub(quad_set(0.0), now), remembered);
  return quad_select(t->stops, before, quad_keep(t->starts, starting));
}

/* b of the two effects at each of four slots, in the rows where F stands for them */
COLD_STATIC void jump_tendons(tendonfmu_finger* f, size_t slot, double angle, quad threshold) {
  const finger_scratch* s = &f->scratch;
  const transition t = transition_at(f, slot);
  quad edge = quad_set(0.0), pulley = quad_set(0.0);
  if (quad_mask_bits(t.stops) | quad_mask_bits(t.starts)) {
    const slot_view* now = s->view + slot / 4;
    _Alignas(32) slot_view before;
    const size_t lane = view_lane(slot);
    slot_view_fill(f, slot, QUAD_LANES, angle, t.negative_before, &before);
    edge = bias_jump(&t, edges_magnitude(&before, lane, quad_set(angle), threshold),
                     edges_magnitude(now, lane, quad_set(angle), threshold));
    pulley = bias_jump(&t, laws_magnitude(before.other, lane, threshold), laws_magnitude(now->other, lane, threshold));
  }
  quad_store(s->edge_bias + slot, edge);
  quad_store(s->pulley_bias + slot, pulley);
}

COLD_STATIC void jump_joints(tendonfmu_finger* f, size_t joint, quad threshold) {
  const finger_scratch* s = &f->scratch;
  const size_t slot = f->joints * f->tendon_lanes + joint, lane = view_lane(slot);
  const transition t = transition_at(f, slot);
  const slot_view* now = s->view + slot / 4;
  _Alignas(32) slot_view before;
  slot_view_fill(f, slot, QUAD_LANES, 0.0, t.negative_before, &before);
  quad_store(s->joint_bias + joint,
             bias_jump(&t, laws_magnitude(before.below, lane, threshold), laws_magnitude(now->below, lane, threshold)));
  quad_store(s->load_bias + joint,
             bias_jump(&t, laws_magnitude(before.other, lane, threshold), laws_magnitude(now->other, lane, threshold)));
}

/* Δb_j: eq. (10) with the b in place of the F, at the forces already propagated */
COLD_STATIC void sum_bias_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  quad_sums step[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    quad_sums_clear(&step[j]);
  }
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad sum = quad_set(0.0);
    for (size_t j = 0; j < n; ++j) {
      const size_t at = j * lanes + i;
      sum = quad_add(sum, quad_mul(quad_load(s->force_at + at), quad_load(s->edge_bias + at)));
      if (j + 1 < n) {
        sum = quad_add(sum, quad_mul(quad_load(s->force_between + at), quad_load(s->pulley_bias + at + lanes)));
      }
      quad_sums_add(&step[j], i, quad_mul(quad_load(f->derived.moment_arm + at), sum));
    }
  }
  for (size_t j = 0; j < n; ++j) {
    s->bias_step[j] = quad_sum(&step[j]) + (s->joint_bias[j] + s->load_bias[j] * s->load[j]);
  }
}

/* bias_step [n] of a sample in which something comes to rest or begins to move: rare, so it stays out of the way */
COLD_STATIC void bias_steps(tendonfmu_finger* f) {
  const finger_settings* settings = &f->derived.settings;
  const size_t lanes = f->tendon_lanes;
  for (size_t slot = 0; slot < f->joints * lanes; slot += QUAD_LANES) {
    jump_tendons(f, slot, angle_before(f->scratch.angle, slot / lanes), quad_set(settings->tendon_threshold));
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    jump_joints(f, j, quad_set(settings->joint_threshold));
  }
  if (f->extensions.gripped) {
    grip_jumps(f);
  }
  sum_bias_jumps(f);
}

/* brings the memory of every slot up to this sample; after remember_transitions() */
HOT_INLINE void remember_slots(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const quad now_time = quad_set(time), one = quad_set(1.0);
  for (size_t slot = 0; slot < f->slots; slot += QUAD_LANES) {
    const quad_mask now = moved_before(f, slot); /* brought up to date already */
    const quad side = quad_with_sign(one, quad_load(f->scratch.velocity + slot));
    quad_store(s->side + slot, quad_select(now, side, quad_load(s->side + slot)));
    quad_store(s->last_stuck + slot, quad_select(now, quad_load(s->last_stuck + slot), now_time));
  }
}

/* the same for what changes in a sample with transitions only; before remember_slots(), which overwrites the side */
COLD_STATIC void remember_transitions(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const quad one = quad_set(1.0);
  const double clock = f->derived.settings.forgets_by_absorption ? s->scalar[STATE_ABSORBED] : time;
  for (size_t slot = 0; slot < f->slots; slot += QUAD_LANES) {
    const quad_mask now = moving_now(f, slot), before = moved_before(f, slot);
    const quad_mask stops = quad_only_first(before, now), starts = quad_only_first(now, before);
    quad_store(s->moving + slot, quad_keep(now, one));
    const quad started = quad_sub(quad_load(s->side + slot), quad_set(2.0));
    quad_store(s->event + slot, quad_select(starts, started, quad_keep(stops, one)));
    quad_store(s->stuck_since + slot, quad_select(stops, quad_set(clock), quad_load(s->stuck_since + slot)));
  }
}

HOT_INLINE void forget_transitions(tendonfmu_finger* f) {
  const quad zero = quad_set(0.0);
  for (size_t slot = 0; slot < f->slots; slot += QUAD_LANES) {
    quad_store(f->remembered.event + slot, zero);
  }
}

/* fig. 5, contact: what sticks counts as having come to rest just now. Nothing is absorbed then anyway. */
HOT_INLINE void restart_rest(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  if (f->derived.settings.forgets_by_absorption) {
    return;
  }
  for (size_t slot = 0; slot < f->slots; slot += QUAD_LANES) {
    const quad since = quad_load(s->stuck_since + slot);
    quad_store(s->stuck_since + slot, quad_select(moved_before(f, slot), since, quad_set(time)));
  }
}

/* variance of the noise on the torque at this mean tendon force, (N·m)² */
HOT_INLINE double noise_variance(const finger_settings* settings, double mean_force, double scale) {
  const double noise = settings->noise_std + settings->noise_std_per_force * mean_force;
  return noise * noise * scale;
}

/* Λ: what the filter absorbs */
HOT_INLINE void count_absorbed(tendonfmu_finger* f, double left) {
  const double absorbed = left > 0.0 ? -law_logarithm(left) : 700.0;
  f->remembered.scalar[STATE_ABSORBED] += absorbed < 700.0 ? absorbed : 700.0;
}

/* K, 0 where nothing is known to be uncertain */
HOT_INLINE quad kalman_gain(quad predicted, quad noise) {
  const quad total = quad_add(predicted, noise), zero = quad_set(0.0);
  const quad_mask known = quad_greater(total, zero);
  return quad_keep(known, quad_div(predicted, quad_select(known, total, quad_set(1.0))));
}

/* S of a guided sample, and P where the bias does not learn from it */
COLD_STATIC void predict_residual(tendonfmu_finger* f, double step, double noise) {
  const finger_state* s = &f->remembered;
  const quad drift = quad_set(f->derived.settings.drift_variance * step);
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad predicted = quad_add(quad_load(s->variance + j), drift);
    quad_store(f->scratch.residual_variance + j, quad_add(predicted, quad_set(noise)));
    if (!f->guide.learns) {
      quad_store(s->variance + j, predicted);
      quad_store(s->gain + j, quad_set(0.0));
    }
  }
}

/* P⁻ and the variance of friction whose state nobody knows, four joints: it is distributed evenly */
HOT_INLINE quad with_unknown(const tendonfmu_finger* f, size_t j, quad variance) {
  if (!f->derived.settings.has_bands || f->guide.guides) {
    return variance;
  }
  const quad unknown = quad_load(f->scratch.unknown + j);
  return quad_add(variance, quad_mul(quad_mul(unknown, unknown), quad_set(1.0 / 3.0)));
}

/* one Kalman step per joint on the residual r = τ − T_eff */
HOT_INLINE void track_bias(tendonfmu_finger* f, double step, double noise) {
  const finger_state* s = &f->remembered;
  const quad one = quad_set(1.0), noise_variance = quad_set(noise);
  const quad drift = quad_set(f->derived.settings.drift_variance * step);
  _Alignas(32) double gains[QUAD_LANES] = {0.0}; /* without what is unknown the same at all joints */
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad predicted = quad_add(quad_load(s->variance + j), drift);
    const quad gain = kalman_gain(predicted, noise_variance);
    const quad learned = kalman_gain(with_unknown(f, j, predicted), noise_variance);
    const quad correction = quad_mul(learned, quad_load(s->residual + j));
    quad_store(s->bias + j, quad_add(quad_load(s->bias + j), correction));
    quad_store(s->friction + j, quad_add(quad_load(s->friction + j), correction));
    quad_store(s->gain + j, learned);
    quad_store(s->variance + j, quad_mul(quad_sub(one, gain), predicted));
    if (j == 0) {
      quad_store(gains, gain);
    }
  }
  if (f->derived.settings.forgets_by_absorption) {
    count_absorbed(f, 1.0 - gains[0]);
  }
}
