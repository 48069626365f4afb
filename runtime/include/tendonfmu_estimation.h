/* Estimation of the friction parameters from recordings of motion without contact (paper sects. V and VI).
 *
 *   estimator = tendonfmu_estimator_create(image, ...)        which numbers are unknown
 *   tendonfmu_estimator_add_recording(estimator, ...)         one or more
 *   tendonfmu_estimator_fit(estimator, ...)                   all recordings at once
 *   tendonfmu_estimator_get_values(estimator, z, values)      numbers of the description
 *
 * or, sample by sample while the robot moves, the extended Kalman filter of tendonfmu_learner.h, which this header
 * includes.
 *
 * Model, per joint:  y_k = T_k(θ) + b_k + e_k,  b_k = b_{k−1} + Δb_k(θ) + w_k: T of eq. (10), Δb of fig. 5, y the joint
 * torque minus the known external one (eq. 9), e white with the description's bias.noise_*, w with bias.drift_variance.
 * Contact is never detected here.
 *
 * A library of its own, C++17 inside (link tendonfmu_estimation and tendonfmu_core); tendonfmu.h does not depend on it.
 * Conventions as in tendonfmu.h: SI units, the caller owns what it passes, an estimator serves one thread at a time
 * (the fit itself uses several), a failing call says why in one line. Everything here allocates. */
#ifndef TENDONFMU_ESTIMATION_H
#define TENDONFMU_ESTIMATION_H

#include <stddef.h>
#include <stdint.h>

#include "tendonfmu.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tendonfmu_estimator tendonfmu_estimator;

/* What an unknown is, in the internal form of a law: coulomb Fc, drop Fs − Fc, rate 1/vs, viscous Fv. */
typedef enum tendonfmu_role {
  TENDONFMU_COULOMB,
  TENDONFMU_DROP,
  TENDONFMU_RATE,
  TENDONFMU_VISCOUS,
  TENDONFMU_VALUE /* a number as it is: a cover's, an extension's, bias.initial_torque */
} tendonfmu_role;

typedef struct tendonfmu_unknown {
  tendonfmu_role role;
  double start, lower, upper; /* lower and upper: the box it stays in */
  double scale;               /* its expected magnitude */
  size_t parameter_count;     /* numbers of the description that it moves */
  const uint32_t* parameters; /* their indices; of a drop the statics, of a rate the Stribeck velocities */
  const char* path;           /* of the first of them */
} tendonfmu_unknown;

/* Makes an estimator for the finger of an image (tendonfmu_description.h).
 *   group         [p] by parameter index: −1 fixed; others: estimated, equal numbers share one value. NULL: all that is
 *                 present: no viscous friction where it is 0, no Stribeck effect where static equals coulomb
 *   scale         [p] expected magnitudes, > 0, NaN where the start's is meant. NULL: the start's
 *
 * Returns NULL when refused, with one line in message [message_size]. */
tendonfmu_estimator* tendonfmu_estimator_create(const void* image, size_t image_size, const int32_t* group,
                                                const double* scale, char* message, size_t message_size);
void tendonfmu_estimator_destroy(tendonfmu_estimator* estimator);
const char* tendonfmu_estimator_last_error(const tendonfmu_estimator* estimator);

size_t tendonfmu_estimator_joint_count(const tendonfmu_estimator* estimator);
size_t tendonfmu_estimator_tendon_count(const tendonfmu_estimator* estimator);
size_t tendonfmu_estimator_parameter_count(const tendonfmu_estimator* estimator); /* p */
size_t tendonfmu_estimator_unknown_count(const tendonfmu_estimator* estimator);   /* u */
/* Pointers are valid as long as the estimator. */
tendonfmu_status tendonfmu_estimator_get_unknown(const tendonfmu_estimator* estimator, size_t index,
                                                 tendonfmu_unknown* unknown);

/* From unknowns z [u], within their boxes, to numbers of the description values [p], and back. */
tendonfmu_status tendonfmu_estimator_get_values(const tendonfmu_estimator* estimator, const double* z, double* values);
tendonfmu_status tendonfmu_estimator_get_unknowns(const tendonfmu_estimator* estimator, const double* values,
                                                  double* z);

/* Copies a recording.
 *   external_torque [samples × n] known load, or NULL
 *   use             [samples] 1 where to learn, or NULL: everywhere
 *   index           receives its number, 0 for the first; may be NULL */
