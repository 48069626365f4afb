#include "recording_track.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace tendonfmu::estimation {

/* --- a finger without contact ------------------------------------------------------------------------------------- */

free_finger::free_finger(const void* image, std::size_t image_size) {
  char message[ERROR_BYTES] = "";
  finger_.reset(tendonfmu_create(image, image_size, message, sizeof message));
  if (!finger_) {
    throw std::invalid_argument(message);
  }
  changed_.reserve(finger_->shape.parameter_count);
  values_.reserve(finger_->shape.parameter_count);
}

/* With thresholds that nothing reaches. bias.initial_torque is fixed, and no longer matters, after the first sample. */
void free_finger::set(const std::vector<double>& numbers) {
  changed_.clear();
  values_.clear();
  visit_items(finger_->shape, [&](const model_item& item) {
    const bool unreached = item.kind == ITEM_CONTACT_THRESHOLD || item.kind == ITEM_BAND_NOISE;
    const bool fixed = item.kind == ITEM_INITIAL_TORQUE && tendonfmu_is_initialised(get());
    for (std::uint32_t p = item.first; p < item.first + item.count && !fixed; ++p) {
      const double value = unreached ? parameter_range_of(&item, p).maximum : numbers[p];
      if (value != finger_->parameters[p]) {
        changed_.push_back(p);
        values_.push_back(value);
      }
    }
  });
  if (tendonfmu_set_parameters(get(), changed_.size(), changed_.data(), values_.data()) != TENDONFMU_OK) {
    throw std::invalid_argument(tendonfmu_last_error(get()));
  }
}

void free_finger::begin(const std::vector<double>& numbers, int kinematics_source) {
  tendonfmu_reset(finger_.get());
  if (tendonfmu_set_kinematics_source(finger_.get(), kinematics_source) != TENDONFMU_OK) {
    throw std::invalid_argument(tendonfmu_last_error(finger_.get()));
  }
  set(numbers);
}

void free_finger::resume(const std::vector<unsigned char>& state, const std::vector<double>& numbers) {
  if (tendonfmu_restore_state(finger_.get(), state.data(), state.size()) != TENDONFMU_OK) {
    throw std::invalid_argument(tendonfmu_last_error(finger_.get()));
  }
  set(numbers);
}

void free_finger::step(std::size_t row, double time, const tendonfmu_inputs& inputs) {
  const tendonfmu_status status = tendonfmu_is_initialised(finger_.get())
                                      ? tendonfmu_step(finger_.get(), time, &inputs)
                                      : tendonfmu_initialise(finger_.get(), time, &inputs);
  if (status != TENDONFMU_OK) {
    throw std::invalid_argument("row " + std::to_string(row + 1) + ": " + tendonfmu_last_error(finger_.get()));
  }
}

std::vector<unsigned char> free_finger::save() const {
  std::vector<unsigned char> state(tendonfmu_state_size(finger_.get()));
  tendonfmu_save_state(finger_.get(), state.data(), state.size());
  return state;
}

bool remembers_numbers(const tendonfmu_finger* finger) {
  return finger->extensions.signals + finger->extensions.frictions + elements_of(finger) > 0;
}

/* --- recordings --------------------------------------------------------------------------------------------------- */

namespace {

constexpr std::size_t most_segments = 24;      /* enough for the cores of today's machines; fixed, so that any */
constexpr std::size_t shortest_segment = 2000; /* number of threads sums in the same order */

std::vector<double> copied(const double* values, std::size_t count) {
  return values ? std::vector<double>(values, values + count) : std::vector<double>();
}

}  // namespace

double torque_noise(const tendonfmu_finger* finger, const tendonfmu_inputs& inputs, double step) {
  const finger_settings& s = finger->derived.settings;
  double force = 0.0;
  for (std::size_t i = 0; i < finger->tendons; ++i) {
    force += std::fabs(inputs.tendon_force[i]) / static_cast<double>(finger->tendons);
  }
  const double noise = s.noise_std + s.noise_std_per_force * force;
  return noise * noise * (s.noise_time >= 0.0 && step > 0.0 ? std::min(s.noise_time / step, 1e300) : 1.0);
}

