// Where the samples of the loop come from. Your drivers take the place of these two.
#pragma once

#include <memory>
#include <string>
#include <tendonfmu.hpp>

struct sample {
  double time = 0.0;                       // s, from 0
  tendonfmu::span<const double> force;     // [m] N
  tendonfmu::span<const double> position;  // [m] m, motor side
};

class signal_source {
 public:
  virtual ~signal_source() = default;

  // The next sample, valid until the next call; false when there is none. Allocates nothing.
  virtual bool read(sample& next) noexcept = 0;
};

// A finger that holds still and is pulled for 0.3 s of every 2 s, sampled `rate` times a second (Hz).
std::unique_ptr<signal_source> simulated_hand(const tendonfmu::finger& finger, double rate);

// A CSV file with the columns time, tendon_force[i] and tendon_position[i] (docs/reference/recordings.md), read as a
// whole. Others are passed over. Throws std::runtime_error: file, row, what was expected.
std::unique_ptr<signal_source> recording(const std::string& path, std::size_t tendons);
