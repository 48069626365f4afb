/* What is estimated: unknowns, each one column, made of the numbers of the description. */
#pragma once

#include <array>

#include "core_inside.h"
#include "tendonfmu_estimation.hpp"

namespace tendonfmu::estimation {

/* Throws std::invalid_argument: "<name>: expected <expected> <what>". */
void expect_length(std::size_t length, std::size_t expected, const char* name, const char* what);

/* Columns of one side of a law: −1 where a number is fixed. */
struct side_columns {
  std::array<std::int32_t, 4> column; /* coulomb, drop, rate, viscous */
  bool static_follows;                /* the static friction moves with the coulomb friction */
  std::size_t run_first, run_length;  /* the columns as a run; length 0 unless they belong to this side alone */
  std::int32_t index;                 /* among the sides with a rate to estimate, −1 */
};

class unknown_list {
 public:
  /* group, scale: as for an estimator. Throws std::invalid_argument. */
  unknown_list(const tendonfmu_finger* finger, const std::vector<std::int32_t>& group, const numbers& scale);

  std::size_t count() const { return list_.size(); }
  const std::vector<unknown_item>& items() const { return list_; }
  /* of the sides with a rate to estimate: columns of rate and drop (−1) */
  const std::vector<std::array<std::int32_t, 2>>& rates() const { return rates_; }
  /* static − coulomb of the k-th of them where it is fixed */
  double fixed_drop(std::size_t k) const { return fixed_drops_[k]; }
  const unknown_item& operator[](std::size_t column) const { return list_[column]; }

  /* unknowns [count] of the description's numbers [parameter_count] */
  std::vector<double> read(const double* parameters) const;
  /* the description's numbers for unknowns within their bounds; what is fixed is as in the image */
  std::vector<double> write(const double* unknowns) const;
  /* the same into numbers [parameter_count], without allocating */
  void write(const double* unknowns, double* numbers) const;

  const side_columns& side(std::uint32_t static_parameter) const { return sides_[static_parameter]; }
  /* column of a parameter that enters as it is, −1 where fixed */
  std::int32_t plain(std::uint32_t parameter) const { return plain_[parameter]; }
  /* column of bias.initial_torque[j], −1 */
  std::int32_t initial_torque(std::size_t joint) const {
    return initial_first_ < 0 ? -1 : plain_[static_cast<std::size_t>(initial_first_) + joint];
  }

 private:
  void find_run(std::uint32_t first);

  std::vector<unknown_item> list_;
  std::vector<side_columns> sides_;
  std::vector<std::array<std::int32_t, 2>> rates_;
  std::vector<double> fixed_drops_;
  std::vector<std::int32_t> plain_;
  std::vector<double> start_;
  std::int64_t initial_first_ = -1;
};

}  // namespace tendonfmu::estimation
