#include "kalman.h"

#include <algorithm>
#include <cmath>

#include "products.h"

namespace tendonfmu::estimation {

kalman_filter::kalman_filter(kalman_settings settings, const std::vector<double>& start, double prior_std)
    : settings_(std::move(settings)), prior_std_(prior_std), start_(start) {
  const std::size_t p = settings_.unknowns, n = settings_.joints, most = settings_.block * n;
  bias_.assign(n, 0.0);
  covariance_.assign(order() * order(), 0.0);
  offset_.assign(p, 0.0);
  for (std::size_t i = 0; i < p; ++i) {
    start_[i] = std::clamp(start_[i], settings_.lower[i], settings_.upper[i]);
  }
  z_ = anchor_ = start_;
  set_prior();
  jump_.assign(n, 0.0);
  jump_rows_.assign(n * p, 0.0);
  rows_.assign((most + n) * order(), 0.0);
  product_ = rows_;
  inner_.assign((most + n) * (most + n), 0.0);
  noise_.assign(settings_.block, 0.0);
  time_ = noise_;
  use_.assign(settings_.block, 0);
  residual_.assign(most, 0.0);
  pivot_ = white_ = innovation_ = innovation_variance_ = residual_;
  correction_.assign(order(), 0.0);
}

void kalman_filter::set_prior() {
  std::fill(covariance_.begin(), covariance_.end(), 0.0);
  for (std::size_t i = 0; i < settings_.unknowns; ++i) {
    at(i, i) = prior_std_ * prior_std_;
  }
}

void kalman_filter::begin_pass() {
  anchor_ = z_;
  z_ = start_;
  settled_ = true;
  set_prior();
}

/* how far z is from where the samples are linearised */
void kalman_filter::find_offset() {
  for (std::size_t i = 0; settled_ && i < settings_.unknowns; ++i) {
    offset_[i] = (z_[i] - anchor_[i]) / settings_.scale[i];
  }
}

/* and what a row makes of it */
double kalman_filter::offset(const double* row) const {
  double sum = 0.0;
  for (std::size_t i = 0; settled_ && i < settings_.unknowns; ++i) {
    sum += row[i] * offset_[i];
  }
  return sum;
}

/* row = (first + second)·scale; the bias columns are left alone */
void kalman_filter::scale_row(const double* first, const double* second, double* row) const {
  const double* scale = settings_.scale.data();
  for (std::size_t i = 0; i < settings_.unknowns; ++i) {
    row[i] = (second ? first[i] + second[i] : first[i]) * scale[i];
  }
}

void kalman_filter::start_bias(const double* bias, const double* rows, double variance) {
  const std::size_t p = settings_.unknowns, n = settings_.joints;
  for (std::size_t column = 0; column < order(); ++column) {
    for (std::size_t row = std::max(column, p); row < order(); ++row) {
      at(row, column) = 0.0;
    }
  }
  find_offset();
  for (std::size_t j = 0; j < n; ++j) {
    scale_row(rows + j * p, nullptr, rows_.data() + j * order());
    bias_[j] = bias[j] + offset(rows_.data() + j * order());
    std::fill_n(rows_.begin() + static_cast<std::ptrdiff_t>(j * order() + p), n, 0.0);
  }
  best_products().multiply_symmetric(product_.data(), order(), covariance_.data(), order(), rows_.data(), n, order());
  best_products().multiply_transposed(inner_.data(), n, rows_.data(), n, order(), product_.data(), n, order(), order());
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < p; ++i) {
      at(p + j, i) = product_[j * order() + i];
    }
    for (std::size_t other = 0; other <= j; ++other) {
      at(p + j, p + other) = inner_[j * n + other] + (other == j ? variance : 0.0);
    }
  }
}

