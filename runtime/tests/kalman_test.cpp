// The filter of kalman.h against the textbook's in long double, on models made up for the purpose.
#include "kalman.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

/* The filter that kalman.h is compared with: one sample at a time, full matrices in long double, Joseph's form. Written
 * for nothing but to be seen to be right. */
namespace naive {

using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

/* n rows of p numbers */
Matrix rows_of(const double* numbers, std::size_t n, std::size_t p) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto rows = static_cast<Eigen::Index>(n), columns = static_cast<Eigen::Index>(p);
  return Eigen::Map<const RowMajor>(numbers, rows, columns).cast<long double>();
}

class Filter {
 public:
  Filter(const tendonfmu::estimation::kalman_settings& settings, const std::vector<double>& start, double prior_std)
      : s(settings),
        p(static_cast<Eigen::Index>(s.unknowns)),
        n(static_cast<Eigen::Index>(s.joints)),
        state(Vector::Zero(p + n)),
        covariance(Matrix::Zero(p + n, p + n)) {
    for (Eigen::Index i = 0; i < p; ++i) {
      state(i) = start[static_cast<std::size_t>(i)];
      covariance(i, i) = std::pow(prior_std * s.scale[static_cast<std::size_t>(i)], 2);
    }
  }

  /* b = bias + rows·(z − its mean) + something of that variance */
  void start_bias(const double* bias, const double* rows, double variance) {
    Matrix transition = Matrix::Identity(p + n, p + n);
    transition.bottomRows(n).setZero();
    transition.bottomLeftCorner(n, p) = rows_of(rows, s.joints, s.unknowns);
    covariance = transition * covariance * transition.transpose();
    covariance.bottomRightCorner(n, n) += variance * Matrix::Identity(n, n);
    state.tail(n) = rows_of(bias, s.joints, 1);
  }

  void take(const tendonfmu::estimation::kalman_sample& sample) {
    Matrix transition = Matrix::Identity(p + n, p + n), rows(n, p + n);
    for (Eigen::Index i = 0; i < p; ++i) {
      const long double scale = s.scale[static_cast<std::size_t>(i)];
      covariance(i, i) += s.parameter_drift * sample.step * scale * scale;
    }
    if (sample.jump) {
      transition.bottomLeftCorner(n, p) = rows_of(sample.jump_rows, s.joints, s.unknowns);
      state.tail(n) += rows_of(sample.jump, s.joints, 1);
    }
    covariance = transition * covariance * transition.transpose();
    covariance.bottomRightCorner(n, n) += s.drift_variance * sample.step * Matrix::Identity(n, n);
    rows << rows_of(sample.torque_rows, s.joints, s.unknowns), Matrix::Identity(n, n);
    innovation = rows_of(sample.measured, s.joints, 1) - rows_of(sample.torque, s.joints, 1) - state.tail(n);
    innovation_covariance = rows * covariance * rows.transpose() + sample.noise * Matrix::Identity(n, n);
    if (!sample.use) {
      return;
    }
    const Matrix gain = covariance * rows.transpose() * innovation_covariance.inverse();
    const Matrix kept = Matrix::Identity(p + n, p + n) - gain * rows;
    state += gain * innovation;
    covariance = kept * covariance * kept.transpose() + sample.noise * gain * gain.transpose();
  }

  tendonfmu::estimation::kalman_settings s;
  Eigen::Index p, n;
  Vector state, innovation; /* (z, b) */
  Matrix covariance, innovation_covariance;
};

}  // namespace naive

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

/* A sample's numbers, and the model that made them: T_j = Σ_i a_ji·g(z_i), Δb likewise; g(z) = z, or z + curvature·z².
 */
class Model {
 public:
  Model(const kalman_settings& settings, double curvature, unsigned seed)
      : s_(settings), curvature_(curvature), random_(seed), truth(s_.unknowns), bias_(s_.joints, 0.2) {
    for (std::size_t i = 0; i < s_.unknowns; ++i) {
      truth[i] = s_.scale[i] * (1.0 + 0.5 * normal());
    }
  }

