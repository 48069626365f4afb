/* The finger and the recordings that it is fitted to. What does not depend on the friction (velocities, what moves and
 * what sticks since when) is found once, and remembered where a recording is cut into segments. */
#pragma once

#include "unknowns.h"

namespace tendonfmu::estimation {

/* A finger of the core that never detects contact. */
class free_finger {
 public:
  /* throws std::invalid_argument */
  free_finger(const void* image, std::size_t image_size);

  tendonfmu_finger* get() const { return finger_.get(); }

  /* Back to before the first sample, with these numbers of the description [parameter_count]. What is refused throws.
   */
  void begin(const std::vector<double>& numbers, int kinematics_source);
  /* A saved state, with these numbers instead of those saved with it. */
  void resume(const std::vector<unsigned char>& state, const std::vector<double>& numbers);
  /* While it runs; allocates nothing. */
  void set(const std::vector<double>& numbers);
  /* The next sample. Throws with the row. */
  void step(std::size_t row, double time, const tendonfmu_inputs& inputs);
  std::vector<unsigned char> save() const;

 private:
  std::unique_ptr<tendonfmu_finger, void (*)(tendonfmu_finger*)> finger_{nullptr, tendonfmu_destroy};
  std::vector<std::size_t> changed_; /* of a call of set(): parameters and their new values */
  std::vector<double> values_;
};

/* Whether what a finger remembers depends on its numbers: those of extensions that act on signals or on friction, or of
 * friction with a memory. The states kept with a recording, which are those of the start, then hold for no others. */
bool remembers_numbers(const tendonfmu_finger* finger);

/* Variance R of a sample's torques (step 6), (N·m)²; step: s since the sample before, 0: without bias.noise_time. */
double torque_noise(const tendonfmu_finger* finger, const tendonfmu_inputs& inputs, double step);

/* One recording, copied. */
class recording_track {
 public:
  /* Throws: a sample that the finger refuses, fewer than 2 used samples, noise of 0. */
  recording_track(free_finger* finger, const recording_arrays& arrays);

  std::size_t samples() const { return time_.size(); }
  int kinematics_source() const { return source_; }
  double time(std::size_t row) const { return time_[row]; }
  tendonfmu_inputs inputs(std::size_t row) const;
  std::size_t joints() const { return joints_; }
  bool used(std::size_t row, std::size_t joint) const { return use_[row * joints_ + joint] != 0; }
  double external_torque(std::size_t row, std::size_t joint) const {
    return external_.empty() ? 0.0 : external_[row * joints_ + joint];
  }
  /* torque_noise(); plain: as at the first sample */
  double noise(std::size_t row) const { return noise_[row]; }
  double plain_noise(std::size_t row) const { return plain_noise_[row]; }
  /* [n] √ of the share of a sample that each sample counts for; 1 until set */
  double weight_root(std::size_t joint) const { return weight_root_[joint]; }
  void set_weights(const numbers& weight);

  /* Rows at which the finger's state is kept: 0, length, 2·length, … */
  std::size_t segment_length() const { return segment_length_; }
  std::size_t segments() const { return states_.size(); }
  const std::vector<std::vector<unsigned char>>& states() const { return states_; }

 private:
  std::vector<double> time_, force_, position_, angle_, velocity_, external_, noise_, plain_noise_;
  std::vector<unsigned char> use_; /* [N × n] */
  std::vector<std::vector<unsigned char>> states_;
  std::size_t joints_, tendons_, segment_length_;
  std::vector<double> weight_root_;
  int source_;
};

/* What the bias filter (docs/reference/semantics/bias.md#bias-tracker) does at every sample and joint; the same for all
 * parameters. */
struct bias_gains {
  /* stride: only every stride-th sample is looked at, for `stride` of them */
  bias_gains(const recording_track& recording, const finger_settings& settings, std::size_t stride);

  std::vector<double> gain;   /* [N × n] K; 0 where not used, 1 where the bias starts */
  std::vector<double> weight; /* [N × n] 1/√S; 0 where nothing is learned */

 private:
  void find(const recording_track& recording, const finger_settings& settings, std::size_t stride, std::size_t joint);
};

}  // namespace tendonfmu::estimation
