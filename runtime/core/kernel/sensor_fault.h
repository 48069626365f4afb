/* Sensors that fail: a tendon force or position that contradicts the spring between them, as the other tendons (or the
 * measured angles) have it (docs/reference/semantics/sensors.md). */
#pragma once

#include <math.h>

#include "kinematics.h"
#include "rows_in_use.h"

#define SPRING_ERROR      0.1  /* by which a spring may be stiffer or softer than described */
#define LEAST_RESOLUTIONS 10.0 /* that a sensor must miss to count as standing */

/* Four tendons of this sample and the last. Masks: all but `taut` need w of both. */
typedef struct watched {
  quad force, position, joint_side, spring; /* f0, x0, w, y = k·(x0 − w) */
  quad force_before, position_before, joint_side_before;
  quad stiffness;
  quad_mask known; /* w of this sample follows from the others */
  quad_mask again; /* and that of the sample before, by the same rows */
  quad_mask well;  /* no fault up to now */
  quad_mask taut;
} watched;

HOT_INLINE quad_mask is_set(const double* row) {
  return quad_greater(quad_load(row), quad_set(0.5));
}

/* lanes that pull, or that may push as well: what they say of the angles is right */
HOT_INLINE quad_mask is_taut(const tendonfmu_finger* f, size_t i) {
  const quad_mask pulls = quad_greater(quad_load(f->scratch.force + i), quad_set(f->derived.settings.spring_margin));
  return quad_either(pulls, is_set(f->derived.bidirectional + i));
}

/* rows in use that cannot be right: of slack tendons and of failing sensors */
HOT_INLINE quad unsound_rows(const tendonfmu_finger* f, const double* fault, size_t i) {
  const quad one = quad_set(1.0), in_use = quad_load(f->scratch.row_in_use + i);
  const quad sound = quad_keep(is_taut(f, i), quad_drop(is_set(fault + i), one));
  return quad_mul(in_use, quad_sub(one, sound));
}

/* w of all tendons: x1 as the others have it, from z = x0 − f0/k, or from the measured angles */
HOT_INLINE void find_joint_side(tendonfmu_finger* f, double* joint_side) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  const int by_tendons = (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_TENDON_POSITIONS;
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS];
  double angle[MODEL_MAX_JOINTS];
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    const quad stretch = quad_mul(quad_load(s->force + i), quad_load(f->derived.inverse_stiffness + i));
    quad_store(spring_end + i, quad_sub(quad_load(s->position + i), stretch));
  }
  for (size_t j = 0; j < n; ++j) {
    angle[j] = by_tendons ? tendon_sum(s->inverse_routing + j * lanes, spring_end, lanes) : s->angle[j];
  }
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad all = quad_set(0.0);
    for (size_t j = 0; j < n; ++j) {
      all = quad_add(all, quad_mul(quad_load(f->derived.moment_arm + j * lanes + i), quad_set(angle[j])));
    }
    const quad own = quad_mul(quad_load(s->leverage + i), quad_sub(quad_load(spring_end + i), all));
    quad_store(joint_side + i, quad_sub(all, own));
  }
}

/* number of rows in use that cannot be right; none where the angles are measured */
HOT_INLINE double count_unsound_rows(const tendonfmu_finger* f, const double* fault) {
  if ((int)f->remembered.scalar[STATE_SOURCE] != TENDONFMU_TENDON_POSITIONS) {
    return 0.0;
  }
  quad_sums sums;
  quad_sums_clear(&sums);
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    quad_sums_add(&sums, i, unsound_rows(f, fault, i));
  }
  return quad_sum(&sums);
}

HOT_INLINE watched watch_tendons(tendonfmu_finger* f, size_t i, double unsound) {
  double *before = f->remembered.sensor, *now = f->scratch.sensor;
  const double* fault = sensor_row(f, before, SENSOR_FAULT);
  const quad others = quad_sub(quad_set(unsound), unsound_rows(f, fault, i));
  watched w = {.force = quad_load(f->scratch.force + i),
               .position = quad_load(f->scratch.position + i),
               .joint_side = quad_load(sensor_row(f, now, SENSOR_JOINT_SIDE) + i),
               .force_before = quad_load(sensor_row(f, before, SENSOR_FORCE) + i),
               .position_before = quad_load(sensor_row(f, before, SENSOR_POSITION) + i),
               .joint_side_before = quad_load(sensor_row(f, before, SENSOR_JOINT_SIDE) + i),
               .stiffness = quad_load(f->derived.stiffness + i),
               .well = quad_greater(quad_set(0.5), quad_load(fault + i)),
               .taut = is_taut(f, i)};
  w.known = quad_both(quad_greater(quad_set(0.5), others), is_set(f->scratch.determined + i));
  w.again = quad_both(w.known, is_set(sensor_row(f, before, SENSOR_KNOWN) + i));
  w.spring = quad_mul(w.stiffness, quad_sub(w.position, w.joint_side));
  return w;
}

