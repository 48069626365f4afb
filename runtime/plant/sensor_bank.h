/* What the sensors make of the true signals: play, delay, gain and offset, noise, resolution, in this order. */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rig.h"

namespace tendonfmu::plant {

/* The values of every quantity: [m] of tendons, [n] of joints. */
using readings = std::array<const double*, sensors::quantities>;

class sensor_bank {
 public:
  explicit sensor_bank(const rig& rig);

  /* Takes sample `number` (0, 1, 2, ... at number/rate) of the true signals. */
  void sample(std::uint64_t number, std::uint64_t seed, const readings& exact);

  /* The newest sample. */
  readings newest() const;

  void clear();

  /* Shows each list of remembered numbers to `visit`, in one order: saved states. */
  template <class Bank, class Visit>
  static void visit_state(Bank& bank, Visit visit) {
    for (auto& line : bank.lines_) {
      visit(line.newest);
    }
    for (auto& line : bank.lines_) {
      visit(line.past);
      visit(line.play);
    }
  }

 private:
  /* One quantity: its sensor, and the delay's memory of the last samples. */
  struct line {
    const sensor* with;
    std::uint32_t first_channel;
    std::size_t channels, depth;
    std::vector<double> past;   /* [depth × channels], a ring; none without a delay */
    std::vector<double> play;   /* [channels] what the far end of a play shows */
    std::vector<double> newest; /* [channels] */
  };

  void take(line* line, std::uint64_t number, std::uint64_t seed, const double* exact);
  double delayed(const line& line, double number, std::size_t channel) const;

  double rate_;
  std::vector<line> lines_; /* [quantities] */
};

}  // namespace tendonfmu::plant
