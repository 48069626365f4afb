/* One joint's sums over samples: Σ ν νᵀ of filtered rows with the bias eliminated, see information.h. */
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace tendonfmu::estimation {

constexpr std::size_t block_length = 128; /* samples whose rows are summed at a time */

/* The filtered rows of a block, kept to the columns that appear in it. */
class block_rows {
 public:
  explicit block_rows(std::size_t columns);

  /* to this sample's row, or to what the bias holds */
  enum part { sample, bias };
  void add(part to, std::size_t column, double value) { now_[to][activate(column)] += value; }
  /* `count` columns from `first` on, which are always given together */
  void add_run(part to, std::size_t first, std::size_t count, const double* values, double factor) {
    double* sum = now_[to].data() + activate_run(first, count);
    for (std::size_t k = 0; k < count; ++k) {
      sum[k] += factor * values[k];
    }
  }

  /* ends the row of a sample: stores (row − held)·weight as row `at` of the block where weight > 0, and lets the bias
   * take its share */
  void filter(double gain, double weight, std::size_t at);

  /* mean = Σ decay_i·row_i / squares over `count` rows; takes decay_i·mean off each */
  void take_off_mean(const double* decay, double squares, std::size_t count);
  void clear();

  const std::vector<std::size_t>& active() const { return active_; }
  const double* row(std::size_t at) const { return rows_.data() + at * stride_; }
  std::size_t stride() const { return stride_; }
  double mean(std::size_t k) const { return mean_[static_cast<Eigen::Index>(k)]; } /* of the k-th active column */
  double held(std::size_t k) const { return now_[bias][k]; }

 private:
  std::size_t activate(std::size_t column) {
    if (local_[column] < 0) {
      const std::size_t at = active_.size();
      local_[column] = static_cast<std::int32_t>(at);
      active_.push_back(column);
      for (std::size_t i = 0; i < stored_; ++i) { /* the rows before have nothing in it */
        rows_[i * stride_ + at] = 0.0;
      }
    }
    return static_cast<std::size_t>(local_[column]);
  }
  std::size_t activate_run(std::size_t first, std::size_t count) {
    if (local_[first] < 0) {
      for (std::size_t k = 0; k < count; ++k) {
        activate(first + k);
      }
    }
    return static_cast<std::size_t>(local_[first]);
  }

  std::size_t stride_, stored_ = 0; /* rows of the block */
  std::vector<std::int32_t> local_; /* place of a column among the active ones, −1 */
  std::vector<std::size_t> active_;
  std::array<std::vector<double>, 2> now_; /* of sample and bias */
  std::vector<double> rows_;
  Eigen::VectorXd mean_;
};

/* What a segment of a recording adds up to for one joint, as if the bias held nothing at its start. */
struct joint_segment {
  Eigen::VectorXd held, cross;      /* [q_j] at the end; Σ c_i ν_i */
  double kept = 1.0, squares = 0.0; /* Π (1 − K), Σ c_i² */
};

class joint_sum {
 public:
  /* column 0 is the residual */
  explicit joint_sum(std::size_t columns);

  block_rows rows; /* they are given here, sample by sample */

  void filter(double gain, double weight);
  bool full() const { return used_ == block_length; } /* the block must be ended */
  void begin_segment();
  /* adds the rows of the block to sum [q × q], each product on one side of the diagonal or the other */
  void end_block(Eigen::MatrixXd* sum);
  /* leaves the sum in the lower triangle */
  joint_segment end_segment(Eigen::MatrixXd* sum);

 private:
  void sum_block(Eigen::MatrixXd* sum);
  void pass_on();
  void flush();

  /* of the segment: what the bias holds at the block's start, Σ c_i ν_i, Π (1 − K), Σ c_i² */
  Eigen::VectorXd held_, cross_;
  double kept_ = 1.0, squares_ = 0.0;
  /* of the block */
  std::array<double, block_length> decay_{}; /* c_i */
  std::size_t used_ = 0;
  double block_kept_ = 1.0, block_squares_ = 0.0;
  /* rows z of whole blocks, a column each, their sum in the lower triangle, and the product of a block's rows */
  Eigen::MatrixXd dense_, dense_sum_;
  Eigen::Index dense_count_ = 0;
  std::vector<double> product_;
};

}  // namespace tendonfmu::estimation