HOT_INLINE quad difference(quad a, quad b) {
  return quad_abs(quad_sub(a, b));
}

/* more change of force within a sample than of the spring's length */
HOT_INLINE quad_mask force_jumps(const tendonfmu_finger* f, const watched* w) {
  const quad stretched =
      quad_add(difference(w->position, w->position_before), difference(w->joint_side, w->joint_side_before));
  const quad bound = quad_add(quad_mul(quad_set(1.0 + SPRING_ERROR), quad_mul(w->stiffness, stretched)),
                              quad_set(f->derived.settings.jump_margin));
  return quad_both(quad_both(w->again, w->well), quad_greater(difference(w->force, w->force_before), bound));
}

/* f0 that the spring should have, from a sample at which its tendon was taut */
HOT_INLINE quad force_of_spring(const tendonfmu_finger* f, const watched* w, size_t i) {
  double* now = f->scratch.sensor;
  const quad then = quad_load(sensor_row(f, now, SENSOR_TAUT_SPRING) + i), zero = quad_set(0.0);
  const quad grown = quad_sub(w->spring, then);
  const quad force = quad_add(quad_load(sensor_row(f, now, SENSOR_TAUT_FORCE) + i), grown);
  const quad_mask pushes = quad_greater(zero, force);
  return quad_drop(quad_only_first(pushes, is_set(f->derived.bidirectional + i)), force);
}

/* stands for longer than this (s) */
HOT_INLINE quad_mask stood_for(double longest, quad since, double time, double step) {
  return quad_greater(quad_sub(quad_set(time), since), quad_set(longest + CLOCK_ROUNDING * step));
}

HOT_INLINE quad_mask stood_long(const tendonfmu_finger* f, quad since, double time, double step) {
  return stood_for(f->derived.settings.fault_hold_time, since, time, step);
}

/* since when f0 is where it is, the last sample with a taut tendon, and whether it stands against its spring */
HOT_INLINE quad_mask force_stands(tendonfmu_finger* f, const watched* w, size_t i, double time, double step,
                                  int* standing) {
  const finger_settings* settings = &f->derived.settings;
  double *before = f->remembered.sensor, *now = f->scratch.sensor;
  const quad held = quad_load(sensor_row(f, before, SENSOR_HELD_FORCE) + i), one = quad_set(1.0);
  const quad_mask left = quad_greater(difference(w->force, held), quad_set(settings->force_resolution));
  const quad_mask lost = quad_only_first(w->well, w->again), anew = quad_either(left, lost);
  const quad since = quad_select(anew, quad_set(time), quad_load(sensor_row(f, before, SENSOR_FORCE_HELD_SINCE) + i));
  const quad has_taut = quad_drop(lost, quad_load(sensor_row(f, before, SENSOR_HAS_TAUT) + i));
  const quad_mask known = quad_greater(has_taut, quad_set(0.5));
  const quad_mask takes = quad_both(quad_both(w->known, w->taut), w->well);
  const quad_mask taken = quad_both(takes, quad_either(anew, quad_only_first(takes, known)));
  const quad force = quad_load(sensor_row(f, before, SENSOR_TAUT_FORCE) + i);
  const quad spring = quad_load(sensor_row(f, before, SENSOR_TAUT_SPRING) + i);
  quad_store(sensor_row(f, now, SENSOR_HELD_FORCE) + i, quad_select(anew, w->force, held));
  quad_store(sensor_row(f, now, SENSOR_FORCE_HELD_SINCE) + i, since);
  quad_store(sensor_row(f, now, SENSOR_HAS_TAUT) + i, quad_select(taken, one, has_taut));
  quad_store(sensor_row(f, now, SENSOR_TAUT_FORCE) + i, quad_select(taken, w->force, force));
  quad_store(sensor_row(f, now, SENSOR_TAUT_SPRING) + i, quad_select(taken, w->spring, spring));
  const quad_mask stands = quad_both(quad_both(w->well, w->taut), stood_long(f, since, time, step));
  *standing |= quad_mask_bits(stands);
  const quad missed = difference(force_of_spring(f, w, i), w->force);
  const quad bound = quad_set(settings->spring_margin + LEAST_RESOLUTIONS * settings->force_resolution);
  const quad_mask judged = quad_both(quad_both(w->again, w->well), known);
  const quad_mask contradicts = quad_both(stood_long(f, since, time, step), quad_greater(missed, bound));
  const quad_mask too_long = quad_both(w->taut, stood_for(settings->longest_stand, since, time, step));
  return quad_both(judged, quad_either(contradicts, too_long));
}

