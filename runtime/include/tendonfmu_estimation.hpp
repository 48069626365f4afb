/* Estimation of the friction parameters from recordings of motion without contact (paper sects. V and VI).
 *
 *   estimator all(image, image_size);          which numbers are unknown
 *   all.add_recording(arrays);                 one or more
 *   fit_result fit = all.fit(all.start());     all recordings at once
 *   all.values(fit.z);                         numbers of the description
 *
 * or, while the robot moves, the extended Kalman filter of the paper, sample by sample:
 *
 *   auto learner = make_learner(image, image_size);
 *   learner->initialise(sample, source);       takes the first sample of a recording or of a run
 *   learner->step(sample);                     takes the next one
 *   learner->get_values(values, errors);       numbers of the description, with standard errors
 *
 * Model, per joint:  y_k = T_k(θ) + b_k + e_k,  b_k = b_{k−1} + Δb_k(θ) + w_k: T of eq. (10), Δb of fig. 5, y the joint
 * torque minus the known external one (eq. 9), e white with the description's bias.noise_*, w with bias.drift_variance.
 * Contact is never detected here.
 *
 * A library of its own (link tendonfmu_estimation and tendonfmu_core). SI units; matrices are row-major; the caller
 * owns what it passes; an object serves one thread at a time (a fit itself uses several). What is refused throws
 * std::invalid_argument with one line that says why, and leaves the object as it was. */
#ifndef TENDONFMU_ESTIMATION_HPP
#define TENDONFMU_ESTIMATION_HPP

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tendonfmu.h"

namespace tendonfmu::estimation {

using numbers = std::vector<double>;

/* What an unknown is, in the internal form of a side of a law: coulomb Fc, drop Fs − Fc, rate 1/vs, viscous Fv; or a
 * number as it is: a cover's, an extension's, bias.initial_torque. Every bound is then a box (Fs >= Fc >= 0,
 * vs > vs_min), and 1/vs has no singularity (paper VII). */
enum class unknown_role { coulomb, drop, rate, viscous, value };

struct unknown_item {
  unknown_role role;
  std::vector<std::uint32_t> parameters; /* indices of the numbers of the description that it moves; of a drop the
                                          * statics, of a rate the Stribeck velocities; of a coulomb friction without
                                          * Stribeck effect the static one follows */
  double start, lower, upper;            /* lower and upper: the box that it stays in */
  double scale;                          /* its expected magnitude */
  std::size_t joint;                     /* the first that it turns, 0-based: it turns none before */
  std::string path;                      /* of its first parameter */
  bool curved = false;                   /* the model is far from linear in it */
};

/* A recording with N samples of n joints and m tendons. Rows are numbered from 1 in messages. */
struct recording_arrays {
  std::size_t samples;           /* N */
  const double* time;            /* [N] s, strictly increasing */
  tendonfmu_inputs inputs;       /* [N × m], [N × n] */
  const double* external_torque; /* [N × n] N·m, known load on the joints (eq. 9), or nullptr */
  const unsigned char* use;      /* [N] 1 where to learn, or nullptr: everywhere */
  int kinematics_source;         /* tendonfmu_kinematics_source */
  /* [N × n] 1 where a joint says nothing, as one at rest that its motor holds, or nullptr: nowhere. Not for a learner
   */
  const unsigned char* silent = nullptr;
};

/* --- all recordings at once --------------------------------------------------------------------------------------- */

struct fit_options {
  double prior_std = 1.0;       /* of an unknown about its start, in scales; infinite: no prior */
  double tolerance = 0.3;       /* the fit ends with a step this long, in standard errors, all unknowns together */
  std::size_t most_passes = 60; /* over the data */
  std::size_t stride = 0;       /* of the first, coarse passes; 0: by the number of samples */
  unsigned threads = 0;         /* 0: all cores; the result does not depend on it */
};

struct fit_progress {
  std::size_t pass, stride; /* of the pass that runs: it looks at every stride-th sample */
  std::size_t samples_done, samples;
  double cost;         /* of the best so far, prior included; NaN before the first pass */
  const numbers* best; /* [u] unknowns with the least cost so far */
};
/* Called on the caller's thread now and then; false stops. */
using fit_watch = std::function<bool(const fit_progress&)>;

struct fit_result {
  numbers z; /* [u]; of a stopped fit the best so far */
  /* of the data at z: [u] of the cost, [u × u]; and [u × u] (information + prior)^-1, where an unknown held by its
   * bound counts as if it were free. Empty if stopped in the first pass. */
  numbers gradient, information, covariance;
  double cost = 0.0, prior_cost = 0.0; /* cost: ½ Σ w e²/S + prior_cost */
  std::size_t passes = 0, steps = 0;
  bool converged = false, stopped = false;
};

struct fit_problem;

class estimator {
 public:
  /* For the finger of an image (tendonfmu_description.h).
   *   group  [p] by parameter index: −1 fixed; others: estimated, equal numbers share one value. Empty: all that is
   *          present: no viscous friction where it is 0, no Stribeck effect where static equals coulomb
   *   scale  [p] expected magnitudes, > 0, NaN where the start's is meant. Empty: the start's */
  estimator(const void* image, std::size_t image_size, const std::vector<std::int32_t>& group = {},
            const numbers& scale = {});
  ~estimator();

