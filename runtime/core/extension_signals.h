/* What the effects beyond the paper do to the signals of a sample
 * (docs/reference/semantics/effects.md#signals-of-extensions). */
#pragma once

#include "extensions.h"

/* Signals in scratch, before the joint angles are known (late 0) and after (late 1); time of the sample, s. */
void shape_signals(tendonfmu_finger* finger, double time, int late);

/* --- derivatives of the signals ----------------------------------------------------------------------------------- */

/* A direction in the space of the signals, and what the effects make of it. */
typedef struct signal_derivative {
  double force[MODEL_MAX_TENDONS], position[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS], velocity[MODEL_MAX_JOINTS];
} signal_derivative;

/* Adds what position and force make of the joint angles, where these come from them. */
void angles_along(const tendonfmu_finger* finger, signal_derivative* derivative);

/* Turns a direction of the inputs into that of what the signal rows made of them, at the sample last remembered; before
 * (late 0) and after the joint angles are known. */
void pass_signals(const tendonfmu_finger* finger, signal_derivative* derivative, int late);
