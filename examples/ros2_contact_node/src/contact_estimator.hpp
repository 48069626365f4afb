// From tendon states to compensated torques and contact: all that the node does, without ROS.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <tendonfmu.hpp>
#include <vector>

// One message: what sensor_msgs/JointState has of it. The names may be more than the finger's, in any order.
struct tendon_state {
  std::int64_t stamp = 0;  // ns
  tendonfmu::span<const std::string> names;
  tendonfmu::span<const double> force;     // N, `effort`, as many as names
  tendonfmu::span<const double> position;  // m, motor side, as many as names
};

enum class outcome {
  taken,            // as it should be
  taken_after_gap,  // messages are missing before it
  restarted,        // the clock went back: taken as the first sample
  repeated,         // the stamp of the last message: nothing happened
  refused           // nothing happened
};

class contact_estimator {
 public:
  struct settings {
    std::vector<std::string> tendon_names;  // [m] in the order of the description
    std::size_t joints = 0;                 // that the user expects
    double longest_gap = 0.1;               // s, between two messages
    double restart_after = 1.0;             // s: a stamp that goes back further is another run of the clock
  };

  // Throws std::invalid_argument where names and finger do not fit together.
  contact_estimator(tendonfmu::finger finger, settings chosen);

  outcome take(const tendon_state& message);

  // To be called now and then with a steady time (ns): false while no message has come for longest_gap.
  bool watch(std::int64_t now);

  // One line about what take() or watch() found last that was not as it should be.
  const std::string& reason() const { return reason_; }

  // Of the message last taken; 0 and false before the first.
  tendonfmu::span<const double> compensated_torque() const { return torque_; }  // [n] N·m
  bool contact() const { return contact_ != 0; }

 private:
  bool find_columns(tendonfmu::span<const std::string> names);
  bool gather(const tendon_state& message);
  outcome begin(const tendon_state& message, outcome meaning);
  outcome step(const tendon_state& message);
  outcome refuse(std::string reason);

  tendonfmu::finger finger_;
  settings settings_;
  std::vector<unsigned char> untouched_;  // the state before the first sample
  std::vector<std::string> names_;        // of the last message, which columns_ belong to
  std::vector<std::size_t> columns_;      // [m] where each tendon is in a message; empty: not known
  std::vector<double> force_, position_, torque_;
  unsigned char contact_ = 0;
  std::int64_t first_ = 0, last_ = 0;  // ns
  std::int64_t heard_ = 0;             // ns, of watch()
  bool watched_ = false, arrived_ = false;
  std::string reason_;
};