recording_track::recording_track(free_finger* finger, const recording_arrays& a)
    : joints_(finger->get()->joints),
      tendons_(finger->get()->tendons),
      weight_root_(finger->get()->joints, 1.0),
      source_(a.kinematics_source) {
  if (a.samples < 2) {
    throw std::invalid_argument("samples = " + std::to_string(a.samples) + ": expected at least 2");
  }
  time_ = copied(a.time, a.samples);
  force_ = copied(a.inputs.tendon_force, a.samples * tendons_);
  position_ = copied(a.inputs.tendon_position, a.samples * tendons_);
  angle_ = copied(a.inputs.joint_position, a.samples * joints_);
  velocity_ = copied(a.inputs.joint_velocity, a.samples * joints_);
  external_ = copied(a.external_torque, a.samples * joints_);
  for (std::size_t k = 0; k < a.samples; ++k) {
    for (std::size_t j = 0; j < joints_; ++j) {
      use_.push_back((!a.use || a.use[k] != 0) && (!a.silent || a.silent[k * joints_ + j] == 0));
    }
  }
  for (std::size_t k = 0; k < external_.size(); ++k) {
    if (!std::isfinite(external_[k])) {
      throw std::invalid_argument("row " + std::to_string(k / joints_ + 1) + ": external_torque[" +
                                  std::to_string(k % joints_ + 1) + "]: expected a finite number, N.m");
    }
  }
  segment_length_ = std::max(shortest_segment, (a.samples + most_segments - 1) / most_segments);
  const std::vector<double> start(finger->get()->start, finger->get()->start + finger->get()->shape.parameter_count);
  finger->begin(start, source_);
  for (std::size_t k = 0; k < a.samples; ++k) {
    if (k % segment_length_ == 0) {
      states_.push_back(finger->save());
    }
    finger->step(k, time_[k], inputs(k));
    if (k > 0 && time_[k] == time_[k - 1]) {
      throw std::invalid_argument("row " + std::to_string(k + 1) + ": time: expected later than the row before");
    }
    plain_noise_.push_back(torque_noise(finger->get(), inputs(k), 0.0));
    noise_.push_back(torque_noise(finger->get(), inputs(k), k > 0 ? time_[k] - time_[k - 1] : 0.0));
    if (!(noise_[k] > 0.0)) {
      throw std::invalid_argument(
          "bias.noise_std = 0: expected above 0 N.m for a fit, which weighs the residuals by it");
    }
  }
  std::size_t used = 0;
  for (std::size_t k = 0; k < a.samples; ++k) {
    const auto row = use_.begin() + static_cast<std::ptrdiff_t>(k * joints_);
    used += std::any_of(row, row + static_cast<std::ptrdiff_t>(joints_), [](unsigned char each) { return each != 0; });
  }
  if (used < 2) {
    throw std::invalid_argument(std::to_string(used) + " samples to learn from: expected at least 2");
  }
}

void recording_track::set_weights(const numbers& weight) {
  expect_length(weight.size(), joints_, "weight", "numbers, one a joint");
  for (std::size_t j = 0; j < joints_; ++j) {
    if (!(weight[j] > 0.0 && weight[j] <= 1.0)) {
      throw std::invalid_argument("weight[" + std::to_string(j + 1) + "] = " + std::to_string(weight[j]) +
                                  ": expected above 0 and at most 1");
    }
  }
  std::transform(weight.begin(), weight.end(), weight_root_.begin(), [](double share) { return std::sqrt(share); });
}

tendonfmu_inputs recording_track::inputs(std::size_t row) const {
  const auto at = [](const std::vector<double>& values, std::size_t offset) {
    return values.empty() ? nullptr : values.data() + offset;
  };
  return {at(force_, row * tendons_), at(position_, row * tendons_), at(angle_, row * joints_),
          at(velocity_, row * joints_)};
}

bias_gains::bias_gains(const recording_track& r, const finger_settings& settings, std::size_t stride)
    : gain(r.samples() * r.joints(), 0.0), weight(gain) {
  for (std::size_t j = 0; j < r.joints(); ++j) {
    find(r, settings, stride, j);
  }
}

void bias_gains::find(const recording_track& r, const finger_settings& settings, std::size_t stride,
                      std::size_t joint) {
  bool started = settings.has_initial_torque != 0;
  const double given = settings.initial_variance;
  double variance = given >= 0.0 ? given : r.plain_noise(0);
  for (std::size_t k = 0; k < r.samples(); ++k) {
    if (k > 0 && started) {
      variance += settings.drift_variance * (r.time(k) - r.time(k - 1));
    }
    const bool looked_at = r.used(k, joint) && (k % stride == 0 || (!started && k < stride));
    if (!looked_at || (k == 0 && started)) {
      continue; /* steps 5 and 6 are not for the first sample */
    }
    if (!started) {
      started = true;
      gain[k * r.joints() + joint] = 1.0;
      variance = given >= 0.0 ? given : r.plain_noise(k);
      continue;
    }
    const double noise = r.noise(k) / static_cast<double>(stride);
    const double total = variance + noise;
    const double share = variance / total;
    gain[k * r.joints() + joint] = share;
    weight[k * r.joints() + joint] = 1.0 / std::sqrt(total);
    variance *= 1.0 - share;
  }
}

}  // namespace tendonfmu::estimation
