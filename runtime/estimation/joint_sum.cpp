#include "joint_sum.h"

#include <algorithm>
#include <cmath>

#include "products.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index dense_rows = 32;    /* rows of whole blocks summed at a time */
constexpr std::size_t residual = 0; /* its column */

}  // namespace

block_rows::block_rows(std::size_t columns)
    : stride_((columns + 7) / 8 * 8 + 8), /* no power of two: rows do not fall onto each other in the cache */
      local_(columns, -1),
      now_{std::vector<double>(stride_), std::vector<double>(stride_)},
      rows_(block_length * stride_),
      mean_(stride_) {
  active_.reserve(columns);
}

void block_rows::filter(double gain, double weight, std::size_t at) {
  const std::size_t count = active_.size();
  double *now = now_[sample].data(), *held = now_[bias].data();
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
  const auto columns = static_cast<Index>(active_.size()), stride = static_cast<Index>(stride_);
  mean_.head(columns).setZero();
  if (squares > 0.0) { /* else the bias has begun in this block: nothing from before it counts */
    const Eigen::Map<const VectorXd> c(decay, static_cast<Index>(count));
    Eigen::Map<MatrixXd, 0, Eigen::OuterStride<>> rows(rows_.data(), columns, c.size(), Eigen::OuterStride<>(stride));
    mean_.head(columns).noalias() = rows * c / squares;
    rows.noalias() -= mean_.head(columns) * c.transpose();
  }
}

void block_rows::clear() {
  for (std::vector<double>& sum : now_) {
    std::fill_n(sum.begin(), active_.size(), 0.0);
  }
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
      dense_(columns, dense_rows),
      dense_sum_(columns, columns),
      product_(rows.stride() * rows.stride()) {
  begin_segment();
}

void joint_sum::begin_segment() {
  held_.setZero();
  cross_.setZero();
  dense_sum_.setZero();
  kept_ = block_kept_ = 1.0;
  squares_ = block_squares_ = 0.0;
  rows.clear();
  used_ = 0;
  dense_count_ = 0;
  rows.add(block_rows::sample, residual, 0.0); /* always the first of the active ones */
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
  auto z = dense_.col(dense_count_);
  z = root * held_;
  cross_ -= share * held_;
  for (std::size_t k = 0; k < rows.active().size(); ++k) {
    const auto c = static_cast<Index>(rows.active()[k]);
    z[c] -= root * rows.mean(k);
    cross_[c] += share * rows.mean(k);
  }
}

void joint_sum::sum_block(MatrixXd* sum) {
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

void joint_sum::end_block(MatrixXd* sum) {
  if (used_ > 0) {
    sum_block(sum);
    pass_on();
    squares_ += kept_ * kept_ * block_squares_;
    if (++dense_count_ == dense_rows) {
      flush();
    }
  }
  held_ *= block_kept_;
  for (std::size_t k = 0; k < rows.active().size(); ++k) {
    held_[static_cast<Index>(rows.active()[k])] += rows.held(k);
  }
  kept_ *= block_kept_;
  rows.clear();
  used_ = 0;
  block_kept_ = 1.0;
  block_squares_ = 0.0;
  rows.add(block_rows::sample, residual, 0.0);
}

void joint_sum::flush() {
  const auto columns = static_cast<std::size_t>(held_.size());
  best_products().add_outer_products(dense_sum_.data(), columns, dense_.data(), static_cast<std::size_t>(dense_count_),
                                     columns, 1.0);
  dense_count_ = 0;
}

joint_segment joint_sum::end_segment(MatrixXd* sum) {
  flush();
  auto all = sum->topLeftCorner(held_.size(), held_.size());
  dense_sum_.triangularView<Eigen::Lower>() += all;
  dense_sum_.triangularView<Eigen::StrictlyLower>() += all.transpose();
  all = dense_sum_.triangularView<Eigen::Lower>();
  return {held_, cross_, kept_, squares_};
}

}  // namespace tendonfmu::estimation
