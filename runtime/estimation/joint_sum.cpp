#include "joint_sum.h"

#include <algorithm>
#include <cmath>

#include "products.h"

namespace tendonfmu::estimation {
namespace {

constexpr std::size_t dense_rows = 32; /* rows of whole blocks summed at a time */
constexpr std::size_t residual = 0;    /* its column */

void add_scaled(const double* from, double factor, double* to, std::size_t count) {
  for (std::size_t c = 0; c < count; ++c) {
    to[c] += factor * from[c];
  }
}

/* no power of two: rows do not fall onto each other in the cache */
std::size_t stride_of(std::size_t columns) {
  return (columns + 7) / 8 * 8 + 8;
}

}  // namespace

block_rows::block_rows(std::size_t columns)
    : stride_(stride_of(columns)),
      local_(columns, -1),
      rows_(block_length * stride_, 0.0),
      row_(stride_, 0.0),
      held_(stride_, 0.0),
      mean_(stride_, 0.0) {
  active_.reserve(columns);
}

void block_rows::filter(double gain, double weight, std::size_t at) {
  const std::size_t count = active_.size();
  double *now = row_.data(), *held = held_.data();
  if (weight > 0.0) {
    double* to = rows_.data() + at * stride_;
    for (std::size_t c = 0; c < count; ++c) {
      const double innovation = now[c] - held[c];
      to[c] = innovation * weight;
      held[c] += gain * innovation;
      now[c] = 0.0;
    }
    stored_ = at + 1;
    return;
  }
  for (std::size_t c = 0; c < count; ++c) {
    held[c] += gain * (now[c] - held[c]);
    now[c] = 0.0;
  }
}

void block_rows::take_off_mean(const double* decay, double squares, std::size_t count) {
  std::fill_n(mean_.begin(), active_.size(), 0.0);
  if (!(squares > 0.0)) { /* the bias has begun in this block: nothing from before it counts */
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    add_scaled(row(i), decay[i] / squares, mean_.data(), active_.size());
  }
  for (std::size_t i = 0; i < count; ++i) {
    add_scaled(mean_.data(), -decay[i], rows_.data() + i * stride_, active_.size());
  }
}

void block_rows::clear() {
  std::fill_n(held_.begin(), active_.size(), 0.0);
  std::fill_n(row_.begin(), active_.size(), 0.0);
  for (const std::size_t column : active_) {
    local_[column] = -1;
  }
  active_.clear();
  stored_ = 0;
}

joint_sum::joint_sum(std::size_t columns)
    : rows(columns),
      held_(columns),
      cross_(columns),
      dense_(dense_rows * columns),
      dense_sum_(columns * columns),
      product_(rows.stride() * rows.stride()) {
  begin_segment();
}

void joint_sum::begin_segment() {
  for (std::vector<double>* values : {&held_, &cross_, &dense_sum_}) {
    std::fill(values->begin(), values->end(), 0.0);
  }
  kept_ = block_kept_ = 1.0;
  squares_ = block_squares_ = 0.0;
  rows.clear();
  used_ = dense_count_ = 0;
  rows.add(residual, 0.0); /* always the first of the active ones */
}

void joint_sum::filter(double gain, double weight) {
  rows.filter(gain, weight, used_);
  if (weight > 0.0) {
    decay_[used_] = block_kept_ * weight;
    block_squares_ += decay_[used_] * decay_[used_];
    ++used_;
  }
  block_kept_ *= 1.0 - gain;
}

/* z = √C·held − u/√C of all columns, and the block's share of Σ c_i ν_i */
void joint_sum::pass_on() {
  const double root = std::sqrt(block_squares_), share = kept_ * block_squares_;
  double* z = dense_.data() + dense_count_ * held_.size();
  for (std::size_t c = 0; c < held_.size(); ++c) {
    z[c] = root * held_[c];
    cross_[c] -= share * held_[c];
  }
  for (std::size_t k = 0; k < rows.active().size(); ++k) {
    const std::size_t c = rows.active()[k];
    z[c] -= root * rows.mean(k);
    cross_[c] += share * rows.mean(k);
  }
}

void joint_sum::sum_block(Eigen::MatrixXd* sum) {
  rows.take_off_mean(decay_.data(), block_squares_, used_);
  const std::vector<std::size_t>& active = rows.active();
  const std::size_t count = active.size();
  std::fill_n(product_.begin(), count * count, 0.0);
  best_products().add_outer_products(product_.data(), count, rows.row(0), used_, rows.stride(), 1.0);
  for (std::size_t c = 0; c < count; ++c) { /* on either side of the diagonal: to look which takes as long as to add */
    double* column = sum->col(static_cast<Eigen::Index>(active[c])).data();
    const double* product = product_.data() + c * count;
    for (std::size_t r = c; r < count; ++r) {
      column[active[r]] += product[r];
    }
  }
}

void joint_sum::end_block(Eigen::MatrixXd* sum) {
  if (used_ > 0) {
    sum_block(sum);
    pass_on();
    squares_ += kept_ * kept_ * block_squares_;
    if (++dense_count_ == dense_rows) {
      flush();
    }
  }
  for (double& value : held_) {
    value *= block_kept_;
  }
  for (std::size_t k = 0; k < rows.active().size(); ++k) {
    held_[rows.active()[k]] += rows.held(k);
  }
  kept_ *= block_kept_;
  rows.clear();
  used_ = 0;
  block_kept_ = 1.0;
  block_squares_ = 0.0;
  rows.add(residual, 0.0);
}

void joint_sum::flush() {
  best_products().add_outer_products(dense_sum_.data(), held_.size(), dense_.data(), dense_count_, held_.size(), 1.0);
  dense_count_ = 0;
}

joint_segment joint_sum::end_segment(Eigen::MatrixXd* sum) {
  flush();
  const auto columns = static_cast<Eigen::Index>(held_.size());
  for (Eigen::Index c = 0; c < columns; ++c) {
    (*sum)(c, c) += dense_sum_[static_cast<std::size_t>(c * columns + c)];
    for (Eigen::Index r = c + 1; r < columns; ++r) {
      (*sum)(r, c) += (*sum)(c, r) + dense_sum_[static_cast<std::size_t>(c * columns + r)];
      (*sum)(c, r) = 0.0;
    }
  }
  const auto copy = [](const std::vector<double>& values) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  return {copy(held_), copy(cross_), kept_, squares_};
}

}  // namespace tendonfmu::estimation
