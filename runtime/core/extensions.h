/* The effects beyond the paper that a finger carries: what they remember, what they do to signals, friction and torques
 * of a sample (docs/reference/semantics/effects.md). */
#pragma once

#include "finger_memory.h"

/* Fills the table of rows and the cosines between the axes; whenever numbers were derived anew. */
void find_extensions(tendonfmu_finger* finger);

/* The n-th row of a part of the table. */
static inline const extension_row* signal_row(const tendonfmu_finger* finger, size_t n) {
  return finger->extensions.row + n;
}
static inline const extension_row* friction_row(const tendonfmu_finger* finger, size_t n) {
  return finger->extensions.row + finger->extensions.signals + n;
}
static inline const extension_row* torque_row(const tendonfmu_finger* finger, size_t n) {
  return finger->extensions.row + finger->extensions.signals + finger->extensions.friction + n;
}

/* Row of the extension `index` of the description. */
const extension_row* extension_of(const tendonfmu_finger* finger, uint32_t index);

/* Slots of a friction row: its member k, as effect_type.grip() counts it, slides with slot friction_slot(k),
 * k < friction_members(). A row everywhere has the slots of all tendons, then those of all joints, but for those that
 * it yields. */
size_t friction_members(const tendonfmu_finger* finger, effect_place place);
size_t friction_slot(const tendonfmu_finger* finger, effect_place place, size_t k);

/* Whether a row leaves one of its slots to another row of the same effect, which names the place. */
static inline int row_yields(const tendonfmu_finger* finger, const extension_row* row, size_t slot) {
  return row->effect->yields && is_everywhere(row->place) && finger->extensions.is_named[slot];
}

/* Whether such a row acts on a slot, and which member it is there. */
int friction_acts_on(const tendonfmu_finger* finger, const extension_row* row, size_t slot, size_t* member);

/* The row that makes a slot slide, and which member of it the slot is; NULL: none. */
const extension_row* sliding_row_at(const tendonfmu_finger* finger, size_t slot, size_t* member);

/* What all friction rows together make of a slot, from the memory: F = value·|F(v)| where it slides, else value·F; b is
 * multiplied by bias. */
typedef struct slot_grip {
  int slides;
  double value, bias;
} slot_grip;
slot_grip slot_grip_of(const tendonfmu_finger* finger, size_t slot);

/* A direction of what a slot's effects see: its velocity, and what makes its travel, with a position filter the travel
 * itself, else the velocity. */
typedef struct slot_direction {
  double velocity, motion;
} slot_direction;

/* Derivative of its value along a direction, and of what the effects remember [effect_memory]; NULL: what they
 * remembered at the sample before is held fixed. */
double slot_grip_slope(const tendonfmu_finger* finger, size_t slot, const slot_direction* direction,
                       const double* memory_slope);

/* Side of the law of a slot that never sticks: 1 where it is the one for v < 0. */
static inline int sliding_side(double velocity, double threshold, double side) {
  return velocity > threshold ? 0 : velocity < -threshold ? 1 : side < 0.0;
}

/* --- a step, in this order ---------------------------------------------------------------------------------------- */

/* What every other effect will remember, but for the rows in the layers of what slides, which have been advanced;
 * angles, velocities and forces are known. */
void advance_extensions(tendonfmu_finger* finger, double time, double step);

/* What the friction rows make of F at every slot, into scratch; after what slides has been advanced. */
void find_grips(tendonfmu_finger* finger);

/* b of every slot with a friction row, in scratch. */
void grip_jumps(tendonfmu_finger* finger);

/* Adds the torques to T, in scratch. */
void add_extension_torques(tendonfmu_finger* finger);

/* The sample is accepted. */
void remember_extensions(tendonfmu_finger* finger);

/* --- of the sample last remembered -------------------------------------------------------------------------------- */

/* The sample as torque rows see it. */
effect_sample remembered_sample(const tendonfmu_finger* finger);