  /* the next sample: what is measured, and which coefficients are at work */
  void next() {
    const std::size_t count = s_.joints * s_.unknowns;
    torque_factor_ = coefficients(count, 0.4);
    has_jump_ = uniform() < 0.15;
    jump_factor_ = coefficients(count, has_jump_ ? 0.2 : 0.0);
    step_ = 0.001 * (0.5 + uniform());
    noise_ = 1e-4 * (0.5 + uniform());
    use_ = uniform() < 0.9;
    measured_ = apply(torque_factor_, truth);
    const Numbers jump = apply(jump_factor_, truth);
    for (std::size_t j = 0; j < s_.joints; ++j) {
      bias_[j] += jump[j] + std::sqrt(s_.drift_variance * step_) * normal();
      measured_[j] += bias_[j] + std::sqrt(noise_) * normal();
    }
  }

  /* linearised at z */
  kalman_sample at(const double* unknowns) {
    const Numbers z(unknowns, unknowns + s_.unknowns);
    torque_ = apply(torque_factor_, z);
    jump_ = apply(jump_factor_, z);
    torque_rows_ = slopes(torque_factor_, z);
    jump_rows_ = slopes(jump_factor_, z);
    return {torque_.data(),
            torque_rows_.data(),
            has_jump_ ? jump_.data() : nullptr,
            jump_rows_.data(),
            measured_.data(),
            step_,
            noise_,
            use_};
  }

  bool used() const { return use_; }
  const Numbers& torque_rows() const { return torque_rows_; }
  double normal() { return std::normal_distribution<double>()(random_); }
  double uniform() { return std::uniform_real_distribution<double>()(random_); }

 private:
  Numbers coefficients(std::size_t count, double share) {
    Numbers all(count, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      if (uniform() < share) {
        all[i] = normal() / s_.scale[i % s_.unknowns];
      }
    }
    return all;
  }

  double g(double z, double scale) const { return z + curvature_ * z * z / scale; }

  Numbers apply(const Numbers& factor, const Numbers& z) const {
    Numbers sum(s_.joints, 0.0);
    for (std::size_t k = 0; k < factor.size(); ++k) {
      sum[k / s_.unknowns] += factor[k] * g(z[k % s_.unknowns], s_.scale[k % s_.unknowns]);
    }
    return sum;
  }

  Numbers slopes(const Numbers& factor, const Numbers& z) const {
    Numbers all = factor;
    for (std::size_t k = 0; k < factor.size(); ++k) {
      all[k] *= 1.0 + 2.0 * curvature_ * z[k % s_.unknowns] / s_.scale[k % s_.unknowns];
    }
    return all;
  }

  kalman_settings s_;
  double curvature_;
  std::mt19937_64 random_;

 public:
  Numbers truth;

 private:
  Numbers bias_, measured_, torque_factor_, jump_factor_, torque_, jump_, torque_rows_, jump_rows_;
  double step_ = 0.0, noise_ = 0.0;
  bool has_jump_ = false, use_ = true;
};

/* both filters, side by side */
class Pair {
 public:
  Pair(const kalman_settings& s, double curvature, unsigned seed)
      : settings(s), model(s, curvature, seed), filter(s, s.scale, 1.0), naive(s, s.scale, 1.0) {
    model.next();
    const kalman_sample first = model.at(s.scale.data());
    Numbers bias(s.joints), rows(first.torque_rows, first.torque_rows + s.joints * s.unknowns);
    for (std::size_t j = 0; j < s.joints; ++j) {
      bias[j] = first.measured[j] - first.torque[j];
    }
    for (double& slope : rows) {
      slope = -slope;
    }
    filter.start_bias(bias.data(), rows.data(), 2e-4);
    naive.start_bias(bias.data(), rows.data(), 2e-4);
  }

  /* what a model that is linear where the block begins says, to both */
  void run(std::size_t samples) {
    for (std::size_t k = 0; k < samples; ++k) {
      model.next();
      filter.add(model.at(filter.z()));
      take_naively();
      if (filter.full() || k + 1 == samples) {
        ASSERT_TRUE(filter.update());
        compare_innovations();
      }
    }
  }

