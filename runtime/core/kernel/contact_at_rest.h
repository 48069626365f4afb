/* Contact while the motors stand: a joint torque that has changed since they came to rest by more than noise and creep
 * make of it (docs/reference/semantics/rest.md). */
#pragma once

#include "friction_bound.h"
#include "kinematics.h"

/* the recent motion of a motor is counted from here */
HOT_INLINE void mark_recent(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    s->recent_position[i] = f->scratch.motor_position[i];
    s->recent_force[i] = s->smooth_force[i];
  }
  s->scalar[STATE_RECENT_AT] = time;
}

/* the rest, or the wait for one, begins now: what changes is counted from here */
COLD_STATIC void mark_rest(tendonfmu_finger* f, double time, int standing) {
  const finger_state* s = &f->remembered;
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    s->mark_position[i] = f->scratch.motor_position[i];
    s->mark_force[i] = s->smooth_force[i];
  }
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    s->contact_change[j] = s->rest_tracked[j] = s->rest_contact[j] = s->rest_extreme[j] = 0.0;
  }
  mark_recent(f, time);
  s->scalar[STATE_MARKED_AT] = time;
  s->scalar[STATE_STANDING] = standing ? 1.0 : 0.0;
  s->scalar[STATE_CONTACT_AT_REST] = 0.0;
}

/* the first sample: f̄ = f0, and the wait begins */
COLD_STATIC void begin_rest(tendonfmu_finger* f, double time) {
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    f->remembered.smooth_force[i] = f->scratch.force[i];
  }
  mark_rest(f, time, 0);
}

/* f̄, and c = Rᵀ·(f̄ − f̄ of the mark) */
HOT_INLINE void change_since_mark(tendonfmu_finger* f, double step) {
  const finger_state* s = &f->remembered;
  const double rate = f->derived.settings.rest_averaging_rate;
  const quad share = rate < 0.0 ? quad_set(1.0) : approach_share(quad_set(rate * step));
  for (size_t i = 0; i < f->tendon_lanes; i += 4) {
    const quad before = quad_load(s->smooth_force + i);
    const quad distance = quad_sub(quad_load(f->scratch.force + i), before);
    const quad smooth = quad_add(before, quad_mul(share, distance));
    quad_store(s->smooth_force + i, smooth);
    quad_store(f->scratch.force_change + i, quad_sub(smooth, quad_load(s->mark_force + i)));
  }
  for (size_t j = 0; j < f->joints; ++j) {
    const double* arms = f->derived.moment_arm + j * f->tendon_lanes;
    s->contact_change[j] = tendon_sum(arms, f->scratch.force_change, f->tendon_lanes);
  }
}

/* N: what noise makes of a change; D: what noise, and creep since the rest began, make of it; B: of what has changed of
 * late, D without innovation */
HOT_INLINE void bound_change(tendonfmu_finger* f, double mean_force, double rested) {
  const derived_numbers* d = &f->derived;
  const quad force = quad_set(mean_force), growth = quad_set(sqrt(rested));
  const int has_innovation = d->settings.rest_innovation_rate >= 0.0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad noise = quad_add(quad_load(d->rest_threshold + j), quad_mul(quad_load(d->rest_per_force + j), force));
    const quad bound = quad_add(noise, quad_mul(quad_load(d->rest_creep + j), growth));
    quad_store(f->scratch.rest_noise + j, noise);
    quad_store(f->scratch.rest_bound + j, bound);
    quad_store(f->scratch.rest_sudden_bound + j, has_innovation ? quad_load(d->rest_innovation + j) : bound);
  }
}

/* y = c − m */
HOT_INLINE quad change_of_late(const tendonfmu_finger* f, size_t j) {
  return quad_sub(quad_load(f->remembered.contact_change + j), quad_load(f->remembered.rest_tracked + j));
}

/* any |c| above its bound */
HOT_INLINE int torque_has_changed(const tendonfmu_finger* f) {
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad change = quad_abs(quad_load(f->remembered.contact_change + j));
    any |= quad_mask_bits(quad_greater(change, quad_load(f->scratch.rest_bound + j)));
  }
  return any;
}

/* any motor farther from the mark than `travel` */
HOT_INLINE int motor_has_moved(const tendonfmu_finger* f) {
  int any = 0;
  for (size_t i = 0; i < f->tendon_lanes; i += 4) {
    const quad moved = quad_sub(quad_load(f->scratch.motor_position + i), quad_load(f->remembered.mark_position + i));
    any |= quad_mask_bits(quad_greater(quad_abs(moved), quad_set(f->derived.settings.rest_travel)));
  }
  return any;
}

/* Any motor that its tendon's force cannot have moved: farther from the mark than one as soft as its tendon gives way,
 * or of late in the direction in which its force has changed. A motor that gives way to a push does not drive. */
HOT_INLINE int motor_drives(const tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  const quad zero = quad_set(0.0), travel = quad_set(f->derived.settings.rest_travel);
  int any = 0;
  for (size_t i = 0; i < f->tendon_lanes; i += 4) {
    const quad position = quad_load(f->scratch.motor_position + i), force = quad_load(s->smooth_force + i);
    const quad stretch =
        quad_mul(quad_abs(quad_load(f->scratch.force_change + i)), quad_load(f->derived.inverse_stiffness + i));
    const quad moved = quad_abs(quad_sub(position, quad_load(s->mark_position + i)));
    const quad lately = quad_sub(position, quad_load(s->recent_position + i));
    const quad work = quad_mul(lately, quad_sub(force, quad_load(s->recent_force + i)));
    const quad_mask pulls = quad_both(quad_greater(quad_abs(lately), travel), quad_at_least(work, zero));
    any |= quad_mask_bits(quad_either(pulls, quad_greater(moved, quad_add(travel, stretch))));
  }
  return any;
}

