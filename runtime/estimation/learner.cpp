/* The extended Kalman filter on a finger: samples in, the description's numbers with their errors out. */
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "kalman.h"
#include "recording_track.h"
#include "sample_rows.h"

namespace tendonfmu::estimation {
namespace {

constexpr std::size_t rows_between_looks = 1000;

const learner_options& checked(const learner_options& options) {
  if (!(options.prior_std > 0.0) || !(options.prior_std <= 1e6)) {
    throw std::invalid_argument("prior_std = " + std::to_string(options.prior_std) +
                                ": expected above 0, at most 1e6 scales");
  }
  if (options.block < 1 || options.block > 64) {
    throw std::invalid_argument("block = " + std::to_string(options.block) + ": expected 1 to 64 samples");
  }
  if (!(options.parameter_drift >= 0.0) || !(options.parameter_drift <= 1e6)) {
    throw std::invalid_argument("parameter_drift = " + std::to_string(options.parameter_drift) +
                                ": expected 0 to 1e6 1/s");
  }
  return options;
}

kalman_settings settings_of(const unknown_list& unknowns, const tendonfmu_finger* finger,
                            const learner_options& options) {
  kalman_settings s{unknowns.count(),
                    finger->joints,
                    options.block,
                    finger->derived.settings.drift_variance,
                    options.parameter_drift,
                    {},
                    {},
                    {}};
  for (std::size_t i = 0; i < unknowns.count(); ++i) {
    s.scale.push_back(unknowns[i].scale);
    s.lower.push_back(unknowns[i].lower);
    s.upper.push_back(unknowns[i].upper);
  }
  return s;
}

numbers start_of(const unknown_list& unknowns) {
  numbers start;
  for (std::size_t i = 0; i < unknowns.count(); ++i) {
    start.push_back(unknowns[i].start);
  }
  return start;
}

class finger_learner final : public learner {
 public:
  finger_learner(const void* image, std::size_t image_size, const learner_options& options,
                 const std::vector<std::int32_t>& group, const numbers& scale)
      : finger_(image, image_size),
        unknowns_(finger_.get(), group, scale),
        rows_(unknowns_, finger_.get()),
        filter_(settings_of(unknowns_, finger_.get(), checked(options)), start_of(unknowns_), options.prior_std),
        numbers_(finger_.get()->shape.parameter_count),
        torque_rows_(finger_.get()->joints * unknowns_.count()),
        jump_rows_(torque_rows_),
        torque_(finger_.get()->joints),
        jump_(torque_),
        measured_(torque_) {
    const finger_settings& s = finger_.get()->derived.settings;
    if (s.noise_std == 0.0 && s.noise_std_per_force == 0.0) {
      throw std::invalid_argument(
          "bias.noise_std = 0: expected above 0 N.m to learn, which weighs the residuals by it");
    }
  }

  std::size_t joint_count() const override { return finger_.get()->joints; }
  std::size_t tendon_count() const override { return finger_.get()->tendons; }
  std::size_t parameter_count() const override { return numbers_.size(); }
  const std::vector<unknown_item>& unknowns() const override { return unknowns_.items(); }
  std::size_t slack_samples() const override { return slack_samples_; }

  void initialise(const learner_sample& first, int kinematics_source) override {
    finish();
    initialised_ = bias_started_ = false;
    check(first, 0.0);
    unknowns_.write(filter_.linearise_at(), numbers_.data());
    finger_.begin(numbers_, kinematics_source);
    if (tendonfmu_initialise(finger_.get(), first.time, &first.inputs) != TENDONFMU_OK) {
      throw std::invalid_argument(tendonfmu_last_error(finger_.get()));
    }
    initialised_ = written_ = true;
    rows_.read();
    if (first.use || finger_.get()->derived.settings.has_initial_torque) {
      begin_bias(first);
    }
  }

  bool step(const learner_sample& sample) override {
    if (!initialised_) {
      throw std::invalid_argument("a step before the first sample: expected initialise first");
    }
    const double step = sample.time - tendonfmu_get_time(finger_.get());
    if (step == 0.0) {
      return false; /* the sample already taken, as in tendonfmu_step() */
    }
    check(sample, step);
    if (!written_) { /* samples are linearised at what the unknowns say now */
      unknowns_.write(filter_.linearise_at(), numbers_.data());
      finger_.set(numbers_);
      written_ = true;
    }
    if (tendonfmu_step(finger_.get(), sample.time, &sample.inputs) != TENDONFMU_OK) {
      throw std::invalid_argument(tendonfmu_last_error(finger_.get()));
    }
    rows_.read();
    if (!bias_started_) {
      if (sample.use) {
        begin_bias(sample);
      }
      return false;
    }
    take(sample, step);
    if (!filter_.full()) {
      return false;
    }
    finish();
    return true;
  }

