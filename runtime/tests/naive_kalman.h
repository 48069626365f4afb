/* The filter that kalman.h is compared with: one sample at a time, full matrices in long double, Joseph's form. Written
 * for nothing but to be seen to be right. */
#pragma once

#include <Eigen/Dense>

#include "kalman.h"

namespace naive {

using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

/* n rows of p numbers */
inline Matrix rows_of(const double* numbers, std::size_t n, std::size_t p) {
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
