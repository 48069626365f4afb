/* What the effects beyond the paper do to the signals of a sample, and the derivatives of all that follows by their
 * numbers (docs/reference/semantics/effects.md#signals-of-extensions). */
#pragma once

#include "extensions.h"

/* Signals in scratch, before the joint angles are known (late 0) and after (late 1); time of the sample, s. */
void shape_signals(tendonfmu_finger* finger, double time, int late);

/* ∂q and ∂q̇ by the numbers of the signal rows; the velocities are known. velocity_gain: ∂q̇/∂q of this sample. */
void follow_signals(tendonfmu_finger* finger, double step, double velocity_gain);

/* What every other effect remembers, by the numbers of the signal rows; after advance_extensions(). */
void follow_memories(tendonfmu_finger* finger);

/* --- derivatives of the signals ----------------------------------------------------------------------------------- */

/* A direction in the space of the signals, or what the effects make of one. */
typedef struct signal_derivative {
  double force[MODEL_MAX_TENDONS], position[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS], velocity[MODEL_MAX_JOINTS];
  double position_behind[MODEL_MAX_TENDONS]; /* behind the play of a tendon */
} signal_derivative;

/* Adds what position and force make of the joint angles, where these come from them. */
void angles_along(const tendonfmu_finger* finger, signal_derivative* derivative);

/* By number k of the n-th signal row; velocity with source 3 only. in_step: of the sample being taken, else of the one
 * last remembered. */
void derive_signals(const tendonfmu_finger* finger, size_t n, uint32_t k, int in_step, signal_derivative* derivative);

/* By number k of a signal row, at the sample last remembered: [n] ∂q, [n] ∂q̇, [m] ∂z behind the play of
 * a tendon, [effect_memory], and with a position filter [n] ∂x, [n] ∂a, [n] ∂z of the angle that it holds. */
const double* signal_slopes(const tendonfmu_finger* finger, const extension_row* row, uint32_t k);

/* Turns a direction of the inputs into that of what the signal rows made of them, at the sample last remembered; before
 * (late 0) and after the joint angles are known. */
void pass_signals(const tendonfmu_finger* finger, signal_derivative* derivative, int late);