  std::size_t joint_count() const;                   /* n */
  std::size_t tendon_count() const;                  /* m */
  std::size_t parameter_count() const;               /* p */
  const std::vector<unknown_item>& unknowns() const; /* [u] */
  numbers start() const;                             /* [u] */

  /* From unknowns z [u], within their boxes, to numbers of the description [p], and back. */
  numbers values(const numbers& z) const;
  numbers unknown_values(const numbers& values) const;

  /* Copies a recording; returns its number, 0 for the first. */
  std::size_t add_recording(const recording_arrays& recording);

  /* Lets each sample of a recording count as a part of one, by joint [n], above 0 and at most 1 (1 until set): cost,
   * gradient, information and fit then have w e²/S in place of e²/S. Correlated residuals count as fewer samples
   * (tendonfmu fit sets their effective number over their number); the bias filter, innovations and variances stay as
   * they are. */
  void set_weights(std::size_t recording, const numbers& weight);

  /* What an earlier fit knows: information [u × u] of the unknowns about the description's start, symmetric and
   * positive semidefinite. The fit adds it to the prior of its options. Empty: none any more. */
  void set_known(const numbers& information);

  /* One pass over all samples: cost ½ Σ w e²/S, its gradient [u] and Σ w ν νᵀ [u × u], without prior.
   *   stride   only every stride-th sample, each for `stride` of them
   *   threads  0: all cores; the result does not depend on it */
  struct evaluation {
    double cost;
    numbers gradient, information;
  };
  evaluation evaluate(const numbers& z, std::size_t stride = 1, unsigned threads = 0) const;

  /* Torque and jumps from sample `first` on, as means over `blocks` blocks of `length` samples [blocks × n], with their
   * derivatives [blocks × n × u]. These are exact but for friction with a memory, where the share of its limit that a
   * place holds is taken as constant, and for numbers of extensions, where they are 0. */
  struct block_means {
    numbers torque, jump, torque_derivative, jump_derivative;
  };
  block_means jacobian(std::size_t recording, const numbers& z, std::size_t first, std::size_t blocks,
                       std::size_t length) const;

  /* Residuals before the bias update (τ − T_eff), their variances S, and the bias after the update, each [N × n].
   * NaN: residuals where the bias has not started, S where nothing is learned either (samples not used, which have a
   * residual, joints that are silent, and the first). */
  struct residuals {
    numbers innovation, variance, bias;
  };
  residuals innovations(std::size_t recording, const numbers& z) const;

  /* start [u]: where to begin; the prior's mean is the description's start. */
  fit_result fit(const numbers& start, const fit_options& options = {}, const fit_watch& watch = {}) const;