/* since when x0 is where it is, and whether f0 and w contradict it */
HOT_INLINE quad_mask position_stands(tendonfmu_finger* f, const watched* w, size_t i, double time, double step) {
  const finger_settings* settings = &f->derived.settings;
  double *before = f->remembered.sensor, *now = f->scratch.sensor;
  const quad held = quad_load(sensor_row(f, before, SENSOR_HELD_POSITION) + i);
  const quad_mask left = quad_greater(difference(w->position, held), quad_set(settings->position_resolution));
  const quad_mask anew = quad_either(left, quad_only_first(w->well, quad_both(w->again, w->taut)));
  const quad since =
      quad_select(anew, quad_set(time), quad_load(sensor_row(f, before, SENSOR_POSITION_HELD_SINCE) + i));
  const quad force = quad_select(anew, w->force, quad_load(sensor_row(f, before, SENSOR_FORCE_THEN) + i));
  const quad joint_side =
      quad_select(anew, w->joint_side, quad_load(sensor_row(f, before, SENSOR_JOINT_SIDE_THEN) + i));
  quad_store(sensor_row(f, now, SENSOR_HELD_POSITION) + i, quad_select(anew, w->position, held));
  quad_store(sensor_row(f, now, SENSOR_POSITION_HELD_SINCE) + i, since);
  quad_store(sensor_row(f, now, SENSOR_FORCE_THEN) + i, force);
  quad_store(sensor_row(f, now, SENSOR_JOINT_SIDE_THEN) + i, joint_side);
  const quad pulled = quad_mul(w->stiffness, quad_sub(w->joint_side, joint_side));
  const quad resolved = quad_mul(quad_set(LEAST_RESOLUTIONS * settings->position_resolution), w->stiffness);
  const quad allowed = quad_add(quad_add(resolved, quad_set(settings->spring_margin)),
                                quad_mul(quad_set(SPRING_ERROR), quad_abs(pulled)));
  const quad missed = quad_abs(quad_add(quad_sub(w->force, force), pulled));
  const quad_mask judged = quad_both(quad_both(w->again, w->well), stood_long(f, since, time, step));
  return quad_both(judged, quad_greater(missed, allowed));
}

/* one tendon at which a sensor begins to fail; what its spring was like before is kept */
COLD_STATIC void begin_fault(tendonfmu_finger* f, size_t i, sensor_fault_kind kind, int jumps, double time) {
  double *before = f->remembered.sensor, *now = f->scratch.sensor;
  const double stiffness = f->derived.stiffness[i];
  sensor_row(f, now, SENSOR_FAULT)[i] = kind;
  sensor_row(f, now, SENSOR_FAULT_SINCE)[i] = sensor_row(f, now, SENSOR_UNSOUND_AT)[i] = time;
  if (jumps) {
    sensor_row(f, now, SENSOR_TAUT_FORCE)[i] = sensor_row(f, before, SENSOR_FORCE)[i];
    sensor_row(f, now, SENSOR_TAUT_SPRING)[i] =
        stiffness * (sensor_row(f, before, SENSOR_POSITION)[i] - sensor_row(f, before, SENSOR_JOINT_SIDE)[i]);
  } else if (kind == POSITION_FAILS) {
    sensor_row(f, now, SENSOR_TAUT_FORCE)[i] = sensor_row(f, now, SENSOR_FORCE_THEN)[i];
    sensor_row(f, now, SENSOR_TAUT_SPRING)[i] =
        stiffness * (sensor_row(f, now, SENSOR_HELD_POSITION)[i] - sensor_row(f, now, SENSOR_JOINT_SIDE_THEN)[i]);
  }
}

