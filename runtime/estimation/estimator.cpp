#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "information.h"
#include "sample_rows.h"

namespace tendonfmu::estimation {
namespace {

/* unknowns within their boxes, up to rounding */
numbers checked(const fit_problem& problem, const numbers& z) {
  expect_length(z.size(), problem.unknowns.count(), "z", "unknowns");
  numbers values = z;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const unknown_item& u = problem.unknowns[k];
    const double slack = 1e-9 * u.scale;
    if (!(values[k] >= u.lower - slack && values[k] <= u.upper + slack)) {
      char text[200];
      std::snprintf(text, sizeof text, "unknown %zu (%s) = %g: expected %g to %g", k, u.path.c_str(), values[k],
                    u.lower, u.upper);
      throw std::invalid_argument(text);
    }
    values[k] = std::clamp(values[k], u.lower, u.upper);
  }
  return values;
}

const recording_track& known_recording(const fit_problem& problem, std::size_t recording) {
  if (recording >= problem.recordings.size()) {
    throw std::invalid_argument("recording " + std::to_string(recording) + ": expected below " +
                                std::to_string(problem.recordings.size()));
  }
  return problem.recordings[recording];
}

/* the finger over the samples of a recording from `first` on, with a call after each */
template <typename Body>
void replay(const fit_problem& problem, const recording_track& r, const numbers& z, std::size_t first,
            std::size_t count, free_finger* finger, const Body& body) {
  const std::size_t segment = remembers_numbers(finger->get()) ? 0 : first / r.segment_length();
  const numbers values = problem.unknowns.write(z.data());
  if (segment > 0) {
    finger->resume(r.states()[segment], values);
  } else {
    finger->begin(values, r.kinematics_source());
  }
  for (std::size_t k = segment * r.segment_length(); k < first + count; ++k) {
    finger->step(k, r.time(k), r.inputs(k));
    if (k >= first) {
      body(k);
    }
  }
}

/* the scalar bias filter of one joint */
struct bias_filter {
  double bias = 0.0;
  bool started = false;

  double take(double torque, double jump, double gain, bool starts) {
    bias += jump;
    if (starts) {
      bias = torque;
      started = true;
    }
    const double innovation = torque - bias;
    bias += gain * innovation;
    return innovation;
  }
};

}  // namespace

estimator::estimator(const void* image, std::size_t image_size, const std::vector<std::int32_t>& group,
                     const numbers& scale)
    : problem_(std::make_unique<fit_problem>(image, image_size, group, scale)) {}

estimator::~estimator() = default;

std::size_t estimator::joint_count() const {
  return problem_->joints();
}

std::size_t estimator::tendon_count() const {
  return problem_->finger.get()->tendons;
}

std::size_t estimator::parameter_count() const {
  return problem_->finger.get()->shape.parameter_count;
}

const std::vector<unknown_item>& estimator::unknowns() const {
  return problem_->unknowns.items();
}

numbers estimator::start() const {
  numbers z;
  for (const unknown_item& unknown : unknowns()) {
    z.push_back(unknown.start);
  }
  return z;
}

numbers estimator::values(const numbers& z) const {
  return problem_->unknowns.write(checked(*problem_, z).data());
}

numbers estimator::unknown_values(const numbers& values) const {
  expect_length(values.size(), parameter_count(), "values", "numbers");
  return problem_->unknowns.read(values.data());
}

std::size_t estimator::add_recording(const recording_arrays& recording) {
  problem_->recordings.emplace_back(&problem_->finger, recording);
  return problem_->recordings.size() - 1;
}

void estimator::set_weights(std::size_t recording, const numbers& weight) {
  known_recording(*problem_, recording);
  problem_->recordings[recording].set_weights(weight);
}

