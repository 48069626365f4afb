/* Learning while the robot moves: the extended Kalman filter of the paper (sects. V and VI), sample by sample.
 *
 *   learner = tendonfmu_learner_create(image, ...)          which numbers are unknown, how well they are known
 *   tendonfmu_learner_initialise(learner, t0, &inputs, …)   takes the first sample of a recording or of a run
 *   tendonfmu_learner_step(learner, t, &inputs, …)          takes the sample at t
 *   tendonfmu_learner_get_values(learner, values, errors)   numbers of the description, with standard errors
 *
 * Model as in tendonfmu_estimation.h, which includes this header. The unknowns are nearly constant, the bias of every
 * joint walks with bias.drift_variance and jumps as fig. 5 says, with the dependence of these jumps on the unknowns.
 * What stands still (|v| <= v_min) says nothing about its own friction, as in the paper.
 *
 * Blocks: samples are gathered and taken in `block` at a time, linearised at the unknowns that the block before left;
 * within a block nothing else is neglected. After 10 s at 1 kHz of an index finger (468 unknowns, all 20 % off at the
 * start), blocks of 8 differ from samples taken one by one by 0.008 standard errors (rms; at most 0.08) and 1e-4 N·m of
 * bias; of 32 by 0.01 (at most 0.1). A step that completes a block of 8 takes 0.4 ms there, the other steps 6 µs
 * (one core with AVX2; 1.1 ms without; with 37 unknowns 10 µs and 1 µs).
 *
 * A sample at which the model finds a tendon slack (a force below 0; the paper: "the training should be modified
 * whenever this appears") is not used, only counted.
 *
 * Conventions as in tendonfmu.h, with the same real-time promise: step, finish and get_* allocate nothing, take no lock
 * and make no system call, with up to 200 KiB of stack. Creation and initialise allocate. */
#ifndef TENDONFMU_LEARNER_H
#define TENDONFMU_LEARNER_H

#include <stddef.h>
#include <stdint.h>

#include "tendonfmu.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tendonfmu_learner tendonfmu_learner;
struct tendonfmu_unknown; /* tendonfmu_estimation.h */

typedef struct tendonfmu_learner_options {
  double prior_std;       /* standard deviation of an unknown about its start, in scales; above 0 */
  size_t block;           /* samples, 1..64 */
  double parameter_drift; /* variance that an unknown gains per second, in scales²: 0 for constants */
} tendonfmu_learner_options;

/* prior_std 1, block 8, parameter_drift 0 */
tendonfmu_learner_options tendonfmu_default_learner_options(void);

/* Makes a learner for the finger of an image. group and scale as for tendonfmu_estimator_create(); options NULL: the
 * default. NULL when refused, with one line in message [message_size]. */
tendonfmu_learner* tendonfmu_learner_create(const void* image, size_t image_size, const int32_t* group,
                                            const double* scale, const tendonfmu_learner_options* options,
                                            char* message, size_t message_size);
void tendonfmu_learner_destroy(tendonfmu_learner* learner);
/* One line about the last call that failed, "" when none has. Valid until the next call. */
const char* tendonfmu_learner_last_error(const tendonfmu_learner* learner);

size_t tendonfmu_learner_joint_count(const tendonfmu_learner* learner);     /* n */
size_t tendonfmu_learner_tendon_count(const tendonfmu_learner* learner);    /* m */
size_t tendonfmu_learner_parameter_count(const tendonfmu_learner* learner); /* p */
size_t tendonfmu_learner_unknown_count(const tendonfmu_learner* learner);   /* u */
/* Pointers are valid as long as the learner. */
tendonfmu_status tendonfmu_learner_get_unknown(const tendonfmu_learner* learner, size_t index,
                                               struct tendonfmu_unknown* unknown);

/* Takes the first sample of a recording. Unknowns and their covariance stay, the bias and what is remembered of the
 * motion begin anew: b = y − T at the first sample that is used, with bias.initial_variance, or bias.initial_torque.
 * May be called again for the next recording.
 *   kinematics_source  tendonfmu_kinematics_source
 *   external_torque    [n] N·m, known load on the joints (eq. 9), or NULL
 *   use                0: the sample says nothing, as in contact with an unknown load */
tendonfmu_status tendonfmu_learner_initialise(tendonfmu_learner* learner, double time, const tendonfmu_inputs* inputs,
                                              int kinematics_source, const double* external_torque, int use);

/* Takes the sample at `time`. A time equal to that of the sample already taken changes nothing. A sample that is
 * refused leaves the learner as it was. */
tendonfmu_status tendonfmu_learner_step(tendonfmu_learner* learner, double time, const tendonfmu_inputs* inputs,
                                        const double* external_torque, int use);

/* Takes in the samples of a block that is not full yet: at the end of a recording, or to read what is known now. */
tendonfmu_status tendonfmu_learner_finish(tendonfmu_learner* learner);

/* A whole recording: initialise, steps, finish. Rows are numbered from 1 in messages.
 *   time, inputs, external_torque, use  as for tendonfmu_estimator_add_recording()
 *   innovation, variance                [samples × n] residuals before each sample itself is taken in, and their
 *                                       variances; NaN where the bias has not started; NULL: not wanted
 *   watch                               called now and then, returning 0 stops; may be NULL
 *   done                                receives the samples taken; may be NULL */
typedef int (*tendonfmu_learner_watch)(void* context, size_t samples_done, size_t samples);
tendonfmu_status tendonfmu_learner_run(tendonfmu_learner* learner, size_t samples, const double* time,
                                       const tendonfmu_inputs* inputs, int kinematics_source,
                                       const double* external_torque, const unsigned char* use, double* innovation,
                                       double* variance, tendonfmu_learner_watch watch, void* context, size_t* done);

/* For recordings, not for a robot that moves: goes back to the start and the prior, and linearises from now on at what
 * has been found so far. Run the same recordings again. The first pass is linearised at unknowns still on their way;
 * where they start far off, that leaves errors larger than their standard errors, and a second pass (a step of Gauss
 * and Newton) removes them. */
tendonfmu_status tendonfmu_learner_begin_pass(tendonfmu_learner* learner);

/* What the blocks taken in so far say. */

/* Numbers of the description [p], and their standard errors [p], 0 where fixed; NULL: not wanted. */
tendonfmu_status tendonfmu_learner_get_values(const tendonfmu_learner* learner, double* values,
                                              double* standard_errors);
/* The unknowns themselves, z [u], and their covariance [u × u]; NULL: not wanted. */
tendonfmu_status tendonfmu_learner_get_unknowns(const tendonfmu_learner* learner, double* z, double* covariance);
/* Bias [n] N·m and its standard error [n], at the end of the last block; NULL: not wanted. */
tendonfmu_status tendonfmu_learner_get_bias(const tendonfmu_learner* learner, double* bias, double* standard_errors);
/* Of the last block: its number of samples, and [samples × n] residuals before each sample itself was taken in (all
 * before it were) with their variances, (N·m)². Room for [block × n]; NULL: not wanted. */
tendonfmu_status tendonfmu_learner_get_innovations(const tendonfmu_learner* learner, size_t* samples,
                                                   double* innovation, double* variance);
/* Samples left out so far because the model found a tendon slack. */
size_t tendonfmu_learner_slack_samples(const tendonfmu_learner* learner);

#ifdef __cplusplus
}
#endif

#endif