tendonfmu_status tendonfmu_estimator_add_recording(tendonfmu_estimator* estimator, size_t samples, const double* time,
                                                   const tendonfmu_inputs* inputs, int kinematics_source,
                                                   const double* external_torque, const unsigned char* use,
                                                   size_t* index);

/* Lets each sample of a recording count as a part of one, by joint: cost, gradient, information and fit then have
 * w e²/S in place of e²/S. Correlated residuals count as fewer samples (tendonfmu fit sets their effective number over
 * their number); the bias filter, innovations and variances stay as they are.
 *   weight  [n] above 0, at most 1; 1 until set */
tendonfmu_status tendonfmu_estimator_set_weights(tendonfmu_estimator* estimator, size_t recording,
                                                 const double* weight);

/* What an earlier fit knows: information [u × u] of the unknowns about the description's start, symmetric and positive
 * semidefinite. The fit adds it to the prior of its options. NULL: none any more. */
tendonfmu_status tendonfmu_estimator_set_known(tendonfmu_estimator* estimator, const double* information);

/* Called on the caller's thread now and then. best [u]: the unknowns with the least cost so far. Returning 0 stops. */
typedef struct tendonfmu_fit_progress {
  size_t pass, stride; /* of the pass that runs: it looks at every stride-th sample */
  size_t samples_done, samples;
  double cost; /* of the best so far; NaN before the first pass */
  const double* best;
} tendonfmu_fit_progress;
typedef int (*tendonfmu_fit_watch)(void* context, const tendonfmu_fit_progress* progress);

/* One pass over all samples: cost ½ Σ w e²/S, its gradient [u] and Σ w ν νᵀ [u × u], without prior. NULL: not wanted.
 * stride: only every stride-th sample, each for `stride` of them. threads 0: all cores; the result does not depend on
 * it. */
tendonfmu_status tendonfmu_estimator_evaluate(tendonfmu_estimator* estimator, const double* z, size_t stride,
                                              unsigned threads, double* cost, double* gradient, double* information);

/* Torque and jumps from sample `first` on, as means over `blocks` blocks of `length` samples, with their derivatives:
 * torque, jump [blocks × n], torque_derivative, jump_derivative [blocks × n × u]; NULL: not wanted. The derivatives are
 * exact but for friction with a memory, where the share of its limit that a place holds is taken as constant, and for
 * numbers of extensions, where they are 0. */
tendonfmu_status tendonfmu_estimator_jacobian(tendonfmu_estimator* estimator, size_t recording, const double* z,
                                              size_t first, size_t blocks, size_t length, double* torque, double* jump,
                                              double* torque_derivative, double* jump_derivative);

/* Residuals before the bias update, e [samples × n] (τ − T_eff), and their variances S [samples].
 * NaN: e where the bias has not started, S where nothing is learned either (samples not used, which have an e, and the
 * first). bias [samples × n] after the update. NULL: not wanted. */
tendonfmu_status tendonfmu_estimator_innovations(tendonfmu_estimator* estimator, size_t recording, const double* z,
                                                 double* innovation, double* variance, double* bias);

typedef struct tendonfmu_fit_options {
  double prior_std;   /* of an unknown about its start, in scales; INFINITY: no prior */
  double tolerance;   /* the fit ends with a step this long, in standard errors, all unknowns together */
  size_t most_passes; /* over the data */
  size_t stride;      /* of the first, coarse passes; 0: by the number of samples */
  unsigned threads;   /* 0: all cores */
} tendonfmu_fit_options;

typedef struct tendonfmu_fit_result {
  double* z;           /* [u] */
  double* gradient;    /* [u] of the data's cost; or NULL */
  double* information; /* [u × u] of the data; or NULL */
  double* covariance;  /* [u × u] (information + prior)^-1; or NULL */
  double cost, prior_cost;
  size_t passes, steps;
  int converged, stopped;
} tendonfmu_fit_result;

tendonfmu_fit_options tendonfmu_default_fit_options(void);

/* Fits. start [u] or NULL: the description's. TENDONFMU_OK also when stopped: z is then the best so far, and the rest
 * is filled unless stopped in the first pass (passes 0). */
tendonfmu_status tendonfmu_estimator_fit(tendonfmu_estimator* estimator, const double* start,
                                         const tendonfmu_fit_options* options, tendonfmu_fit_watch watch, void* context,
                                         tendonfmu_fit_result* result);

#ifdef __cplusplus
}
#endif

#include "tendonfmu_learner.h"

#endif
