#include "sensor_bank.h"

#include <algorithm>
#include <cmath>

#include "elementary.h"

namespace tendonfmu::plant {

sensor_bank::sensor_bank(const rig& rig) : rate_(rig.sensors.rate) {
  std::uint32_t first_channel = 0;
  for (const sensor& with : rig.sensors.of) {
    const std::size_t channels = with.gain.size();
    const std::size_t depth = with.delay > 0.0 ? static_cast<std::size_t>(std::ceil(with.delay * rate_)) + 2 : 0;
    const std::vector<double> zeros(channels, 0.0);
    lines_.push_back({&with, first_channel, channels, depth, std::vector<double>(depth * channels), zeros, zeros});
    first_channel += 256;
  }
}

void sensor_bank::clear() {
  for (line& one : lines_) {
    std::fill(one.past.begin(), one.past.end(), 0.0);
    std::fill(one.play.begin(), one.play.end(), 0.0);
  }
}

readings sensor_bank::newest() const {
  readings all;
  std::transform(lines_.begin(), lines_.end(), all.begin(), [](const line& one) { return one.newest.data(); });
  return all;
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

void sensor_bank::take(line* line, std::uint64_t number, std::uint64_t seed, const double* exact) {
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
    line->newest[c] = x;
    if (late) {
      line->past[row + c] = x;
    }
  }
  for (std::size_t c = 0; c < line->channels; ++c) {
    double x =
        with.gain[c] * (late ? delayed(*line, static_cast<double>(number), c) : line->newest[c]) + with.offset[c];
    if (with.noise > 0.0) {
      x += with.noise * normal_number(seed, line->first_channel + static_cast<std::uint32_t>(c), number);
    }
    if (with.resolution > 0.0) {
      x = with.resolution * std::floor(x / with.resolution + 0.5);
    }
    line->newest[c] = x;
  }
}

void sensor_bank::sample(std::uint64_t number, std::uint64_t seed, const readings& exact) {
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    take(&lines_[k], number, seed, exact[k]);
  }
}

}  // namespace tendonfmu::plant