void kalman_filter::add(const kalman_sample& sample) {
  const std::size_t p = settings_.unknowns, n = settings_.joints;
  if (gathered_ == 0) {
    elapsed_ = 0.0;
    jumped_ = false;
    std::fill(jump_.begin(), jump_.end(), 0.0);
    find_offset();
  }
  elapsed_ += sample.step;
  if (sample.jump) {
    for (std::size_t i = 0; i < n * p; ++i) {
      jump_rows_[i] = (jumped_ ? jump_rows_[i] : 0.0) + sample.jump_rows[i];
    }
    for (std::size_t j = 0; j < n; ++j) {
      jump_[j] += sample.jump[j];
    }
    jumped_ = true;
  }
  for (std::size_t j = 0; j < n; ++j) {
    const std::size_t row = gathered_ * n + j;
    double* h = rows_.data() + row * order();
    scale_row(sample.torque_rows + j * p, jumped_ ? jump_rows_.data() + j * p : nullptr, h);
    std::fill_n(h + p, n, 0.0);
    h[p + j] = 1.0;
    residual_[row] = sample.measured[j] - sample.torque[j] - (bias_[j] + jump_[j]) - offset(h);
  }
  time_[gathered_] = elapsed_;
  noise_[gathered_] = sample.noise;
  use_[gathered_] = sample.use;
  ++gathered_;
}

bool kalman_filter::update() {
  if (gathered_ == 0) {
    return true;
  }
  const std::size_t p = settings_.unknowns, n = settings_.joints, measured = gathered_ * n;
  /* below the measurements: what the jumps of the whole block say about the bias at its end */
  for (std::size_t j = 0; jumped_ && j < n; ++j) {
    double* row = rows_.data() + (measured + j) * order();
    scale_row(jump_rows_.data() + j * p, nullptr, row);
    std::fill_n(row + p, n, 0.0);
  }
  for (std::size_t i = 0; settings_.parameter_drift > 0.0 && i < p; ++i) {
    at(i, i) += settings_.parameter_drift * elapsed_;
  }
  const std::size_t rows = measured + (jumped_ ? n : 0);
  best_products().multiply_symmetric(product_.data(), order(), covariance_.data(), order(), rows_.data(), rows,
                                     order());
  best_products().multiply_transposed(inner_.data(), rows, rows_.data(), rows, order(), product_.data(), rows, order(),
                                      order());
  propagate(rows);
  add_noise(rows);
  if (!factor(rows)) {
    return false;
  }
  find_innovations(rows);
  whiten(rows);
  best_products().add_outer_products(covariance_.data(), order(), product_.data(), measured, order(), -1.0);
  correct();
  updated_ = gathered_;
  gathered_ = 0;
  return true;
}

/* The bias goes to the end of the block, in mean and covariance, and so do the products: they become the covariances of
 * the measurements with the state there. */
void kalman_filter::propagate(std::size_t rows) {
  const std::size_t p = settings_.unknowns, n = settings_.joints, measured = gathered_ * n;
  for (std::size_t j = 0; j < n; ++j) {
    bias_[j] += jump_[j];
    at(p + j, p + j) += settings_.drift_variance * elapsed_;
  }
  for (std::size_t j = 0; measured + j < rows; ++j) {
    const double* moved = product_.data() + (measured + j) * order();
    bias_[j] += offset(rows_.data() + (measured + j) * order());
    for (std::size_t i = 0; i < p; ++i) {
      at(p + j, i) += moved[i];
    }
    for (std::size_t other = 0; other <= j; ++other) {
      const double* others = product_.data() + (measured + other) * order();
      at(p + j, p + other) += moved[p + other] + others[p + j] + inner_[(measured + j) * rows + measured + other];
    }
    for (std::size_t row = 0; row < measured; ++row) {
      product_[row * order() + p + j] += inner_[row * rows + measured + j];
    }
  }
  for (std::size_t row = 0; row < measured; ++row) {
    product_[row * order() + p + row % n] += settings_.drift_variance * time_[row / n];
  }
}

/* the walk since the block's start, which later samples of a joint share, and the noise, to H P Hᵀ */
void kalman_filter::add_noise(std::size_t rows) {
  const std::size_t n = settings_.joints;
  for (std::size_t row = 0; row < gathered_ * n; ++row) {
    for (std::size_t before = row % n; before <= row; before += n) {
      inner_[row * rows + before] += settings_.drift_variance * time_[before / n];
    }
    inner_[row * rows + row] += noise_[row / n];
  }
}

/* Cholesky factor, row by row, in place of the innovations' covariance. A measurement that is not used has a row, which
 * has its own variance, but no column: no covariance with the others. */
