/* The effects beyond the paper that a finger carries: what they remember, what they do to signals, friction and torques
 * of a sample (docs/reference/semantics/effects.md). */
#pragma once

#include "finger_memory.h"

/* Fills the table of rows and the cosines between the axes; whenever numbers were derived anew. */
void find_extensions(tendonfmu_finger* finger);

/* Side of the law of a slot that never sticks: 1 where it is the one for v < 0. */
static inline int sliding_side(double velocity, double threshold, double side) {
  return velocity > threshold ? 0 : velocity < -threshold ? 1 : side < 0.0;
}

/* --- a step, in this order ---------------------------------------------------------------------------------------- */

/* Signals in scratch, before the joint angles are known (late 0) and after (late 1); time of the sample, s. */
void shape_signals(tendonfmu_finger* finger, double time, int late);

/* What friction and torque rows will remember; angles, velocities and forces are known. */
void advance_extensions(tendonfmu_finger* finger, double time, double step);

/* What the friction rows make of F at every slot, and how it varies with the velocity there, into scratch. */
void find_grips(tendonfmu_finger* finger);

/* b of every slot with a friction row, in scratch. */
void grip_jumps(tendonfmu_finger* finger);

/* Adds the torques to T, in scratch. */
void add_extension_torques(tendonfmu_finger* finger);

/* --- of the sample last remembered -------------------------------------------------------------------------------- */

/* The sample as torque rows see it. */
effect_sample remembered_sample(const tendonfmu_finger* finger);

/* --- places whose friction has a memory (friction_memory.c, docs/reference/semantics/presliding.md) --------------- */

/* Which rows hold where, and their numbers. The kernels step them: friction_elements.h. */

/* 1 where friction has a memory: it never sticks. */
static inline int remembers_at(const tendonfmu_finger* finger, size_t slot) {
  return elements_of(finger) && finger->memory.remembers[slot] != 0.0;
}

/* Fills finger->memory from the rows of presliding and cord_stretch; whenever numbers were derived anew. */
void find_memory(tendonfmu_finger* finger);

/* The travel of every place in this sample, and what relaxation makes of it; the kinematics are known. */
void turn_places(tendonfmu_finger* finger, double step);

/* Friction as a torque where its places have a memory: z of a row of this size (N), into what it will remember; at a
 * joint its size (N·m), into the limit there. */
void follow_elements(const tendonfmu_finger* finger, const extension_row* row, double size);

/* ∂z/∂travel of the k-th of them at the sample last remembered; 0 where it slips, or has no memory. */
double follower_slope(const tendonfmu_finger* finger, const extension_row* row, size_t k, double size);