  void compare(double tolerance) const {
    const std::size_t p = settings.unknowns;
    Numbers covariance(p * p);
    filter.covariance(covariance.data());
    for (std::size_t i = 0; i < p; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      EXPECT_NEAR(filter.z()[i], static_cast<double>(naive.state(at)), tolerance * settings.scale[i]);
      EXPECT_EQ(filter.covariance(i, i), covariance[i * p + i]);
      for (std::size_t k = 0; k < p; ++k) {
        ASSERT_EQ(covariance[i * p + k], covariance[k * p + i]);
        const auto expected = static_cast<double>(naive.covariance(at, static_cast<Eigen::Index>(k)));
        EXPECT_NEAR(covariance[i * p + k], expected, tolerance * settings.scale[i] * settings.scale[k]);
      }
    }
    for (std::size_t j = 0; j < settings.joints; ++j) {
      const auto at = static_cast<Eigen::Index>(p + j);
      EXPECT_NEAR(filter.bias()[j], static_cast<double>(naive.state(at)), tolerance);
      EXPECT_NEAR(filter.bias_variance(j), static_cast<double>(naive.covariance(at, at)), tolerance);
    }
  }

  kalman_settings settings;
  Model model;
  kalman_filter filter;
  naive::Filter naive;
  double worst = 0.0; /* largest difference of innovations, and of their variances */

 private:
  void take_naively() {
    Numbers z(settings.unknowns);
    for (std::size_t i = 0; i < z.size(); ++i) {
      z[i] = static_cast<double>(naive.state(static_cast<Eigen::Index>(i)));
    }
    naive.take(model.at(z.data()));
    for (std::size_t j = 0; j < settings.joints; ++j) {
      const auto at = static_cast<Eigen::Index>(j);
      expected_.push_back(static_cast<double>(naive.innovation(at)));
      expected_variance_.push_back(static_cast<double>(naive.innovation_covariance(at, at)));
    }
  }

  void compare_innovations() {
    ASSERT_EQ(filter.updated() * settings.joints, expected_.size());
    for (std::size_t k = 0; k < expected_.size(); ++k) {
      worst = std::max(worst, std::fabs(filter.innovation()[k] - expected_[k]));
      worst = std::max(worst, std::fabs(filter.innovation_variance()[k] - expected_variance_[k]));
    }
    expected_.clear();
    expected_variance_.clear();
  }

  Numbers expected_, expected_variance_;
};

class KalmanBlocks : public testing::TestWithParam<std::size_t> {};

// The whole covariance is of size 1 at first and 1e-4 at the end: rounding of the first updates stays, 1e-16 each.
TEST_P(KalmanBlocks, AreExactForALinearModel) {
  for (const std::size_t joints : {std::size_t{1}, std::size_t{3}}) {
    Pair pair(some_settings(11, joints, GetParam()), 0.0, 21);
    pair.run(203);
    pair.compare(1e-10);
    EXPECT_LT(pair.worst, 1e-9);
  }
}

