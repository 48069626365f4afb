/* What the sensors make of the true signals: play, delay, gain and offset, noise, resolution, in this order. */
#pragma once

#include <cstdint>
#include <vector>

#include "rig.h"

namespace tendonfmu::plant {

/* A value of every sensor. */
struct readings {
  std::vector<double> tendon_force, tendon_position;                   /* [m] */
  std::vector<double> joint_position, joint_velocity, external_torque; /* [n] */

  readings() = default;
  readings(std::size_t joints, std::size_t tendons);
};

class sensor_bank {
 public:
  explicit sensor_bank(const rig& rig);

  /* Takes sample `number` (0, 1, 2, ... at number/rate) of the true signals. */
  void sample(std::uint64_t number, std::uint64_t seed, const readings& exact);

  /* The newest sample. */
  const readings& newest() const { return newest_; }

  void clear();

  /* Shows each list of remembered numbers to `visit`, in one order: saved states. */
  template <class Bank, class Visit>
  static void visit_state(Bank& bank, Visit visit) {
    auto& newest = bank.newest_;
    for (auto* values : {&newest.tendon_force, &newest.tendon_position, &newest.joint_position, &newest.joint_velocity,
                         &newest.external_torque}) {
      visit(values->data(), values->size());
    }
    for (auto& one : bank.lines_) {
      visit(one.past.data(), one.past.size());
      visit(one.play.data(), one.play.size());
    }
  }

 private:
  /* One quantity: its sensor, and the delay's memory of the last samples. */
  struct line {
    const sensor* with;
    std::uint32_t first_channel;
    std::size_t channels, depth;
    std::vector<double> past; /* [depth × channels], a ring; none without a delay */
    std::vector<double> play; /* [channels] what the far end of a play shows */
  };

  void take(line* line, std::uint64_t number, std::uint64_t seed, const std::vector<double>& exact,
            std::vector<double>* shown);
  double delayed(const line& line, double number, std::size_t channel) const;

  double rate_;
  std::vector<line> lines_;
  readings newest_;
};

}  // namespace tendonfmu::plant
