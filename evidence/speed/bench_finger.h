// The finger of the figures in docs/evidence/performance.md: joints × tendons × working points, every friction term
// present.
#pragma once

#include <string>
#include <vector>

#include "tendonfmu.h"

namespace bench_finger {

// Which optional keys or extensions (docs/reference/semantics.md) a description has: calibrated: all that
// `tendonfmu calibrate` writes, presliding apart; calibrated_presliding: with it, as one row; torques: three a joint
// and one a tendon; presliding: one at every place; presliding_filtered: the same with a position filter.
enum class key_choice {
  paper,
  innovation,
  calibrated,
  calibrated_presliding,
  everything,
  torques,
  presliding,
  delay,
  filtered,
  presliding_filtered
};

// A description with n joints, m tendons and `points` working points at every edge, all laws different.
std::string description(int joints, int tendons, int points, key_choice keys = key_choice::paper);

std::vector<unsigned char> image(const std::string& json);

// Inputs at 1 kHz, row-major.
struct made_recording {
  std::vector<double> time, force, position;
  tendonfmu_inputs inputs() const { return {force.data(), position.data(), nullptr, nullptr}; }
};

// All joints move at once with different velocities; about one transition of fig. 5 in a hundred samples.
made_recording motion(int joints, int tendons, std::size_t samples);

// Joint positions jump back and forth every other sample: sides, rests and working points change all the time.
made_recording shaking(int joints, int tendons, std::size_t samples);

}  // namespace bench_finger
