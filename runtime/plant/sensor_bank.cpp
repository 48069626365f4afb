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
                      std::vector<double>(channels, 0.0), 0.0});
  };
  add(rig.sensors.tendon_force, m);
  add(rig.sensors.tendon_position, m);
  add(rig.sensors.joint_position, n);
  add(rig.sensors.joint_velocity, n);
  add(rig.sensors.external_torque, n);
}

void sensor_bank::clear() {
  for (line& one : lines_) {
    one.taken = 0.0;
    std::fill(one.past.begin(), one.past.end(), 0.0);
    std::fill(one.play.begin(), one.play.end(), 0.0);
  }
}

/* Linear between samples; before the first one its value. */
double sensor_bank::delayed(const line& line, std::size_t channel) const {
  const double back = std::min(line.with->delay * rate_, line.taken - 1.0);
  const double whole = std::floor(back);
  const auto at = [&](double samples_ago) {
    const double row = std::fmod(line.taken - 1.0 - samples_ago, static_cast<double>(line.depth));
    return line.past[static_cast<std::size_t>(row) * line.channels + channel];
  };
  const double newer = at(whole);
  return back == whole ? newer : newer + (back - whole) * (at(whole + 1.0) - newer);
}

void sensor_bank::take(line* line, std::uint64_t number, std::uint64_t seed, const std::vector<double>& exact,
                       std::vector<double>* shown) {
  const sensor& with = *line->with;
  const bool late = line->depth > 0;
  const std::size_t row =
      late ? static_cast<std::size_t>(std::fmod(line->taken, static_cast<double>(line->depth))) * line->channels : 0;
  for (std::size_t c = 0; c < line->channels; ++c) {
    double x = exact[c];
    // play: the far end follows once the gap is taken up; it starts in the middle of the gap
    if (with.backlash > 0.0) {
      const double half = 0.5 * with.backlash;
      line->play[c] = line->taken == 0.0 ? x : std::clamp(line->play[c], x - half, x + half);
      x = line->play[c];
    }
    (*shown)[c] = x;
    if (late) {
      line->past[row + c] = x;
    }
  }
  line->taken += 1.0;
  for (std::size_t c = 0; c < line->channels; ++c) {
    double x = with.gain[c] * (late ? delayed(*line, c) : (*shown)[c]) + with.offset[c];
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

namespace {

template <class Bank, class Visit>
void visit_numbers(Bank* bank, Visit visit) {
  for (auto* values : {&bank->tendon_force, &bank->tendon_position, &bank->joint_position, &bank->joint_velocity,
                       &bank->external_torque}) {
    visit(values);
  }
}

}  // namespace

void sensor_bank::append_state(std::vector<double>* numbers) const {
  const auto append = [&](const std::vector<double>* values) {
    numbers->insert(numbers->end(), values->begin(), values->end());
  };
  visit_numbers(&newest_, append);
  for (const line& one : lines_) {
    append(&one.past);
    append(&one.play);
    numbers->push_back(one.taken);
  }
}

const double* sensor_bank::restore_state(const double* numbers) {
  const auto take_back = [&](std::vector<double>* values) {
    std::copy(numbers, numbers + values->size(), values->begin());
    numbers += values->size();
  };
  visit_numbers(&newest_, take_back);
  for (line& one : lines_) {
    take_back(&one.past);
    take_back(&one.play);
    one.taken = *numbers++;
  }
  return numbers;
}

}  // namespace tendonfmu::plant