/* lanes whose failing sensor has moved again and agrees with the spring */
COLD_STATIC quad_mask agrees_again(const tendonfmu_finger* f, const watched* w, size_t i) {
  const finger_settings* settings = &f->derived.settings;
  double* now = f->scratch.sensor;
  const quad since = quad_load(sensor_row(f, now, SENSOR_FAULT_SINCE) + i);
  const quad force_since = quad_load(sensor_row(f, now, SENSOR_FORCE_HELD_SINCE) + i);
  const quad position_since = quad_load(sensor_row(f, now, SENSOR_POSITION_HELD_SINCE) + i);
  const quad_mask position_fails = quad_greater(quad_load(sensor_row(f, now, SENSOR_FAULT) + i), quad_set(1.5));
  const quad_mask moved = quad_greater(quad_select(position_fails, position_since, force_since), since);
  const quad grown = difference(w->spring, quad_load(sensor_row(f, now, SENSOR_TAUT_SPRING) + i));
  const quad resolved =
      quad_add(quad_set(settings->force_resolution), quad_mul(quad_set(settings->position_resolution), w->stiffness));
  const quad allowed =
      quad_add(quad_add(quad_set(settings->spring_margin), quad_mul(quad_set(LEAST_RESOLUTIONS), resolved)),
               quad_mul(quad_set(SPRING_ERROR), grown));
  const quad_mask near = quad_at_least(allowed, difference(force_of_spring(f, w, i), w->force));
  return quad_both(quad_both(w->known, w->taut), quad_both(moved, near));
}

/* four tendons whose sensors failed before: those that have agreed for recovery_time are well; returns whether any is
 */
COLD_STATIC int recover(tendonfmu_finger* f, const watched* w, size_t i, double time, double step) {
  double* now = f->scratch.sensor;
  const int agree = quad_mask_bits(agrees_again(f, w, i)), well = quad_mask_bits(w->well);
  int any = 0;
  for (size_t lane = 0; lane < QUAD_LANES; ++lane) {
    double* unsound = sensor_row(f, now, SENSOR_UNSOUND_AT) + i + lane;
    if (well >> lane & 1) {
      continue;
    }
    if (!(agree >> lane & 1)) {
      *unsound = time;
    } else if (time - *unsound + CLOCK_ROUNDING * step >= f->derived.settings.recovery_time) {
      sensor_row(f, now, SENSOR_FAULT)[i + lane] = SENSOR_IS_WELL;
      sensor_row(f, now, SENSOR_FAULT_SINCE)[i + lane] = *unsound = 0.0;
      any = 1;
    }
  }
  return any;
}

/* q of the sample before by the rows in use, plus `sign` times that into angle_shift [N] */
COLD_STATIC void shift_angles(tendonfmu_finger* f, double sign) {
  double* before = f->remembered.sensor;
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS];
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    const double stretch = sensor_row(f, before, SENSOR_FORCE)[i] * f->derived.inverse_stiffness[i];
    spring_end[i] = sensor_row(f, before, SENSOR_POSITION)[i] - stretch;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    const double* row = f->scratch.inverse_routing + j * f->tendon_lanes;
    f->scratch.angle_shift[j] += sign * tendon_sum(row, spring_end, f->tendon_lanes);
  }
}

/* other rows give the angles from this sample on: those of the sample before, and what w is taken from, change too */
COLD_STATIC void change_rows(tendonfmu_finger* f) {
  double* now = f->scratch.sensor;
  const int by_tendons = (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_TENDON_POSITIONS;
  if (!by_tendons) {
    return;
  }
  shift_angles(f, -1.0);
  use_rows(f, sensor_row(f, now, SENSOR_FAULT));
  shift_angles(f, 1.0);
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    sensor_row(f, now, SENSOR_KNOWN)[i] = 0.0;
  }
}

/* what is remembered of every sample, and of the faults up to now */
HOT_INLINE void copy_sensors(tendonfmu_finger* f, size_t i, const watched* w) {
  double *before = f->remembered.sensor, *now = f->scratch.sensor;
  for (int row = SENSOR_FAULT; row <= SENSOR_UNSOUND_AT; ++row) {
    quad_store(sensor_row(f, now, (sensor_row_kind)row) + i,
               quad_load(sensor_row(f, before, (sensor_row_kind)row) + i));
  }
  quad_store(sensor_row(f, now, SENSOR_KNOWN) + i, quad_keep(w->known, quad_set(1.0)));
  quad_store(sensor_row(f, now, SENSOR_FORCE) + i, w->force);
  quad_store(sensor_row(f, now, SENSOR_POSITION) + i, w->position);
}

/* whether a sensor fails or a joint is not watched, after this sample */
COLD_STATIC int is_unwell(const tendonfmu_finger* f) {
  const double* fault = sensor_row(f, f->scratch.sensor, SENSOR_FAULT);
  int any = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    any |= fault[i] != SENSOR_IS_WELL;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    any |= f->scratch.watch[j] != JOINT_WATCHED;
  }
  return any;
}

/* tendons of bits [M/QUAD_LANES]: their sensors begin to fail; returns whether there are any */
COLD_STATIC int begin_faults(tendonfmu_finger* f, const int* bits, const int* jumps, sensor_fault_kind kind,
                             double time) {
  int any = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    if (bits[i / QUAD_LANES] >> i % QUAD_LANES & 1) {
      begin_fault(f, i, kind, kind == FORCE_FAILS && (jumps[i / QUAD_LANES] >> i % QUAD_LANES & 1), time);
      any = 1;
    }
  }
  return any;
}

