/* Sensors that fail: a tendon force or position that contradicts the spring between them, as the other tendons (or the
 * measured angles) have it; and the rows of R whose tendons give the joint angles, all but those of failing sensors
 * (docs/reference/semantics/sensors.md). */
#pragma once

#include "finger_memory.h"

/* A row leaves R⁺, or is predicted by the others, where that makes the variance of the angles at most so many times
 * larger: 1/(1 − h) of its leverage h. */
#define LEAST_FREEDOM 0.1

/* Fills R⁺ of the rows in use in scratch, and what the other rows predict of each.
 *   fault [M]    sensor_fault_kind; tendons of failing sensors leave in ascending order */
void use_rows(tendonfmu_finger* finger, const double* fault);

/* Weights [m] of the tendons in the mean force: 1/(number of sound ones), 0 of a failing force; all where all fail. */
void weigh_forces(const tendonfmu_finger* finger, const double* fault, double* weight);

/* Whether a joint was blind at the last sample; 0 without sensor_fault. */
int any_joint_is_blind(const tendonfmu_finger* finger);

/* --- a step, in this order ---------------------------------------------------------------------------------------- */

/* Before the angles, with forces and positions as these take them: finds faults, recoveries and the rows in use from
 * now on. All of it goes to scratch, since the sample may yet be refused. */
void watch_sensors(tendonfmu_finger* finger, double time, double step);

/* Mean |f0| over the tendons whose force does not fail, over all where every one does. */
double mean_sound_force(const tendonfmu_finger* finger);

/* Before T_eff: joints that are watched again begin as at the first sample, b_eff = τ − T. */
void begin_bias_anew(tendonfmu_finger* finger);

/* After T_eff: joints that are not watched have no residual and no contact. */
void forget_unwatched(tendonfmu_finger* finger);

/* After the bias is updated, whose gain is that of all joints: it has not changed there. */
void leave_unwatched(tendonfmu_finger* finger);