 private:
  std::unique_ptr<fit_problem> problem_;
};

/* --- sample by sample --------------------------------------------------------------------------------------------- */

struct learner_options {
  double prior_std = 1.0;       /* standard deviation of an unknown about its start, in scales; above 0 */
  std::size_t block = 8;        /* samples that are taken in at once, 1..64 */
  double parameter_drift = 0.0; /* variance that an unknown gains per second, in scales²; 0: constants */
};

struct learner_sample {
  double time;                   /* s */
  tendonfmu_inputs inputs;       /* [m], [n] */
  const double* external_torque; /* [n] N·m, known load on the joints (eq. 9), or nullptr */
  bool use = true;               /* false: the sample says nothing, as in contact with an unknown load */
};

/* Called now and then; false stops. */
using learner_watch = std::function<bool(std::size_t samples_done, std::size_t samples)>;

/* The unknowns are nearly constant, the bias of every joint walks with bias.drift_variance and jumps as fig. 5 says,
 * with the dependence of these jumps on the unknowns. What stands still (|v| <= v_min) says nothing about its own
 * friction, as in the paper.
 *
 * Blocks: samples are gathered and taken in `block` at a time, linearised at the unknowns that the block before left;
 * within a block nothing else is neglected. After 10 s at 1 kHz of an index finger (468 unknowns, all 20 % off at the
 * start), blocks of 8 differ from samples taken one by one by 0.008 standard errors (rms; at most 0.08) and 1e-4 N·m of
 * bias; of 32 by 0.01 (at most 0.1). A step that completes a block of 8 takes some 1 ms there, the other steps 10 µs
 * (one core with AVX2; 2 ms without).
 *
 * A sample at which the model finds a tendon slack (a force below 0; the paper: "the training should be modified
 * whenever this appears") is not used, only counted.
 *
 * The real-time promise of tendonfmu.h: step, finish and get_* allocate nothing unless they throw, take no lock and
 * make no system call, with up to 200 KiB of stack. Creation, initialise and run allocate. */
class learner {
 public:
  virtual ~learner() = default;

  virtual std::size_t joint_count() const = 0;                   /* n */
  virtual std::size_t tendon_count() const = 0;                  /* m */
  virtual std::size_t parameter_count() const = 0;               /* p */
  virtual const std::vector<unknown_item>& unknowns() const = 0; /* [u] */

  /* Takes the first sample of a recording. Unknowns and their covariance stay, the bias and what is remembered of the
   * motion begin anew: b = y − T at the first sample that is used, with bias.initial_variance, or bias.initial_torque.
   * May be called again for the next recording. */
  virtual void initialise(const learner_sample& first, int kinematics_source) = 0;

  /* Takes the next sample; true where it completed a block. A time equal to that of the sample already taken changes
   * nothing. */
  virtual bool step(const learner_sample& sample) = 0;

  /* Takes in the samples of a block that is not full yet: at the end of a recording, or to read what is known now. */
  virtual void finish() = 0;

  /* A whole recording: initialise, steps, finish; returns the number of samples taken. innovation, variance [N × n]:
   * residuals before each sample itself is taken in, and their variances; NaN where the bias has not started; nullptr:
   * not wanted. */
  virtual std::size_t run(const recording_arrays& recording, double* innovation = nullptr, double* variance = nullptr,
                          const learner_watch& watch = {}) = 0;

  /* For recordings, not for a robot that moves: goes back to the start and the prior, and linearises from now on at
   * what has been found so far. Run the same recordings again. The first pass is linearised at unknowns still on their
   * way; where they start far off, that leaves errors larger than their standard errors, and a second pass (a step of
   * Gauss and Newton) removes them. */
  virtual void begin_pass() = 0;

  /* What the blocks taken in so far say; nullptr: not wanted. */

  /* Numbers of the description [p], and their standard errors [p] (first order), 0 where fixed. */
  virtual void get_values(double* values, double* standard_errors) const = 0;
  /* The unknowns themselves, z [u], and their covariance [u × u]. */
  virtual void get_unknowns(double* z, double* covariance) const = 0;
  /* Bias [n] N·m and its standard error [n], at the end of the last block. */
  virtual void get_bias(double* bias, double* standard_errors) const = 0;
  /* Of the last block: returns its number of samples, and [samples × n] residuals before each sample itself was taken
   * in (all before it were) with their variances, (N·m)². Room for [block × n]. */
  virtual std::size_t get_innovations(double* innovation, double* variance) const = 0;
  /* Samples left out so far because the model found a tendon slack. */
  virtual std::size_t slack_samples() const = 0;
};

/* For the finger of an image; group and scale as for an estimator. */
std::unique_ptr<learner> make_learner(const void* image, std::size_t image_size, const learner_options& options = {},
                                      const std::vector<std::int32_t>& group = {}, const numbers& scale = {});

}  // namespace tendonfmu::estimation

#endif