TEST_P(KalmanBlocks, StayNearTheTextbookForACurvedModel) {
  Pair pair(some_settings(9, 2, GetParam()), 0.05, 23);
  pair.run(1500);
  // exact where every sample is a block; else within a part of a standard error, which is about 1e-2
  pair.compare(GetParam() == 1 ? 1e-9 : 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Samples, KalmanBlocks, testing::Values(1, 2, 8, 33));

TEST(Kalman, LetsUnknownsDrift) {
  kalman_settings s = some_settings(7, 2, 1);
  s.parameter_drift = 0.5;
  Pair pair(s, 0.0, 24);
  pair.run(300);
  pair.compare(1e-10);
  // so far that it matters: the stationary error is many times that of constants
  EXPECT_GT(pair.filter.covariance(3, 3), 1e-5 * s.scale[3] * s.scale[3]);
}

/* the same samples to a filter that is bounded and to one that is not */
struct Bounded {
  explicit Bounded(const kalman_settings& s)
      : settings(s), free_settings(s), free(prepare(), s.scale, 1.0), filter(s, s.scale, 1.0) {}

  const kalman_settings& prepare() {
    free_settings.lower.assign(settings.unknowns, -1e300);
    free_settings.upper.assign(settings.unknowns, 1e300);
    return free_settings;
  }

  void run(Model* model, std::size_t samples) {
    const Numbers zero(settings.joints * settings.unknowns, 0.0);
    model->next();
    free.start_bias(zero.data(), zero.data(), 1.0);
    filter.start_bias(zero.data(), zero.data(), 1.0);
    for (std::size_t k = 0; k < samples; ++k) {
      model->next();
      free.add(model->at(free.z()));
      filter.add(model->at(filter.z()));
      if (filter.full()) {
        ASSERT_TRUE(free.update() && filter.update());
        for (std::size_t i = 0; i < settings.unknowns; ++i) {
          ASSERT_GE(filter.z()[i], settings.lower[i]);
          ASSERT_LE(filter.z()[i], settings.upper[i]);
        }
      }
    }
  }

  kalman_settings settings, free_settings;
  kalman_filter free, filter;
};

TEST(Kalman, FindsTheMostLikelyStateOnABound) {
  kalman_settings s = some_settings(6, 1, 4);
  Model model(s, 0.0, 25);
  model.truth[2] = 3.0 * s.scale[2];
  s.upper[2] = s.scale[2]; /* where it starts */
  Bounded both(s);
  both.run(&model, 400);
  ASSERT_EQ(both.filter.z()[2], s.upper[2]);
  Numbers covariance(36);
  both.free.covariance(covariance.data());
  for (std::size_t i = 0; i < 6; ++i) { /* what the unbounded one says, given that unknown */
    const double share = covariance[6 * i + 2] / covariance[6 * 2 + 2];
    const double expected = both.free.z()[i] + share * (s.upper[2] - both.free.z()[2]);
    EXPECT_NEAR(both.filter.z()[i], expected, 1e-8 * s.scale[i]);
  }
}

TEST(Kalman, LearnsNothingFromSamplesThatAreNotUsed) {
  const kalman_settings s = some_settings(8, 2, 8);
  Model model(s, 0.0, 26);
  model.next();
  kalman_filter filter(s, s.scale, 1.0);
  const Numbers zero(16, 0.0);
  filter.start_bias(zero.data(), zero.data(), 0.01);
  const Numbers before(filter.z(), filter.z() + 8);
  double elapsed = 0.0;
  for (std::size_t k = 0; k < 8; ++k) {
    model.next();
    kalman_sample sample = model.at(filter.z());
    sample.use = false;
    sample.jump = nullptr;
    elapsed += sample.step;
    filter.add(sample);
  }
  ASSERT_TRUE(filter.update());
  EXPECT_EQ(Numbers(filter.z(), filter.z() + 8), before);
  EXPECT_EQ(filter.bias()[0], 0.0);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_DOUBLE_EQ(filter.covariance(i, i), s.scale[i] * s.scale[i]);
  }
  EXPECT_DOUBLE_EQ(filter.bias_variance(1), 0.01 + s.drift_variance * elapsed);
  EXPECT_NE(filter.innovation()[3], 0.0); /* what is left is told all the same */
}

// Twenty samples were enough for P − K H P to lose nine digits.
TEST(Kalman, CovarianceStaysPositiveDefiniteOverTenThousandSamples) {
  kalman_settings s = some_settings(60, 4, 8);
  s.drift_variance = 1e-6;
  Model model(s, 0.0, 27);
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
  Model model(s, 0.0, 28);
  model.next();
  kalman_filter filter(s, s.scale, 1.0);
  Numbers rows(3, std::nan(""));
  kalman_sample sample = model.at(s.scale.data());
  sample.torque_rows = rows.data();
  filter.add(sample);
  EXPECT_FALSE(filter.update());
}

}  // namespace
