#include "kalman.h"

#include <algorithm>
#include <cmath>

#include "products.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

Eigen::Map<const VectorXd> view(const double* values, Index count) {
  return {values, count};
}

VectorXd copied(const std::vector<double>& values) {
  return view(values.data(), static_cast<Index>(values.size()));
}

}  // namespace

kalman_filter::kalman_filter(kalman_settings settings, const std::vector<double>& start, double prior_std)
    : settings_(std::move(settings)),
      prior_std_(prior_std),
      scale_(copied(settings_.scale)),
      lower_(copied(settings_.lower)),
      upper_(copied(settings_.upper)) {
  const auto p = static_cast<Index>(settings_.unknowns), n = static_cast<Index>(settings_.joints);
  const auto block = static_cast<Index>(settings_.block), most = (block + 1) * n;
  start_ = copied(start).cwiseMax(lower_).cwiseMin(upper_);
  z_ = anchor_ = start_;
  offset_.setZero(p);
  bias_.setZero(n);
  covariance_.setZero(p + n, p + n);
  set_prior();
  jump_.setZero(n);
  jump_rows_.setZero(n, p);
  rows_.setZero(most, p + n);
  product_ = rows_;
  inner_.setZero(most, most);
  noise_ = time_ = VectorXd::Zero(block);
  use_.assign(settings_.block, 0);
  residual_ = pivot_ = white_ = innovation_ = innovation_variance_ = VectorXd::Zero(block * n);
  correction_.setZero(p + n);
}

void kalman_filter::set_prior() {
  covariance_.setZero();
  covariance_.diagonal().head(unknowns()).setConstant(prior_std_ * prior_std_);
}

void kalman_filter::begin_pass() {
  anchor_ = z_;
  z_ = start_;
  settled_ = true;
  set_prior();
}

void kalman_filter::find_offset() {
  if (settled_) {
    offset_ = (z_ - anchor_).cwiseQuotient(scale_);
  }
}

/* of the state's order: by z/scale, and nothing by the bias */
template <typename Slopes>
void kalman_filter::set_row(Index row, const Slopes& slopes) {
  rows_.row(row).head(unknowns()) = slopes.cwiseProduct(scale_);
  rows_.row(row).tail(joints()).setZero();
}

/* H P and H P Hᵀ, of which the lower triangle is enough */
void kalman_filter::multiply_rows(Index rows) {
  const auto size = static_cast<std::size_t>(order()), count = static_cast<std::size_t>(rows),
             stride = static_cast<std::size_t>(inner_.cols());
  const products& by = best_products();
  by.multiply_symmetric(product_.data(), size, covariance_.data(), size, rows_.data(), count, size);
  for (std::size_t first = 0, end; first < count; first = end) {
    end = std::min(first + 12, count);
    by.multiply_transposed(inner_.data() + first * stride, stride, rows_.data() + first * size, end - first, size,
                           product_.data(), end, size, size);
  }
}

void kalman_filter::start_bias(const double* bias, const double* rows, double variance) {
  const Index p = unknowns(), n = joints();
  find_offset();
  for (Index j = 0; j < n; ++j) {
    set_row(j, view(rows + j * p, p));
    bias_[j] = bias[j] + offset(j);
  }
  covariance_.bottomRows(n).setZero();
  multiply_rows(n);
  covariance_.bottomLeftCorner(n, p) = product_.topLeftCorner(n, p);
  covariance_.bottomRightCorner(n, n) = inner_.topLeftCorner(n, n);
  covariance_.diagonal().tail(n).array() += variance;
}

void kalman_filter::add(const kalman_sample& sample) {
  const Index p = unknowns(), n = joints();
  if (gathered_ == 0) {
    elapsed_ = 0.0;
    jumped_ = false;
    jump_.setZero();
    jump_rows_.setZero();
    find_offset();
  }
  elapsed_ += sample.step;
  if (sample.jump) {
    jump_rows_ += Eigen::Map<const rows_matrix>(sample.jump_rows, n, p);
    jump_ += view(sample.jump, n);
    jumped_ = true;
  }
  for (Index j = 0; j < n; ++j) {
    const Index row = measured() + j;
    set_row(row, view(sample.torque_rows + j * p, p) + jump_rows_.row(j).transpose());
    rows_(row, p + j) = 1.0;
    residual_[row] = sample.measured[j] - sample.torque[j] - (bias_[j] + jump_[j]) - offset(row);
  }
  time_[static_cast<Index>(gathered_)] = elapsed_;
  noise_[static_cast<Index>(gathered_)] = sample.noise;
  use_[gathered_] = sample.use;
  ++gathered_;
}

bool kalman_filter::update() {
  if (gathered_ == 0) {
    return true;
  }
  const Index n = joints(), rows = measured() + (jumped_ ? n : 0);
  /* below the measurements: what the jumps of the whole block say about the bias at its end */
  for (Index row = measured(); row < rows; ++row) {
    set_row(row, jump_rows_.row(row - measured()).transpose());
  }
  covariance_.diagonal().head(unknowns()).array() += settings_.parameter_drift * elapsed_;
  multiply_rows(rows);
  propagate(rows);
  add_noise();
  if (!factor()) {
    return false;
  }
  find_innovations();
  whiten();
  const auto size = static_cast<std::size_t>(order());
  best_products().add_outer_products(covariance_.data(), size, product_.data(), static_cast<std::size_t>(measured()),
                                     size, -1.0);
  correct();
  updated_ = gathered_;
  gathered_ = 0;
  return true;
}

