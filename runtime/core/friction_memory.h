/* Places whose friction has a memory (docs/reference/semantics/presliding.md): which rows hold where, and their
 * numbers. The kernels step them: friction_elements.h. */
#pragma once

#include "finger_memory.h"

/* 1 where friction has a memory: it never sticks. */
static inline int remembers_at(const tendonfmu_finger* finger, size_t slot) {
  return finger->memory.elements && finger->memory.remembers[slot] != 0.0;
}

/* Fills finger->memory from the rows of presliding and cord_stretch; whenever numbers were derived anew. */
void find_memory(tendonfmu_finger* finger);

/* The travel of every place in this sample, and what relaxation makes of it; the kinematics are known. */
void turn_places(tendonfmu_finger* finger, double step);

/* The sample is accepted. */
void remember_elements(tendonfmu_finger* finger);

/* Friction as a torque where its places have a memory: z of a row of this size (N), into what it will remember; at a
 * joint its size (N·m), into the limit there. */
void follow_elements(const tendonfmu_finger* finger, const extension_row* row, double size);

/* ∂z/∂travel of the k-th of them at the sample last remembered; 0 where it slips, or has no memory. */
double follower_slope(const tendonfmu_finger* finger, const extension_row* row, size_t k, double size);
