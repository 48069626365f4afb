/* What the bias has not learned yet: how friction stood before the first sample shows in the residual as motion turns
 * it over (docs/reference/semantics/bias.md#unlearned-start). */
#pragma once

#include "bias_tracker.h"
#include "friction_bound.h"

#define LEAST_LEFT 1e-12 /* of the start: less counts as none */

/* 1 − what this sample's motion leaves of the start, four slots */
HOT_INLINE quad turned_share(const tendonfmu_finger* f, size_t slot) {
  const quad one = quad_set(1.0), by_moving = quad_keep(moving_now(f, slot), one);
  if (!f->extensions.gripped) {
    return by_moving;
  }
  const quad_mask slides = slides_at(f, slot);
  return quad_select(slides, quad_sub(one, quad_load(f->scratch.kept + slot)), by_moving);
}

/* whether the joints turn the velocity of a slot: a tendon that ends before a joint is still there */
static inline int can_move(const tendonfmu_finger* f, size_t slot) {
  const size_t lanes = f->tendon_lanes, joint_row = f->joints * lanes;
  int moves = slot >= joint_row && slot - joint_row < f->joints;
  for (size_t at = slot; at < joint_row; at += lanes) {
    moves |= f->derived.moment_arm[at] != 0.0;
  }
  return moves;
}

/* the first sample: what sticks, or has a memory, is in an unknown state */
COLD_STATIC void begin_start_left(tendonfmu_finger* f) {
  double* left = f->scratch.start_left;
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    quad_store(left + slot, quad_sub(quad_set(1.0), turned_share(f, slot)));
  }
  for (size_t slot = 0; slot < f->slots; ++slot) {
    left[slot] = can_move(f, slot) ? left[slot] : 0.0;
  }
}

/* By how much a slot's effect may differ from what the model assumes: |F| of what has a memory, which begins at 0;
 * else twice that of the sample, in which it moves, since b of a first exit took it as standing that way already. */
HOT_INLINE quad whole_friction(const tendonfmu_finger* f, const double* friction, const double* whole, size_t slot,
                               size_t at) {
  const quad sample = quad_abs(quad_load(friction + at)), of_sample = quad_add(sample, sample);
  if (!f->extensions.gripped) {
    return of_sample;
  }
  const quad_mask slides = slides_at(f, slot);
  return quad_select(slides, quad_load(whole + slot), of_sample);
}

/* |F| of the part of the start that this sample turns over; returns whether there is any */
HOT_INLINE int turn_start(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t lanes = f->tendon_lanes, joint_row = f->joints * lanes;
  int any = 0, remains_any = 0;
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    const quad left = quad_load(f->remembered.start_left + slot), turned = quad_mul(left, turned_share(f, slot));
    const int own = slot >= joint_row;
    const size_t at = own ? slot - joint_row : slot;
    const quad first = whole_friction(f, own ? s->joint_friction : s->edge, s->whole_edge, slot, at);
    const quad second = whole_friction(f, own ? s->load_friction : s->pulley, s->whole_pulley, slot, at);
    const quad remains = quad_sub(left, turned);
    const quad_mask lasts = quad_greater(remains, quad_set(LEAST_LEFT));
    quad_store(s->start_left + slot, quad_keep(lasts, remains));
    remains_any |= quad_mask_bits(lasts);
    quad_store(s->edge_turned + slot, quad_mul(turned, first));
    quad_store(s->pulley_turned + slot, quad_mul(turned, second));
    any |= quad_mask_bits(quad_greater(turned, quad_set(0.0)));
  }
  f->scratch.start_remains = remains_any;
  return any;
}

/* G: the torque whose start this sample turns over; the forces are known, nothing is remembered yet */
HOT_INLINE void turned_friction(tendonfmu_finger* f, int first) {
  const size_t n = f->joint_lanes;
  if (first) {
    begin_start_left(f);
  }
  if (first || !turn_start(f)) {
    for (size_t j = 0; j < n; j += 4) {
      quad_store(f->scratch.turned + j, quad_set(0.0));
    }
    return;
  }
  held_torque(f, f->scratch.edge_turned, f->scratch.pulley_turned, f->scratch.turned);
}

/* the start is over where nothing of it is left, neither to be turned over nor to be learned */
HOT_INLINE void close_start(tendonfmu_finger* f) {
  int open = f->scratch.start_remains;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    open |= quad_mask_bits(quad_greater(quad_load(f->remembered.unlearned + j), quad_set(0.0)));
  }
  f->remembered.scalar[STATE_START_OPEN] = open ? 1.0 : 0.0;
}

/* V grows by what the sample turns over */
HOT_INLINE void add_unlearned(tendonfmu_finger* f) {
  const quad share = quad_set(f->derived.settings.start_share), most = quad_set(LARGEST_SUM);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    double* unlearned = f->remembered.unlearned + j;
    const quad sum = quad_add(quad_load(unlearned), quad_mul(share, quad_load(f->scratch.turned + j)));
    quad_store(unlearned, quad_min(sum, most));
  }
}
