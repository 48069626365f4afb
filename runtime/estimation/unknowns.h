/* What is estimated: unknowns, each one column, made of the numbers of the description.
 *
 * A side of a law becomes coulomb Fc, drop Fs − Fc, rate 1/vs and viscous Fv: every bound is then a box (Fs >= Fc >= 0,
 * vs > vs_min), and 1/vs has no singularity (paper VII). Covers, extensions and the initial bias are taken as they are.
 */
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core_inside.h"

namespace tendonfmu::estimation {

enum class unknown_role { coulomb, drop, rate, viscous, value };

/* One unknown. */
struct unknown_item {
  unknown_role role;
  std::vector<std::uint32_t>
      parameters; /* that it moves: of a drop the statics; of a tied coulomb its static follows */
  double start, lower, upper;
  double scale;        /* expected magnitude: of the prior, and what makes the columns comparable */
  std::size_t joint;   /* the first that it turns, 0-based: it turns none before */
  std::string path;    /* of its first parameter */
  bool curved = false; /* the model is far from linear in it */
};

/* Columns of one side of a law: −1 where a number is fixed. */
struct side_columns {
  std::array<std::int32_t, 4> column; /* coulomb, drop, rate, viscous */
  bool static_follows;                /* the static friction moves with the coulomb friction */
  std::size_t run_first, run_length;  /* the columns as a run; length 0 unless they belong to this side alone */
  std::int32_t index;                 /* among the sides with a rate to estimate, −1 */
};

class unknown_list {
 public:
  /* group [parameter_count]: −1 fixed, equal numbers share one value; nullptr: all that the structure has.
   * scale [parameter_count]: expected magnitudes in the description's numbers, NaN or nullptr: from the start. Throws
   * refused with one line. */
  unknown_list(const tendonfmu_finger* finger, const std::int32_t* group, const double* scale);

  std::size_t count() const { return list_.size(); }
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