/* Before the angles of step 1, with forces and positions as these take them: finds faults, recoveries and the rows in
 * use from now on. All of it goes to scratch, since the sample may yet be refused. */
HOT_INLINE void watch_sensors(tendonfmu_finger* f, double time, double step) {
  double* now = f->scratch.sensor;
  const double unsound = count_unsound_rows(f, sensor_row(f, f->remembered.sensor, SENSOR_FAULT));
  const int unwell = f->remembered.scalar[STATE_UNWELL] != 0.0;
  enum { MOST = MODEL_MAX_TENDONS / QUAD_LANES };
  int jumps[MOST], forces[MOST], positions[MOST];
  int any_force = 0, any_position = 0, standing = 0, changed = 0;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(f->scratch.angle_shift + j, quad_set(0.0));
    quad_store(f->scratch.watch + j, quad_set(0.0));
  }
  find_joint_side(f, sensor_row(f, now, SENSOR_JOINT_SIDE));
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const watched w = watch_tendons(f, i, unsound);
    copy_sensors(f, i, &w);
    jumps[i / QUAD_LANES] = quad_mask_bits(force_jumps(f, &w));
    forces[i / QUAD_LANES] = quad_mask_bits(force_stands(f, &w, i, time, step, &standing)) | jumps[i / QUAD_LANES];
    positions[i / QUAD_LANES] = quad_mask_bits(position_stands(f, &w, i, time, step));
    any_force |= forces[i / QUAD_LANES];
    any_position |= positions[i / QUAD_LANES];
    if (unwell) {
      changed |= recover(f, &w, i, time, step);
    }
  }
  if (any_force) {
    changed |= begin_faults(f, forces, jumps, FORCE_FAILS, time);
  } else if (any_position && !standing) { /* a force that stands is the likelier fault */
    changed |= begin_faults(f, positions, jumps, POSITION_FAILS, time);
  }
  if (changed) {
    change_rows(f);
  }
  f->scratch.unwell = 0;
  if (changed || unwell) {
    find_blind_joints(f, sensor_row(f, now, SENSOR_FAULT), f->scratch.watch);
    f->scratch.unwell = is_unwell(f);
  }
}

/* 0 where w is so large that its spring's force would not be finite */
HOT_INLINE int sensors_are_finite(const tendonfmu_finger* f) {
  const quad zero = quad_set(0.0);
  quad probe = zero;
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const quad w = quad_load(sensor_row(f, f->scratch.sensor, SENSOR_JOINT_SIDE) + i);
    probe = quad_add(probe, quad_mul(zero, quad_mul(quad_set(1e30), w)));
  }
  return quad_mask_bits(quad_at_least(zero, quad_abs(probe))) == QUAD_ALL;
}

HOT_INLINE void remember_sensors(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t i = 0; i < SENSOR_ROWS * f->tendon_lanes; i += QUAD_LANES) {
    quad_store(s->sensor + i, quad_load(f->scratch.sensor + i));
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(s->watch + j, quad_load(f->scratch.watch + j));
  }
  s->scalar[STATE_UNWELL] = f->scratch.unwell ? 1.0 : 0.0;
}

/* mean |f0| over the tendons whose force does not fail, over all where every one does */
COLD_STATIC double mean_sound_force(const tendonfmu_finger* f) {
  double weight[MODEL_MAX_TENDONS], sum = 0.0;
  weigh_forces(f, sensor_row(f, f->scratch.sensor, SENSOR_FAULT), weight);
  for (size_t i = 0; i < f->tendons; ++i) {
    sum += weight[i] * fabs(f->scratch.force[i]);
  }
  return sum;
}

/* after the bias is updated, whose gain is that of all joints: it has not changed there */
COLD_STATIC void leave_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    s->gain[j] = s->watch[j] == JOINT_WATCHED ? s->gain[j] : 0.0;
  }
}

/* before T_eff: joints that are watched again begin as at the first sample, b_eff = τ − T */
COLD_STATIC void begin_bias_anew(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    if (s->watch[j] == JOINT_BEGINS_ANEW) {
      s->bias[j] = s->torque[j] - f->scratch.friction[j];
    }
  }
}

/* after T_eff: joints that are not watched have no residual and no contact */
COLD_STATIC void forget_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    if (s->watch[j] != JOINT_WATCHED) {
      s->residual[j] = s->level[j] = s->joint_contact[j] = 0.0;
    }
  }
}