void estimator::set_known(const numbers& information) {
  const auto u = static_cast<Eigen::Index>(information.empty() ? 0 : unknowns().size());
  expect_length(information.size(), static_cast<std::size_t>(u * u), "information", "numbers");
  const Eigen::Map<const Eigen::MatrixXd> given(information.data(), u, u);
  if (u > 0) {
    const Eigen::VectorXd size = given.diagonal().cwiseAbs().cwiseSqrt().cwiseMax(1e-150).cwiseInverse();
    const Eigen::MatrixXd unit = size.asDiagonal() * given * size.asDiagonal();
    if (!unit.allFinite() || (unit - unit.transpose()).cwiseAbs().maxCoeff() > 1e-6 ||
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(unit).eigenvalues()[0] < -1e-6) {
      throw std::invalid_argument("information: expected a symmetric, positive semidefinite matrix");
    }
  }
  problem_->known = 0.5 * (given + given.transpose());
}

estimator::evaluation estimator::evaluate(const numbers& z, std::size_t stride, unsigned threads) const {
  const cost_evaluation at =
      estimation::evaluate(*problem_, checked(*problem_, z), {std::max<std::size_t>(stride, 1), threads}, {});
  return {at.cost, copied(at.gradient), copied(at.information)};
}

estimator::block_means estimator::jacobian(std::size_t recording, const numbers& z, std::size_t first,
                                           std::size_t blocks, std::size_t length) const {
  const recording_track& r = known_recording(*problem_, recording);
  const std::size_t n = joint_count(), row = n * unknowns().size();
  if (length == 0 || first > r.samples() || blocks > (r.samples() - first) / length) {
    throw std::invalid_argument("blocks: expected within the " + std::to_string(r.samples()) +
                                " samples of the recording, of at least one each");
  }
  const double share = 1.0 / static_cast<double>(length);
  free_finger finger(problem_->image.data(), problem_->image.size());
  sample_rows rows(problem_->unknowns, finger.get(), derivatives::nearly);
  block_means means{numbers(blocks * n), numbers(blocks * n), numbers(blocks * row), numbers(blocks * row)};
  replay(*problem_, r, checked(*problem_, z), first, blocks * length, &finger, [&](std::size_t k) {
    const std::size_t block = (k - first) / length;
    rows.read();
    rows.add_dense(&means.torque_derivative[block * row], &means.jump_derivative[block * row], share);
    for (std::size_t j = 0; j < n; ++j) {
      means.torque[block * n + j] += share * rows.torque(j);
      means.jump[block * n + j] += share * rows.jump(j);
    }
  });
  return means;
}

estimator::residuals estimator::innovations(std::size_t recording, const numbers& z) const {
  const recording_track& r = known_recording(*problem_, recording);
  const numbers unknowns = checked(*problem_, z);
  const derived_numbers& derived = problem_->finger.get()->derived;
  const std::size_t n = joint_count(), samples = r.samples();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  free_finger finger(problem_->image.data(), problem_->image.size());
  const bias_gains gains(r, derived.settings, 1);
  std::vector<bias_filter> filters(n);
  for (std::size_t j = 0; j < n && derived.settings.has_initial_torque; ++j) {
    const std::int32_t column = problem_->unknowns.initial_torque(j);
    filters[j] = {column < 0 ? derived.initial_torque[j] : unknowns[static_cast<std::size_t>(column)], true};
  }
  residuals all{numbers(samples * n, nan), numbers(samples * n, nan), numbers(samples * n, nan)};
  replay(*problem_, r, unknowns, 0, samples, &finger, [&](std::size_t k) {
    const finger_scratch& s = finger.get()->scratch;
    for (std::size_t j = 0; j < n; ++j) {
      const double gain = gains.gain[k * n + j], weight = gains.weight[k * n + j];
      const bool starts = gain == 1.0 && weight == 0.0;
      const double torque = finger.get()->remembered.torque[j] - r.external_torque(k, j) - s.friction[j];
      const double e = filters[j].take(torque, s.bias_step[j], starts ? 0.0 : gain, starts);
      if (filters[j].started) {
        all.innovation[k * n + j] = starts ? nan : e;
        all.bias[k * n + j] = filters[j].bias;
      }
      if (weight > 0.0) {
        all.variance[k * n + j] = 1.0 / (weight * weight);
      }
    }
  });
  return all;
}

}  // namespace tendonfmu::estimation
