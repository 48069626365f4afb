#include "learner.h"

#include <algorithm>
#include <cmath>

#include "refusal.h"

namespace tendonfmu::estimation {
namespace {

const learner_options& checked(const learner_options& options) {
  if (!(options.prior_std > 0.0) || !(options.prior_std <= 1e6)) {
    throw refused("prior_std = " + std::to_string(options.prior_std) + ": expected above 0, at most 1e6 scales");
  }
  if (options.block < 1 || options.block > 64) {
    throw refused("block = " + std::to_string(options.block) + ": expected 1 to 64 samples");
  }
  if (!(options.parameter_drift >= 0.0) || !(options.parameter_drift <= 1e6)) {
    throw refused("parameter_drift = " + std::to_string(options.parameter_drift) + ": expected 0 to 1e6 1/s");
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

std::vector<double> start_of(const unknown_list& unknowns) {
  std::vector<double> start;
  for (std::size_t i = 0; i < unknowns.count(); ++i) {
    start.push_back(unknowns[i].start);
  }
  return start;
}

}  // namespace

finger_learner::finger_learner(const void* image, std::size_t image_size, const std::int32_t* group,
                               const double* scale, const learner_options& options)
    : finger_(image, image_size),
      unknowns_(finger_.get(), group, scale),
      rows_(unknowns_, finger_.get()),
      block_(checked(options).block),
      filter_(settings_of(unknowns_, finger_.get(), options), start_of(unknowns_), options.prior_std),
      numbers_(finger_.get()->shape.parameter_count) {
  const finger_settings& s = finger_.get()->derived.settings;
  if (s.noise_std == 0.0 && s.noise_std_per_force == 0.0) {
    throw refused("bias.noise_std = 0: expected above 0 N.m to learn, which weighs the residuals by it");
  }
  for (std::size_t i = 0; i < unknowns_.count(); ++i) {
    for (const std::uint32_t parameter : unknowns_[i].parameters) {
      moved_.push_back(parameter);
    }
  }
  /* a drop moves the statics alone, a coulomb friction the statics above it too */
  for (std::uint32_t p = 0; p < numbers_.size(); ++p) {
    if (unknowns_.side(p).column[0] >= 0) {
      moved_.push_back(p);
    }
  }
  std::sort(moved_.begin(), moved_.end());
  moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
  moved_.erase(std::remove_if(moved_.begin(), moved_.end(),
                              [this](std::size_t p) { /* what only the first sample takes */
                                                      tendonfmu_parameter_info info;
                                                      tendonfmu_get_parameter_info(finger_.get(), p, &info);
                                                      return info.tunable == 0;
                              }),
               moved_.end());
  torque_rows_.assign(finger_.get()->joints * unknowns_.count(), 0.0);
  jump_rows_ = torque_rows_;
  torque_.assign(finger_.get()->joints, 0.0);
  jump_ = measured_ = torque_;
}

/* R of the bias filter (step 6); a first sample has no time step, its noise is that of one sample */
double finger_learner::noise_of(const tendonfmu_inputs& inputs, double step) const {
  const finger_settings& s = finger_.get()->derived.settings;
  const std::size_t m = finger_.get()->tendons;
  double force = 0.0;
  for (std::size_t i = 0; i < m; ++i) {
    force += std::fabs(inputs.tendon_force[i]) / static_cast<double>(m);
  }
  const double noise = s.noise_std + s.noise_std_per_force * force;
  const double share = s.noise_time >= 0.0 && step > 0.0 ? s.noise_time / step : 1.0;
  return noise * noise * std::min(share, 1e300);
}

/* what the finger does not see; it checks the rest itself */
void finger_learner::check(const learner_sample& sample, double step) const {
  if (!sample.inputs.tendon_force) {
    throw refused("tendon_force: missing, expected [m] numbers");
  }
  if (noise_of(sample.inputs, step) == 0.0) {
    throw refused("bias.noise_std = 0 without any tendon force: expected noise above 0 N.m at every sample");
  }
  for (std::size_t j = 0; sample.external_torque && j < torque_.size(); ++j) {
    if (!std::isfinite(sample.external_torque[j])) {
      throw refused("external_torque[" + std::to_string(j) + "]: expected a finite number, N.m");
    }
  }
}

void finger_learner::initialise(const learner_sample& first, int kinematics_source) {
  finish();
  initialised_ = false;
  check(first, 0.0);
  unknowns_.write(filter_.linearise_at(), numbers_.data());
  finger_.begin(numbers_, kinematics_source);
  if (tendonfmu_initialise(finger_.get(), first.time, &first.inputs) != TENDONFMU_OK) {
    throw refused(tendonfmu_last_error(finger_.get()));
  }
  initialised_ = written_ = true;
  bias_started_ = false;
  rows_.read();
  if (first.use || finger_.get()->derived.settings.has_initial_torque) {
    begin_bias(first);
  }
}

/* b = y − T at the first sample that is used, or bias.initial_torque; both depend on the unknowns */
void finger_learner::begin_bias(const learner_sample& sample) {
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
  const double variance = s.initial_variance >= 0.0 ? s.initial_variance : noise_of(sample.inputs, 0.0);
  filter_.start_bias(torque_.data(), torque_rows_.data(), variance);
  bias_started_ = true;
}

bool finger_learner::step(const learner_sample& sample) {
  const double step = sample.time - tendonfmu_get_time(finger_.get());
  if (step == 0.0) {
    return false; /* the sample already taken, as in tendonfmu_step() */
  }
  check(sample, step);
  if (!written_) {
    write_unknowns();
  }
  if (tendonfmu_step(finger_.get(), sample.time, &sample.inputs) != TENDONFMU_OK) {
    throw refused(tendonfmu_last_error(finger_.get()));
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

/* What the unknowns say now, to the finger: samples are linearised there. Not by tendonfmu_set_parameters(), which
 * looks up every index for its range; the unknowns' bounds lie within the ranges, and hold static >= coulomb. */
void finger_learner::write_unknowns() {
  unknowns_.write(filter_.linearise_at(), numbers_.data());
  for (const std::size_t parameter : moved_) {
    finger_.get()->parameters[parameter] = numbers_[parameter];
  }
  derive_numbers(finger_.get(), 0);
  written_ = true;
}

void finger_learner::take(const learner_sample& sample, double step) {
  rows_.dense(torque_rows_.data(), rows_.has_jump() ? jump_rows_.data() : nullptr);
  for (std::size_t j = 0; j < torque_.size(); ++j) {
    torque_[j] = rows_.torque(j);
    jump_[j] = rows_.jump(j);
    measured_[j] = rows_.measured(j) - (sample.external_torque ? sample.external_torque[j] : 0.0);
  }
  /* where the model says that a tendon pushes, its slopes are not those of the finger */
  const bool slack = sample.use && is_slack();
  slack_samples_ += slack;
  filter_.add({torque_.data(), torque_rows_.data(), rows_.has_jump() ? jump_.data() : nullptr, jump_rows_.data(),
               measured_.data(), step, noise_of(sample.inputs, step), sample.use && !slack});
}

bool finger_learner::is_slack() const {
  const double* slack = finger_.get()->remembered.slack;
  return std::any_of(slack, slack + finger_.get()->tendons, [](double flag) { return flag != 0.0; });
}

void finger_learner::finish() {
  if (filter_.gathered() == 0) {
    return;
  }
  if (!filter_.update()) {
    throw refused("the covariance is no longer finite: expected smaller inputs and scales");
  }
  written_ = false;
}

void finger_learner::begin_pass() {
  finish();
  filter_.begin_pass();
  initialised_ = bias_started_ = false;
  slack_samples_ = 0;
}

void finger_learner::standard_errors(double* errors) const {
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

}  // namespace tendonfmu::estimation
