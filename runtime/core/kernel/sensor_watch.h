/* Whether sensors fail, some tendons at a time (docs/reference/semantics/sensors.md): what contradicts the spring
 * between a force and a position. What follows from it is in sensor_fault.c. */
#pragma once

#include "finger_memory.h"
#include "kernel_choice.h"
#include "quad.h"

#define SPRING_ERROR      0.1  /* by which a spring may be stiffer or softer than described */
#define LEAST_RESOLUTIONS 10.0 /* that a sensor must miss to count as standing */

/* Some tendons at this sample. */
typedef struct watched {
  size_t i;
  quad time, stiffness, force, position, joint_side; /* of a spare lane 0, as all that is remembered of it */
  quad spring;                                       /* y = k·(x0 − w) */
  quad_mask bidirectional;
  quad_mask taut;  /* it pulls, or may push as well: what it says of the angles is right */
  quad_mask well;  /* no fault up to now */
  quad_mask known; /* w follows from the others */
  quad_mask again; /* and of the sample before, by the same rows */
} watched;

HOT_INLINE void note(uint64_t* tendons, size_t i, quad_mask found) {
  *tendons |= (uint64_t)quad_bits(found) << i;
}

HOT_INLINE quad_mask is_set(const double* row, size_t i) {
  return quad_greater(quad_load(row + i), quad_set(0.5));
}

/* value where the mask is set, else what was before */
HOT_INLINE quad update(double* to, const double* before, size_t i, quad_mask mask, quad value) {
  const quad now = quad_select(mask, value, quad_load(before + i));
  quad_store(to + i, now);
  return now;
}

HOT_INLINE quad_mask taut_at(const tendonfmu_finger* f, size_t i) {
  const quad margin = quad_set(f->derived.settings.spring_margin);
  return quad_greater(quad_load(f->scratch.force + i), margin) | is_set(f->derived.bidirectional, i);
}

/* rows in use that cannot be right: of slack tendons or failing sensors */
HOT_INLINE quad_mask unsound_at(const tendonfmu_finger* f, size_t i) {
  const quad_mask sound = taut_at(f, i) & ~is_set(f->remembered.sensor.fault, i);
  return is_set(f->scratch.row_in_use, i) & ~sound;
}

static double count_unsound_rows(const tendonfmu_finger* f) {
  double count = 0.0;
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    for (int bits = quad_bits(unsound_at(f, i)); bits; bits &= bits - 1) {
      count += 1.0;
    }
  }
  return count;
}

/* angle [n]: as the tendons or the sensors have it; w: x1 as the other tendons have it, from z = x0 − f0/k. unsound:
 * how many rows. */
HOT_INLINE watched watch_some(const tendonfmu_finger* f, size_t i, const double* angle, double unsound, double time) {
  const finger_scratch* s = &f->scratch;
  const size_t lanes = f->tendon_lanes;
  watched w = {.i = i,
               .stiffness = quad_load(f->derived.stiffness + i),
               .force = quad_load(s->force + i),
               .position = quad_load(s->position + i),
               .bidirectional = is_set(f->derived.bidirectional, i),
               .taut = taut_at(f, i)};
  const quad spring_end = w.position - w.force * quad_load(f->derived.inverse_stiffness + i);
  quad all = quad_set(0.0);
  for (size_t j = 0; j < f->joints; ++j) {
    all += quad_load(f->derived.moment_arm + j * lanes + i) * angle[j];
  }
  w.time = quad_keep(quad_greater(w.stiffness, quad_set(0.0)), quad_set(time));
  w.joint_side = all - quad_load(s->leverage + i) * (spring_end - all);
  w.spring = w.stiffness * (w.position - w.joint_side);
  w.well = quad_greater(quad_set(0.5), quad_load(f->remembered.sensor.fault + i));
  const quad others = unsound - quad_keep(unsound_at(f, i), quad_set(1.0));
  w.known = is_set(s->determined, i) & ~quad_greater(others, quad_set(0.5));
  w.again = w.known & is_set(f->remembered.sensor.known, i);
  return w;
}

/* more change of force within a sample than of the spring's length */
HOT_INLINE quad_mask force_jumps(const tendonfmu_finger* f, const watched* w) {
  const sensor_memory* before = &f->remembered.sensor;
  const quad moved = quad_abs(w->position - quad_load(before->position + w->i));
  const quad stretched = moved + quad_abs(w->joint_side - quad_load(before->joint_side + w->i));
  const quad bound = (1.0 + SPRING_ERROR) * (w->stiffness * stretched) + f->derived.settings.jump_margin;
  return w->again & w->well & quad_greater(quad_abs(w->force - quad_load(before->force + w->i)), bound);
}

/* by how much f0 is off the force that the spring should have, from f0 and y of a sample with a taut tendon */
HOT_INLINE quad off_spring(const watched* w, quad taut_force, quad taut_spring) {
  const quad zero = quad_set(0.0), force = taut_force + (w->spring - taut_spring);
  const quad expected = quad_select(quad_greater(zero, force) & ~w->bidirectional, zero, force);
  return quad_abs(expected - w->force);
}

/* longer than this, s */
HOT_INLINE quad_mask stood_for(double longest, quad stood, double step) {
  return quad_greater(stood, quad_set(longest + CLOCK_ROUNDING * step));
}

