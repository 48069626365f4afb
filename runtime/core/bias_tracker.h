/* The bias procedure of fig. 5: what happens when an effect comes to rest or begins to move, and a Kalman filter per
 * joint that tracks what sticks (docs/reference/semantics/bias.md). */
#pragma once

#include "finger_memory.h"

/* A slot that comes to rest or begins to move. */
typedef struct transition {
  int stops;          /* else it starts */
  double side_before; /* s1 = sgn(v) of the last moving sample, 0: never moved */
  double side_now;    /* s2 = sgn(v) */
  double exponent;    /* of forgetting: what time or the filter has taken from its torque since it came to rest */
  double threshold;   /* v_min */
} transition;

/* b of an effect there. */
dual jump_of(const transition* slot, const effect_laws* laws);

/* Δb [n] of a sample in which something comes to rest or begins to move, into scratch. */
void find_bias_steps(tendonfmu_finger* finger);

/* What fig. 5 remembers of them, after that. */
void remember_transitions(tendonfmu_finger* finger, double time);

/* b_eff = τ − T at the first sample, unless it is given. */
void begin_bias(tendonfmu_finger* finger, double mean_force);

/* Variance of the noise in a step, (N·m)². */
double noise_of_step(const tendonfmu_finger* finger, double step, double mean_force);

/* S of a guided sample, and P where the bias does not learn from it. */
void predict_residual(tendonfmu_finger* finger, double step, double noise);

/* One Kalman step per joint on the residual r = τ − T_eff. */
void track_bias(tendonfmu_finger* finger, double step, double noise);

/* In contact the bias stays, and what sticks counts as having come to rest just now. */
void hold_bias(tendonfmu_finger* finger, double time);

/* --- contact (contact_detector.c): a joint whose residual exceeds its threshold (paper VI), or what bounds learned
 * from free motion say (docs/reference/semantics/detection.md) --- */

/* The bands of all joints at the first sample. */
void begin_detection(tendonfmu_finger* finger, double time);

/* Whether any joint is in contact; level and joint_contact of each. */
int detect_contact(tendonfmu_finger* finger, double mean_force, double time, double step);

/* Square of compensated_torque_std. */
void estimate_variance(tendonfmu_finger* finger, double mean_force);
