#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "signal_source.hpp"

namespace {

class hand : public signal_source {
 public:
  hand(const tendonfmu::finger& finger, double rate)
      : period_(1.0 / rate), force_(finger.tendon_count()), position_(finger.tendon_count()) {
    for (std::size_t i = 1; i <= finger.tendon_count(); ++i) {
      const std::string tendon = "tendons[" + std::to_string(i) + "].";
      stiffness_.push_back(number(finger, tendon + "stiffness"));
      double travel = 0.0;  // of the tendon with all joints at 0.2 rad
      for (std::size_t j = 1; j <= finger.joint_count(); ++j) {
        travel += 0.2 * number(finger, tendon + "moment_arms[" + std::to_string(j) + "]");
      }
      travel_.push_back(travel);
    }
  }

  bool read(sample& next) noexcept override {
    const double time = period_ * static_cast<double>(count_++);
    const double phase = std::fmod(time, 2.0);
    const double pull = phase > 1.5 && phase < 1.8 ? 8.0 : 0.0;  // N
    for (std::size_t i = 0; i < force_.size(); ++i) {
      force_[i] = 12.0 + (travel_[i] > 0.0 ? pull : 0.0);
      position_[i] = travel_[i] + force_[i] / stiffness_[i];
    }
    next = {time, force_, position_};
    return true;
  }

 private:
  static double number(const tendonfmu::finger& finger, const std::string& path) {
    double value = 0.0;
    if (finger.get_parameter(path.c_str(), value) != tendonfmu::status::ok) {
      throw std::runtime_error(finger.last_error());
    }
    return value;
  }

  double period_;
  unsigned long count_ = 0;
  std::vector<double> travel_, stiffness_, force_, position_;
};

}  // namespace

std::unique_ptr<signal_source> simulated_hand(const tendonfmu::finger& finger, double rate) {
  return std::make_unique<hand>(finger, rate);
}
