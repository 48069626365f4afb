#include "sensor_bank.h"

#include <algorithm>
#include <cmath>

#include "random_numbers.h"

namespace tendonfmu::plant {

readings::readings(std::size_t joints, std::size_t tendons)
    : tendon_force(tendons),
      tendon_position(tendons),
      joint_position(joints),
      joint_velocity(joints),
      external_torque(joints) {}

sensor_bank::sensor_bank(const rig& rig) : rate_(rig.sensors.rate), newest_(rig.joint_count(), rig.tendon_count()) {
  const std::size_t n = rig.joint_count(), m = rig.tendon_count();
  std::uint32_t kind = 0;
  const auto add = [&](const sensor& with, std::size_t channels) {
    const std::size_t depth = with.delay > 0.0 ? static_cast<std::size_t>(std::ceil(with.delay * rate_)) + 2 : 0;
    lines_.push_back({&with, 256 * kind++, channels, depth, std::vector<double>(depth * channels, 0.0),
                      std::vector<double>(channels, 0.0)});
  };
  add(rig.sensors.tendon_force, m);
  add(rig.sensors.tendon_position, m);
  add(rig.sensors.joint_position, n);
  add(rig.sensors.joint_velocity, n);
  add(rig.sensors.external_torque, n);
}

void sensor_bank::clear() {
  for (line& one : lines_) {
    std::fill(one.past.begin(), one.past.end(), 0.0);
    std::fill(one.play.begin(), one.play.end(), 0.0);
  }
}

/* Linear between samples; before the first one its value. */
double sensor_bank::delayed(const line& line, double number, std::size_t channel) const {
  const double back = std::min(line.with->delay * rate_, number);
  const double whole = std::floor(back);
  const auto at = [&](double samples_ago) {
    const double row = std::fmod(number - samples_ago, static_cast<double>(line.depth));
    return line.past[static_cast<std::size_t>(row) * line.channels + channel];
  };
  const double newer = at(whole);
  return back == whole ? newer : newer + (back - whole) * (at(whole + 1.0) - newer);
}

void sensor_bank::take(line* line, std::uint64_t number, std::uint64_t seed, const std::vector<double>& exact,
                       std::vector<double>* shown) {
  const sensor& with = *line->with;
  const bool late = line->depth > 0;
  const std::size_t row = late ? number % line->depth * line->channels : 0;
  for (std::size_t c = 0; c < line->channels; ++c) {
    double x = exact[c];
    // play: the far end follows once the gap is taken up; it starts in the middle of the gap
    if (with.backlash > 0.0) {
      const double half = 0.5 * with.backlash;
      line->play[c] = number == 0 ? x : std::clamp(line->play[c], x - half, x + half);
      x = line->play[c];
    }
    (*shown)[c] = x;
    if (late) {
      line->past[row + c] = x;
    }
  }
  for (std::size_t c = 0; c < line->channels; ++c) {
    double x = with.gain[c] * (late ? delayed(*line, static_cast<double>(number), c) : (*shown)[c]) + with.offset[c];
    if (with.noise > 0.0) {
      x += with.noise * normal_number(seed, line->first_channel + static_cast<std::uint32_t>(c), number);
    }
    if (with.resolution > 0.0) {
      x = with.resolution * std::floor(x / with.resolution + 0.5);
    }
    (*shown)[c] = x;
  }
}

void sensor_bank::sample(std::uint64_t number, std::uint64_t seed, const readings& exact) {
  take(&lines_[0], number, seed, exact.tendon_force, &newest_.tendon_force);
  take(&lines_[1], number, seed, exact.tendon_position, &newest_.tendon_position);
  take(&lines_[2], number, seed, exact.joint_position, &newest_.joint_position);
  take(&lines_[3], number, seed, exact.joint_velocity, &newest_.joint_velocity);
  take(&lines_[4], number, seed, exact.external_torque, &newest_.external_torque);
}

}  // namespace tendonfmu::plant
