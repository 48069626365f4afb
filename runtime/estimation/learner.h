/* The extended Kalman filter on a finger: samples in, the description's numbers with their errors out. */
#pragma once

#include <functional>

#include "kalman.h"
#include "recording_track.h"
#include "sample_rows.h"

namespace tendonfmu::estimation {

struct learner_options {
  double prior_std = 1.0;       /* of an unknown about its start, in scales */
  std::size_t block = 8;        /* samples that are taken in at once */
  double parameter_drift = 0.0; /* of the unknowns: variance of z/scale, 1/s */
};

/* One sample as the caller has it. */
struct learner_sample {
  double time;
  tendonfmu_inputs inputs;
  const double* external_torque; /* [n] or nullptr */
  bool use;
};

class finger_learner {
 public:
  /* Throws refused. */
  finger_learner(const void* image, std::size_t image_size, const std::int32_t* group, const double* scale,
                 const learner_options& options);

  const tendonfmu_finger* finger() const { return finger_.get(); }
  const unknown_list& unknowns() const { return unknowns_; }
  const kalman_filter& filter() const { return filter_; }
  std::size_t block() const { return block_; }
  bool initialised() const { return initialised_; }
  bool bias_started() const { return bias_started_; }
  std::size_t slack_samples() const { return slack_samples_; }

  /* The first sample of a recording: what is remembered of the motion and the bias begin anew, the unknowns stay.
   * Throws refused; then nothing is initialised. */
  void initialise(const learner_sample& first, int kinematics_source);

  /* The next sample. True where it completed a block. Allocates nothing unless it throws refused, and then the learner
   * is as it was. */
  bool step(const learner_sample& sample);

  /* Takes in the samples of a block that is not full. */
  void finish();

  /* See kalman_filter::begin_pass(). The samples of an unfinished block are taken in first. */
  void begin_pass();

  /* numbers of the description, and their standard errors (first order): [parameter_count]; 0 where fixed */
  void values(double* numbers) const { unknowns_.write(filter_.z(), numbers); }
  void standard_errors(double* errors) const;

 private:
  double noise_of(const tendonfmu_inputs& inputs, double step) const;
  void check(const learner_sample& sample, double step) const;
  void write_unknowns();
  void take(const learner_sample& sample, double step);
  void begin_bias(const learner_sample& sample);
  bool is_slack() const;

  free_finger finger_;
  unknown_list unknowns_;
  sample_rows rows_;
  std::size_t block_;
  kalman_filter filter_;
  bool initialised_ = false, bias_started_ = false, written_ = false;
  std::size_t slack_samples_ = 0;
  std::vector<double> numbers_;    /* [parameter_count] */
  std::vector<std::size_t> moved_; /* parameters that the unknowns move while the finger runs */
  std::vector<double> torque_rows_, jump_rows_, torque_, jump_, measured_;
};

}  // namespace tendonfmu::estimation