  void finish() override {
    if (filter_.gathered() == 0) {
      return;
    }
    if (!filter_.update()) {
      throw std::invalid_argument("the covariance is no longer finite: expected smaller inputs and scales");
    }
    written_ = false;
  }

  void begin_pass() override {
    finish();
    filter_.begin_pass();
    initialised_ = bias_started_ = false;
    slack_samples_ = 0;
  }

  std::size_t run(const recording_arrays& r, double* innovation, double* variance,
                  const learner_watch& watch) override {
    const std::size_t n = joint_count(), m = tendon_count();
    for (double* rows : {innovation, variance}) {
      std::fill_n(rows, rows ? r.samples * n : 0, std::numeric_limits<double>::quiet_NaN());
    }
    if (r.samples < 2) {
      throw std::invalid_argument("samples = " + std::to_string(r.samples) + ": expected at least 2");
    }
    std::size_t row = 0;
    const auto at = [&row](const double* values, std::size_t width) { return values ? values + row * width : nullptr; };
    for (bool wanted = true; row < r.samples && wanted; ++row) {
      const learner_sample sample{r.time[row],
                                  {at(r.inputs.tendon_force, m), at(r.inputs.tendon_position, m),
                                   at(r.inputs.joint_position, n), at(r.inputs.joint_velocity, n)},
                                  at(r.external_torque, n),
                                  !r.use || r.use[row] != 0};
      try {
        if (row == 0) {
          initialise(sample, r.kinematics_source);
        } else if (r.time[row] == r.time[row - 1]) {
          throw std::invalid_argument("time: expected later than the row before");
        } else if (step(sample)) {
          copy_innovations(row + 1, innovation, variance);
        }
      } catch (const std::invalid_argument& reason) {
        throw std::invalid_argument("row " + std::to_string(row + 1) + ": " + reason.what());
      }
      wanted = !watch || row % rows_between_looks != 0 || watch(row, r.samples);
    }
    if (filter_.gathered() > 0) {
      finish();
      copy_innovations(row, innovation, variance);
    }
    return row;
  }

  void get_values(double* values, double* standard_errors) const override {
    if (values) {
      unknowns_.write(filter_.z(), values);
    }
    if (standard_errors) {
      get_standard_errors(standard_errors);
    }
  }

  void get_unknowns(double* z, double* covariance) const override {
    if (z) {
      std::copy_n(filter_.z(), unknowns_.count(), z);
    }
    if (covariance) {
      filter_.covariance(covariance);
    }
  }

  void get_bias(double* bias, double* standard_errors) const override {
    if (!bias_started_) {
      throw std::invalid_argument("no bias before the first sample that is used");
    }
    for (std::size_t j = 0; j < joint_count(); ++j) {
      if (bias) {
        bias[j] = filter_.bias()[j];
      }
      if (standard_errors) {
        standard_errors[j] = std::sqrt(filter_.bias_variance(j));
      }
    }
  }

  std::size_t get_innovations(double* innovation, double* variance) const override {
    const std::size_t count = filter_.updated() * joint_count();
    if (innovation) {
      std::copy_n(filter_.innovation(), count, innovation);
    }
    if (variance) {
      std::copy_n(filter_.innovation_variance(), count, variance);
    }
    return filter_.updated();
  }

 private:
  /* what the finger does not see; it checks the rest itself */
  void check(const learner_sample& sample, double step) const {
    if (!sample.inputs.tendon_force) {
      throw std::invalid_argument("tendon_force: missing, expected [m] numbers");
    }
    if (torque_noise(finger_.get(), sample.inputs, step) == 0.0) {
      throw std::invalid_argument(
          "bias.noise_std = 0 without any tendon force: expected noise above 0 N.m at every sample");
    }
    for (std::size_t j = 0; sample.external_torque && j < torque_.size(); ++j) {
      if (!std::isfinite(sample.external_torque[j])) {
        throw std::invalid_argument("external_torque[" + std::to_string(j + 1) + "]: expected a finite number, N.m");
      }
    }
  }