/* since when f0 is where it is, the last sample with a taut tendon, and whether f0 stands against its spring */
HOT_INLINE void watch_forces(const tendonfmu_finger* f, const watched* w, double time, double step,
                             sensor_findings* all) {
  const finger_settings* settings = &f->derived.settings;
  const sensor_memory *now = &f->scratch.sensor, *before = &f->remembered.sensor;
  const size_t i = w->i;
  const quad_mask lost = w->well & ~w->again, had_taut = is_set(before->has_taut, i) & ~lost;
  const quad change = quad_abs(w->force - quad_load(before->held_force + i));
  const quad_mask anew = lost | quad_greater(change, quad_set(settings->force_resolution));
  const quad_mask taken = w->known & w->taut & w->well & ~(had_taut & ~anew);
  update(now->held_force, before->held_force, i, anew, w->force);
  const quad since = update(now->force_held_since, before->force_held_since, i, anew, w->time);
  const quad taut_force = update(now->taut_force, before->taut_force, i, taken, w->force);
  const quad taut_spring = update(now->taut_spring, before->taut_spring, i, taken, w->spring);
  quad_store(now->has_taut + i, quad_keep(taken | had_taut, quad_set(1.0)));

  const double bound = settings->spring_margin + LEAST_RESOLUTIONS * settings->force_resolution;
  const quad_mask misses = quad_greater(off_spring(w, taut_force, taut_spring), quad_set(bound));
  const quad_mask stands = stood_for(settings->fault_hold_time, time - since, step);
  const quad_mask longest = stood_for(settings->longest_stand, time - since, step);
  note(&all->stands, i, w->well & w->taut & stands);
  note(&all->forces, i, w->again & w->well & had_taut & ((stands & misses) | (w->taut & longest)));
}

/* since when x0 is where it is, and whether f0 and w contradict it */
HOT_INLINE void watch_positions(const tendonfmu_finger* f, const watched* w, double time, double step,
                                sensor_findings* all) {
  const finger_settings* settings = &f->derived.settings;
  const sensor_memory *now = &f->scratch.sensor, *before = &f->remembered.sensor;
  const size_t i = w->i;
  const quad change = quad_abs(w->position - quad_load(before->held_position + i));
  const quad_mask moves = quad_greater(change, quad_set(settings->position_resolution));
  const quad_mask anew = moves | (w->well & ~(w->again & w->taut));
  update(now->held_position, before->held_position, i, anew, w->position);
  const quad since = update(now->position_held_since, before->position_held_since, i, anew, w->time);
  const quad force_then = update(now->force_then, before->force_then, i, anew, w->force);
  const quad joint_side_then = update(now->joint_side_then, before->joint_side_then, i, anew, w->joint_side);

  const quad pulled = w->stiffness * (w->joint_side - joint_side_then);
  const quad resolved = LEAST_RESOLUTIONS * settings->position_resolution * w->stiffness;
  const quad allowed = resolved + settings->spring_margin + SPRING_ERROR * quad_abs(pulled);
  const quad_mask misses = quad_greater(quad_abs(w->force - force_then + pulled), allowed);
  const quad_mask stands = stood_for(settings->fault_hold_time, time - since, step);
  note(&all->positions, i, w->again & w->well & stands & misses);
}

/* failing sensors that have moved again and agree with the spring; one that has for recovery_time is well */
HOT_INLINE void watch_recovery(const tendonfmu_finger* f, const watched* w, double time, double step,
                               sensor_findings* all) {
  const finger_settings* settings = &f->derived.settings;
  const sensor_memory* now = &f->scratch.sensor;
  const size_t i = w->i;
  const quad_mask fails = is_set(now->fault, i), position = quad_greater(quad_load(now->fault + i), quad_set(1.5));
  const quad since =
      quad_select(position, quad_load(now->position_held_since + i), quad_load(now->force_held_since + i));
  const quad taut_force = quad_load(now->taut_force + i), taut_spring = quad_load(now->taut_spring + i);
  const quad grown = quad_abs(w->spring - taut_spring);
  const quad resolved = settings->force_resolution + settings->position_resolution * w->stiffness;
  const quad allowed = settings->spring_margin + LEAST_RESOLUTIONS * resolved + SPRING_ERROR * grown;
  const quad_mask misses = quad_greater(off_spring(w, taut_force, taut_spring), allowed);
  const quad_mask moved = quad_greater(since, quad_load(now->fault_since + i));
  const quad_mask agrees = w->known & w->taut & moved & ~misses;
  const quad unsound_at = update(now->unsound_at, now->unsound_at, i, fails & ~agrees, w->time);
  const quad agreed = time - unsound_at + CLOCK_ROUNDING * step;
  const quad_mask well = fails & agrees & ~quad_greater(quad_set(settings->recovery_time), agreed);
  update(now->fault, now->fault, i, well, quad_set(SENSOR_IS_WELL));
  update(now->fault_since, now->fault_since, i, well, quad_set(0.0));
  update(now->unsound_at, now->unsound_at, i, well, quad_set(0.0));
  note(&all->recovers, i, well);
}

/* angle [n]: as all tendons or the sensors have it */
static sensor_findings watch_tendons(const tendonfmu_finger* f, const double* angle, double time, double step) {
  const sensor_memory* now = &f->scratch.sensor;
  const int unwell = f->remembered.scalar[STATE_UNWELL] != 0.0;
  const double unsound = count_unsound_rows(f);
  sensor_findings all = {0};
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const watched w = watch_some(f, i, angle, unsound, time);
    quad_store(now->known + i, quad_keep(w.known, quad_set(1.0)));
    quad_store(now->force + i, w.force);
    quad_store(now->position + i, w.position);
    quad_store(now->joint_side + i, w.joint_side);
    note(&all.jumps, i, force_jumps(f, &w));
    watch_forces(f, &w, time, step, &all);
    watch_positions(f, &w, time, step, &all);
    if (unwell) {
      watch_recovery(f, &w, time, step, &all);
    }
  }
  return all;
}
