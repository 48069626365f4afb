/* The rows of R whose tendons give the joint angles: all but those of failing sensors
 * (docs/reference/semantics/sensors.md). */
#pragma once

#include "finger_memory.h"

/* A row leaves R⁺, or is predicted by the others, where that makes the variance of the angles at most so many times
 * larger: 1/(1 − h) of its leverage h. */
#define LEAST_FREEDOM 0.1

/* Fills R⁺ of the rows in use in scratch, and what the other rows predict of each.
 *   fault [M]     sensor_fault_kind of each tendon; tendons of failing sensors leave in ascending order */
void use_rows(tendonfmu_finger* finger, const double* fault);

/* The same from what the finger remembers; nothing without sensor_fault. */
void recall_rows(tendonfmu_finger* finger);

/* Joints whose torque, or the whole of them where the angles are not determined, cannot be trusted, into watch [N]. */
void find_blind_joints(tendonfmu_finger* finger, const double* fault, double* watch);

/* Weights [m] of the tendons in the mean force: 1/(number of sound ones), 0 of a failing force; all where all fail. */
void weigh_forces(const tendonfmu_finger* finger, const double* fault, double* weight);

/* Whether a joint was blind at the last sample; 0 without sensor_fault. */
int any_joint_is_blind(const tendonfmu_finger* finger);