/* The bias goes to the end of the block, in mean and covariance, and so do the products: they become the covariances of
 * the measurements with the state there. */
void kalman_filter::propagate(Index rows) {
  const Index p = unknowns(), n = joints(), m = measured();
  bias_ += jump_;
  covariance_.diagonal().tail(n).array() += settings_.drift_variance * elapsed_;
  if (rows > m) {
    for (Index j = 0; j < n; ++j) {
      bias_[j] += offset(m + j);
    }
    const auto moved = product_.middleRows(m, n);
    covariance_.bottomLeftCorner(n, p) += moved.leftCols(p);
    covariance_.bottomRightCorner(n, n) +=
        moved.rightCols(n) + moved.rightCols(n).transpose() + inner_.block(m, m, n, n);
    product_.topRightCorner(m, n) += inner_.block(m, 0, n, m).transpose();
  }
  for (Index row = 0; row < m; ++row) {
    product_(row, p + row % n) += settings_.drift_variance * time_[row / n];
  }
}

/* the walk since the block's start, which later samples of a joint share, and the noise, to H P Hᵀ */
void kalman_filter::add_noise() {
  const Index n = joints();
  for (Index row = 0; row < measured(); ++row) {
    for (Index before = row % n; before <= row; before += n) {
      inner_(row, before) += settings_.drift_variance * time_[before / n];
    }
    inner_(row, row) += noise_[row / n];
  }
}

/* Cholesky factor, row by row, in place of the innovations' covariance. A measurement that is not used has a row, which
 * has its own variance, but no column: no covariance with the others. */
bool kalman_filter::factor() {
  for (Index row = 0; row < measured(); ++row) {
    auto l = inner_.row(row);
    for (Index column = 0; column < row; ++column) {
      const double rest = l[column] - l.head(column).dot(inner_.row(column).head(column));
      l[column] = used(column) ? rest / inner_(column, column) : 0.0;
    }
    pivot_[row] = l[row] - l.head(row).squaredNorm();
    if (!(pivot_[row] > 0.0) || !(pivot_[row] < HUGE_VAL)) {
      return false;
    }
    l[row] = used(row) ? std::sqrt(pivot_[row]) : 0.0;
  }
  return true;
}

/* What each sample leaves with all before it taken in, and L⁻¹ times the residuals. */
void kalman_filter::find_innovations() {
  for (Index row = 0; row < measured(); ++row) {
    const Index first = row - row % joints(), among = row - first; /* of its sample */
    const auto l = inner_.row(row);
    innovation_[row] = residual_[row] - l.head(first).dot(white_.head(first));
    innovation_variance_[row] = pivot_[row] + l.segment(first, among).squaredNorm();
    const double rest = innovation_[row] - l.segment(first, among).dot(white_.segment(first, among));
    white_[row] = used(row) ? rest / l[row] : 0.0;
  }
}

/* W = L⁻¹ times the products, in their place; of measurements that are not used nothing */
void kalman_filter::whiten() {
  for (Index row = 0; row < measured(); ++row) {
    if (!used(row)) {
      product_.row(row).setZero();
      inner_.row(row).head(row).setZero();
      inner_(row, row) = 1.0;
    }
  }
  const auto size = static_cast<std::size_t>(order());
  best_products().solve_lower(inner_.data(), static_cast<std::size_t>(inner_.cols()), product_.data(),
                              static_cast<std::size_t>(measured()), size, size);
}

/* z and b += W·L⁻¹(y − ŷ), within the bounds */
void kalman_filter::correct() {
  correction_.setZero();
  for (Index row = 0; row < measured(); ++row) {
    correction_ += white_[row] * product_.row(row).transpose();
  }
  keep_within_bounds();
  z_ = (z_ + scale_.cwiseProduct(correction_.head(unknowns()))).cwiseMax(lower_).cwiseMin(upper_);
  bias_ += correction_.tail(joints());
}

/* Where a bound stops an unknown, the others go along as their covariances with it say: the most likely state on the
 * bound, not the one found by moving one number alone. Exact for one bound at a time; what several leave is cut off. */
void kalman_filter::keep_within_bounds() {
  for (int sweep = 0; sweep < 3; ++sweep) {
    bool moved = false;
    for (Index i = 0; i < unknowns(); ++i) {
      const double wanted = z_[i] + scale_[i] * correction_[i];
      const double excess = std::clamp(wanted, lower_[i], upper_[i]) - wanted;
      if (excess != 0.0) {
        moved = true;
        const double share = excess / scale_[i] / covariance_(i, i);
        correction_.head(i) += share * covariance_.row(i).head(i).transpose();
        correction_.tail(order() - i) += share * covariance_.col(i).tail(order() - i);
      }
    }
    if (!moved) {
      return;
    }
  }
}

double kalman_filter::covariance(std::size_t unknown, std::size_t other) const {
  const auto row = static_cast<Index>(std::max(unknown, other)), column = static_cast<Index>(std::min(unknown, other));
  return covariance_(row, column) * (scale_[row] * scale_[column]);
}

void kalman_filter::covariance(double* matrix) const {
  Eigen::Map<Eigen::MatrixXd> all(matrix, unknowns(), unknowns());
  all = covariance_.topLeftCorner(unknowns(), unknowns()).selfadjointView<Eigen::Lower>();
  all = all.cwiseProduct(scale_.lazyProduct(scale_.transpose()));
}

}  // namespace tendonfmu::estimation