  /* b = y − T at the first sample that is used, or bias.initial_torque; both depend on the unknowns */
  void begin_bias(const learner_sample& sample) {
    const finger_settings& s = finger_.get()->derived.settings;
    const std::size_t n = torque_.size(), p = unknowns_.count();
    if (s.has_initial_torque) {
      std::fill(torque_rows_.begin(), torque_rows_.end(), 0.0);
      for (std::size_t j = 0; j < n; ++j) {
        const std::int32_t column = unknowns_.initial_torque(j);
        torque_[j] = finger_.get()->derived.initial_torque[j];
        if (column >= 0) {
          torque_[j] = filter_.linearise_at()[column];
          torque_rows_[j * p + static_cast<std::size_t>(column)] = 1.0;
        }
      }
    } else {
      rows_.dense(torque_rows_.data(), nullptr);
      for (double& slope : torque_rows_) {
        slope = -slope;
      }
      for (std::size_t j = 0; j < n; ++j) {
        torque_[j] = rows_.measured(j) - (sample.external_torque ? sample.external_torque[j] : 0.0) - rows_.torque(j);
      }
    }
    const double variance =
        s.initial_variance >= 0.0 ? s.initial_variance : torque_noise(finger_.get(), sample.inputs, 0.0);
    filter_.start_bias(torque_.data(), torque_rows_.data(), variance);
    bias_started_ = true;
  }

  void take(const learner_sample& sample, double step) {
    rows_.dense(torque_rows_.data(), rows_.has_jump() ? jump_rows_.data() : nullptr);
    for (std::size_t j = 0; j < torque_.size(); ++j) {
      torque_[j] = rows_.torque(j);
      jump_[j] = rows_.jump(j);
      measured_[j] = rows_.measured(j) - (sample.external_torque ? sample.external_torque[j] : 0.0);
    }
    /* where the model says that a tendon pushes, its slopes are not those of the finger */
    const double* flags = finger_.get()->remembered.slack;
    const bool slack =
        sample.use && std::any_of(flags, flags + finger_.get()->tendons, [](double flag) { return flag != 0.0; });
    slack_samples_ += slack;
    filter_.add({torque_.data(), torque_rows_.data(), rows_.has_jump() ? jump_.data() : nullptr, jump_rows_.data(),
                 measured_.data(), step, torque_noise(finger_.get(), sample.inputs, step), sample.use && !slack});
  }

  /* the innovations of the block that ends before row `end` */
  void copy_innovations(std::size_t end, double* innovation, double* variance) const {
    const std::size_t first = (end - filter_.updated()) * joint_count();
    get_innovations(innovation ? innovation + first : nullptr, variance ? variance + first : nullptr);
  }

  void get_standard_errors(double* errors) const {
    std::fill_n(errors, numbers_.size(), 0.0);
    const auto variance = [this](std::int32_t a, std::int32_t b) {
      return a < 0 || b < 0 ? 0.0 : filter_.covariance(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
    };
    for (std::uint32_t p = 0; p < numbers_.size(); ++p) {
      const auto [coulomb, drop, rate, viscous] = unknowns_.side(p).column;
      if (unknowns_.plain(p) >= 0) {
        errors[p] = std::sqrt(variance(unknowns_.plain(p), unknowns_.plain(p)));
      }
      if (coulomb >= 0 || drop >= 0) {
        const std::int32_t below = unknowns_.side(p).static_follows ? coulomb : -1;
        errors[p] = std::sqrt(variance(below, below) + variance(drop, drop) + 2.0 * variance(below, drop));
        errors[p + 1] = std::sqrt(variance(coulomb, coulomb));
      }
      if (rate >= 0) { /* vs = 1/rate */
        const double value = filter_.z()[rate];
        errors[p + 2] = std::sqrt(variance(rate, rate)) / (value * value);
      }
      if (viscous >= 0) {
        errors[p + 3] = std::sqrt(variance(viscous, viscous));
      }
    }
  }

  free_finger finger_;
  unknown_list unknowns_;
  sample_rows rows_;
  kalman_filter filter_;
  bool initialised_ = false, bias_started_ = false, written_ = false;
  std::size_t slack_samples_ = 0;
  numbers numbers_; /* [p] */
  numbers torque_rows_, jump_rows_, torque_, jump_, measured_;
};

}  // namespace

std::unique_ptr<learner> make_learner(const void* image, std::size_t image_size, const learner_options& options,
                                      const std::vector<std::int32_t>& group, const numbers& scale) {
  return std::make_unique<finger_learner>(image, image_size, options, group, scale);
}

}  // namespace tendonfmu::estimation