/* any load that has fallen from its extreme by more than noise and a share of the extreme */
HOT_INLINE int load_has_gone(const tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  const quad one = quad_set(1.0), zero = quad_set(0.0), share = quad_set(f->derived.settings.rest_fall_share);
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad extreme = quad_load(s->rest_extreme + j), size = quad_abs(extreme);
    const quad left = quad_mul(quad_with_sign(one, extreme), change_of_late(f, j));
    const quad allowed = quad_add(quad_load(f->scratch.rest_noise + j), quad_mul(share, size));
    const quad_mask fell = quad_greater(quad_sub(size, left), allowed);
    any |= quad_mask_bits(quad_both(quad_greater(size, zero), fell));
  }
  return any;
}

/* joints in contact at rest, and the largest y of each since its contact began */
HOT_INLINE void decide_at_rest(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  const quad one = quad_set(1.0), zero = quad_set(0.0), half = quad_set(0.5);
  const quad release = quad_set(f->derived.settings.release_ratio);
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad ratio = quad_select(quad_greater(quad_load(s->rest_contact + j), half), release, one);
    const quad change = quad_abs(quad_load(s->contact_change + j)), late = change_of_late(f, j);
    const quad extreme = quad_load(s->rest_extreme + j);
    const quad_mask changed = quad_greater(change, quad_mul(ratio, quad_load(f->scratch.rest_bound + j)));
    const quad_mask suddenly =
        quad_greater(quad_abs(late), quad_mul(ratio, quad_load(f->scratch.rest_sudden_bound + j)));
    const quad_mask exceeds = quad_either(changed, suddenly);
    const quad_mask same_side = quad_greater(quad_mul(extreme, late), zero);
    const quad_mask smaller = quad_greater(quad_abs(extreme), quad_abs(late));
    const quad largest = quad_select(quad_both(same_side, smaller), extreme, late);
    quad_store(s->rest_contact + j, quad_keep(exceeds, one));
    quad_store(s->rest_extreme + j, quad_keep(exceeds, largest));
    any |= quad_mask_bits(exceeds);
  }
  s->scalar[STATE_CONTACT_AT_REST] = any ? 1.0 : 0.0;
}

/* m follows c where there is no contact at rest */
HOT_INLINE void follow_change(tendonfmu_finger* f, double step) {
  const finger_state* s = &f->remembered;
  const double rate = f->derived.settings.rest_innovation_rate;
  if (rate < 0.0) {
    return; /* m stays 0 */
  }
  const quad share = approach_share(quad_set(rate * step)), half = quad_set(0.5);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad tracked = quad_load(s->rest_tracked + j);
    const quad followed = quad_add(tracked, quad_mul(share, change_of_late(f, j)));
    const quad_mask contact = quad_greater(quad_load(s->rest_contact + j), half);
    quad_store(s->rest_tracked + j, quad_select(contact, tracked, followed));
  }
}

/* the loads that are there as a motor drives: sign of the load, times the bound of its change */
COLD_STATIC void carry_loads(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    if (s->rest_contact[j] != 0.0) {
      s->carried_load[j] = copysign(f->scratch.rest_sudden_bound[j], s->rest_extreme[j]);
    }
  }
}

/* every later sample, before its contact is decided on */
COLD_STATIC void watch_rest(tendonfmu_finger* f, double mean_force, double time, double step) {
  const finger_state* s = &f->remembered;
  const int standing = s->scalar[STATE_STANDING] != 0.0;
  const double since_mark = time - s->scalar[STATE_MARKED_AT];
  const double settle_time = f->derived.settings.rest_settle_time - CLOCK_ROUNDING * step;
  change_since_mark(f, step);
  bound_change(f, mean_force, standing ? since_mark : 0.0);
  if (!standing) {
    if (motor_has_moved(f) || torque_has_changed(f)) {
      mark_rest(f, time, 0);
    } else if (since_mark >= settle_time) {
      mark_rest(f, time, 1);
    }
    for (size_t j = 0; j < f->joint_lanes; ++j) {
      s->contact_change[j] = 0.0; /* of a rest only */
    }
  } else if (motor_drives(f)) {
    carry_loads(f);
    mark_rest(f, time, 0);
  } else if (load_has_gone(f)) {
    mark_rest(f, time, 0);
  } else {
    decide_at_rest(f);
    follow_change(f, step);
    if (time - s->scalar[STATE_RECENT_AT] >= settle_time) {
      mark_recent(f, time);
    }
  }
}

/* Lanes in contact at rest, or with a load from a rest that the residual still shows; one that it does not is
 * forgotten. */
HOT_INLINE quad_mask loaded_since_rest(tendonfmu_finger* f, size_t j) {
  const finger_state* s = &f->remembered;
  const quad one = quad_set(1.0), carried = quad_load(s->carried_load + j);
  const quad size = quad_abs(carried), felt = quad_mul(quad_with_sign(one, carried), quad_load(s->residual + j));
  const quad_mask lasts = quad_both(quad_greater(size, quad_set(0.0)), quad_greater(felt, size));
  quad_store(s->carried_load + j, quad_keep(lasts, carried));
  return quad_either(lasts, quad_greater(quad_load(s->rest_contact + j), quad_set(0.5)));
}
