/* The sensitivities of one sample: ∂T_j and ∂Δb_j by every unknown, as the core gives them. */
#pragma once

#include <algorithm>
#include <vector>

#include "recording_track.h"
#include "unknowns.h"

namespace tendonfmu::estimation {

/* One friction value, or one jump, as the unknowns move it: row j has slope[k]·factor[j] in column[k] (−1: none). */
struct sensitivity_term {
  std::array<std::int32_t, 4> column;
  std::array<double, 4> slope;
  /* the same as a run of columns that belong to this law alone; length 0 where some are shared */
  std::size_t run_first, run_length;
  std::array<double, 4> run_slope;
  const side_columns* side;
  double speed; /* m/s or rad/s: ∂²/∂rate² = −speed·slope by rate, ∂²/∂rate∂drop = −speed·slope by drop */
  const double* torque; /* [n] ∂T_j; nullptr: a jump's own */
  const double* jump;   /* [n] ∂Δb_j; nullptr: no jump at this sample */
  std::size_t place;    /* parameter_derivative.h */
};

/* A number that enters a joint's torque as it is. */
struct plain_slope {
  std::int32_t column;
  std::size_t joint;
  double slope;
};

/* Whether derivatives that are not exact will do: those of friction with a memory (parameter_derivative.h), and none
 * by numbers of extensions. Else a finger that has them is refused. */
enum class derivatives { exact, nearly };

class sample_rows {
 public:
  /* both must outlive the rows */
  sample_rows(const unknown_list& unknowns, const tendonfmu_finger* finger, derivatives wanted = derivatives::exact);

  /* the sample that the finger last took, by a step */
  void read();
  bool sees_event() const;

  std::size_t joints() const { return derivative_.joints; }
  double torque(std::size_t joint) const { return finger_->scratch.friction[joint]; }    /* T_j of eq. (10), N·m */
  double jump(std::size_t joint) const { return finger_->scratch.bias_step[joint]; }     /* Δb_j, N·m */
  double measured(std::size_t joint) const { return finger_->remembered.torque[joint]; } /* τ_j, N·m */
  bool has_jump() const { return derivative_.has_jump != 0; }
  const std::vector<sensitivity_term>& terms() const { return terms_; }
  const std::vector<plain_slope>& plain_terms() const { return plain_; }

  /* ∂T_j/∂z and ∂Δb_j/∂z: [joints × unknowns], rows; jump_rows may be nullptr */
  void dense(double* torque_rows, double* jump_rows) const;
  /* adds a share of them; either may be nullptr */
  void add_dense(double* torque_rows, double* jump_rows, double share) const;

 private:
  void add(const law_term& from, bool is_jump);

  const unknown_list& unknowns_;
  const tendonfmu_finger* finger_;
  std::vector<double> memory_;
  parameter_derivative derivative_;
  std::vector<sensitivity_term> terms_;
  std::vector<plain_slope> plain_;
};

/* The beginnings of a recording's segments with other numbers of the description than those it was added with. */
segment_states states_with(const recording_track& recording, free_finger* finger, const std::vector<double>& numbers);

}  // namespace tendonfmu::estimation
