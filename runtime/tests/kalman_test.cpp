// The filter of kalman.h on linear models: bounds, samples that are not used, and its covariance after many samples.
// python_tests/estimate/test_estimation_ekf.py compares it with the textbook's, sample by sample.
#include "kalman.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using tendonfmu::estimation::kalman_filter;
using tendonfmu::estimation::kalman_sample;
using tendonfmu::estimation::kalman_settings;
using Numbers = std::vector<double>;

kalman_settings some_settings(std::size_t unknowns, std::size_t joints, std::size_t block) {
  const double infinity = std::numeric_limits<double>::infinity();
  kalman_settings s{
      unknowns, joints, block, 0.03, 0.0, Numbers(unknowns), Numbers(unknowns, -infinity), Numbers(unknowns, infinity)};
  for (std::size_t i = 0; i < unknowns; ++i) {
    s.scale[i] = 0.1 + 3.0 * static_cast<double>(i % 5);
  }
  return s;
}

/* A linear model: T_j = Σ_i a_ji·z_i, Δb likewise, with coefficients that are drawn anew for each sample. */
class Model {
 public:
  Numbers truth;

  Model(const kalman_settings& settings, unsigned seed)
      : truth(settings.unknowns), s_(settings), random_(seed), bias_(s_.joints, 0.2) {
    for (std::size_t i = 0; i < s_.unknowns; ++i) {
      truth[i] = s_.scale[i] * (1.0 + 0.5 * normal());
    }
  }

  /* the next sample: what is measured, and which coefficients are at work */
  void next() {
    torque_rows_ = coefficients(0.4);
    has_jump_ = uniform() < 0.15;
    jump_rows_ = coefficients(has_jump_ ? 0.2 : 0.0);
    step_ = 0.001 * (0.5 + uniform());
    noise_ = 1e-4 * (0.5 + uniform());
    use_ = uniform() < 0.9;
    measured_ = apply(torque_rows_, truth.data());
    const Numbers jump = apply(jump_rows_, truth.data());
    for (std::size_t j = 0; j < s_.joints; ++j) {
      bias_[j] += jump[j] + std::sqrt(s_.drift_variance * step_) * normal();
      measured_[j] += bias_[j] + std::sqrt(noise_) * normal();
    }
  }

  /* what the model makes of these unknowns */
  kalman_sample at(const double* z) {
    torque_ = apply(torque_rows_, z);
    jump_ = apply(jump_rows_, z);
    return {torque_.data(),
            torque_rows_.data(),
            has_jump_ ? jump_.data() : nullptr,
            jump_rows_.data(),
            measured_.data(),
            step_,
            noise_,
            use_};
  }

 private:
  double normal() { return std::normal_distribution<double>()(random_); }
  double uniform() { return std::uniform_real_distribution<double>()(random_); }

  Numbers coefficients(double share) {
    Numbers all(s_.joints * s_.unknowns, 0.0);
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] = uniform() < share ? normal() / s_.scale[i % s_.unknowns] : 0.0;
    }
    return all;
  }

  Numbers apply(const Numbers& rows, const double* z) const {
    Numbers sum(s_.joints, 0.0);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      sum[k / s_.unknowns] += rows[k] * z[k % s_.unknowns];
    }
    return sum;
  }

  kalman_settings s_;
  std::mt19937_64 random_;
  Numbers bias_, measured_, torque_, jump_, torque_rows_, jump_rows_;
  double step_ = 0.0, noise_ = 0.0;
  bool has_jump_ = false, use_ = true;
};

TEST(Kalman, FindsTheMostLikelyStateOnABound) {
  kalman_settings s = some_settings(6, 1, 4);
  Model model(s, 25);
  model.truth[2] = 3.0 * s.scale[2];
  kalman_filter free(s, s.scale, 1.0);
  s.upper[2] = s.scale[2]; /* where it starts */
  kalman_filter bounded(s, s.scale, 1.0);
  const Numbers zero(6, 0.0);
  for (kalman_filter* filter : {&free, &bounded}) {
    filter->start_bias(zero.data(), zero.data(), 1.0);
  }
  for (std::size_t k = 0; k < 400; ++k) {
    model.next();
    for (kalman_filter* filter : {&free, &bounded}) {
      filter->add(model.at(filter->z()));
      ASSERT_TRUE(!filter->full() || filter->update());
    }
    ASSERT_LE(bounded.z()[2], s.upper[2]);
  }
  ASSERT_EQ(bounded.z()[2], s.upper[2]);
  for (std::size_t i = 0; i < 6; ++i) { /* what the unbounded one says, given that unknown */
    const double share = free.covariance(i, 2) / free.covariance(2, 2);
    EXPECT_NEAR(bounded.z()[i], free.z()[i] + share * (s.upper[2] - free.z()[2]), 1e-8 * s.scale[i]);
  }
}

// Twenty samples were enough for P − K H P to lose nine digits.
TEST(Kalman, CovarianceStaysPositiveDefiniteOverTenThousandSamples) {
  kalman_settings s = some_settings(60, 4, 8);
  s.drift_variance = 1e-6;
  Model model(s, 27);
  model.next();
  kalman_filter filter(s, s.scale, 1.0);
  const Numbers zero(240, 0.0);
  filter.start_bias(zero.data(), zero.data(), 1.0);
  for (std::size_t k = 0; k < 10000; ++k) {
    model.next();
    kalman_sample sample = model.at(filter.z());
    sample.noise *= 1e-6; /* as hard as it gets: 1e-5 of the torque */
    filter.add(sample);
    if (filter.full()) {
      ASSERT_TRUE(filter.update());
    }
  }
  Eigen::MatrixXd covariance(60, 60);
  filter.covariance(covariance.data());
  const Eigen::VectorXd inverse_scale = Eigen::Map<const Eigen::VectorXd>(s.scale.data(), 60).cwiseInverse();
  const Eigen::MatrixXd scaled = inverse_scale.asDiagonal() * covariance * inverse_scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  EXPECT_GT(solver.eigenvalues().minCoeff(), 0.0);
  EXPECT_LT(solver.eigenvalues().maxCoeff(), 1e-9);
}

TEST(Kalman, RefusesNumbersThatAreNotFinite) {
  const kalman_settings s = some_settings(3, 1, 1);
  Model model(s, 28);
  model.next();
  kalman_filter filter(s, s.scale, 1.0);
  Numbers rows(3, std::nan(""));
  kalman_sample sample = model.at(s.scale.data());
  sample.torque_rows = rows.data();
  filter.add(sample);
  EXPECT_FALSE(filter.update());
}

// Nothing is uncertain here but the noise, so its variance is the whole of the innovation's.
TEST(Kalman, RefusesAVarianceThatIsNotPositiveOrNotFinite) {
  kalman_settings s = some_settings(3, 1, 1);
  s.drift_variance = 0.0;
  Model model(s, 29);
  model.next();
  const Numbers none(3, 0.0);
  for (const double noise : {-1e-4, 0.0, 1e-4, HUGE_VAL}) {
    kalman_filter filter(s, s.scale, 0.0);
    kalman_sample sample = model.at(s.scale.data());
    sample.torque_rows = none.data();
    sample.jump = nullptr;
    sample.noise = noise;
    sample.use = true;
    filter.add(sample);
    EXPECT_EQ(filter.update(), noise == 1e-4) << noise;
  }
}

}  // namespace