bool kalman_filter::factor(std::size_t rows) {
  const std::size_t n = settings_.joints;
  for (std::size_t row = 0; row < gathered_ * n; ++row) {
    double* l = inner_.data() + row * rows;
    for (std::size_t column = 0; column <= row; ++column) {
      const double* other = inner_.data() + column * rows;
      double rest = l[column];
      for (std::size_t k = 0; k < column; ++k) {
        rest -= l[k] * other[k];
      }
      if (column < row) {
        l[column] = use_[column / n] ? rest / other[column] : 0.0;
        continue;
      }
      if (!(rest > 0.0) || !(rest < HUGE_VAL)) {
        return false;
      }
      pivot_[row] = rest;
      l[row] = use_[row / n] ? std::sqrt(rest) : 0.0;
    }
  }
  return true;
}

/* What each sample leaves with all before it taken in, and L⁻¹ times the residuals. */
void kalman_filter::find_innovations(std::size_t rows) {
  const std::size_t n = settings_.joints;
  for (std::size_t row = 0; row < gathered_ * n; ++row) {
    const double* l = inner_.data() + row * rows;
    const std::size_t first = row - row % n; /* of its sample */
    double residual = residual_[row], variance = pivot_[row];
    for (std::size_t k = 0; k < first; ++k) {
      residual -= l[k] * white_[k];
    }
    innovation_[row] = residual;
    for (std::size_t k = first; k < row; ++k) {
      residual -= l[k] * white_[k];
      variance += l[k] * l[k];
    }
    innovation_variance_[row] = variance;
    white_[row] = use_[row / n] ? residual / l[row] : 0.0;
  }
}

/* W = L⁻¹ times the products, in their place; of measurements that are not used nothing */
void kalman_filter::whiten(std::size_t rows) {
  const std::size_t measured = gathered_ * settings_.joints;
  for (std::size_t row = 0; row < measured; ++row) {
    if (!use_[row / settings_.joints]) {
      std::fill_n(product_.begin() + static_cast<std::ptrdiff_t>(row * order()), order(), 0.0);
      std::fill_n(inner_.begin() + static_cast<std::ptrdiff_t>(row * rows), row, 0.0);
      inner_[row * rows + row] = 1.0;
    }
  }
  best_products().solve_lower(inner_.data(), rows, product_.data(), measured, order(), order());
}

/* z and b += W·L⁻¹(y − ŷ), within the bounds */
void kalman_filter::correct() {
  const std::size_t p = settings_.unknowns, n = settings_.joints;
  std::fill(correction_.begin(), correction_.end(), 0.0);
  for (std::size_t row = 0; row < gathered_ * n; ++row) {
    for (std::size_t i = 0; i < order(); ++i) {
      correction_[i] += white_[row] * product_[row * order() + i];
    }
  }
  keep_within_bounds();
  for (std::size_t i = 0; i < p; ++i) {
    z_[i] = std::clamp(z_[i] + settings_.scale[i] * correction_[i], settings_.lower[i], settings_.upper[i]);
  }
  for (std::size_t j = 0; j < n; ++j) {
    bias_[j] += correction_[p + j];
  }
}

/* Where a bound stops an unknown, the others go along as their covariances with it say: the most likely state on the
 * bound, not the one found by moving one number alone. Exact for one bound at a time; what several leave is cut off. */
void kalman_filter::keep_within_bounds() {
  for (int sweep = 0; sweep < 3; ++sweep) {
    bool moved = false;
    for (std::size_t i = 0; i < settings_.unknowns; ++i) {
      const double wanted = z_[i] + settings_.scale[i] * correction_[i];
      const double excess = std::clamp(wanted, settings_.lower[i], settings_.upper[i]) - wanted;
      if (excess == 0.0) {
        continue;
      }
      moved = true;
      const double share = excess / settings_.scale[i] / at(i, i);
      for (std::size_t k = 0; k < order(); ++k) {
        correction_[k] += share * (k < i ? at(i, k) : at(k, i));
      }
    }
    if (!moved) {
      return;
    }
  }
}

double kalman_filter::covariance(std::size_t unknown, std::size_t other) const {
  return at(std::max(unknown, other), std::min(unknown, other)) * (settings_.scale[unknown] * settings_.scale[other]);
}

double kalman_filter::bias_variance(std::size_t joint) const {
  return at(settings_.unknowns + joint, settings_.unknowns + joint);
}

void kalman_filter::covariance(double* matrix) const {
  const std::size_t p = settings_.unknowns;
  for (std::size_t column = 0; column < p; ++column) {
    for (std::size_t row = 0; row < p; ++row) {
      matrix[row * p + column] = covariance(row, column);
    }
  }
}

}  // namespace tendonfmu::estimation
