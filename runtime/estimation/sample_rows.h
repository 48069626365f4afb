/* The sensitivities of one sample: ∂T_j and ∂Δb_j by every unknown, as the core gives them. */
#ifndef TENDONFMU_ESTIMATION_SAMPLE_ROWS_H
#define TENDONFMU_ESTIMATION_SAMPLE_ROWS_H

#include <vector>

#include "unknowns.h"

extern "C" {
#include "parameter_derivative.h"
}

namespace tendonfmu::estimation {

/* One friction value, or one jump, as the unknowns move it: row j has slope[k]·factor[j] in column[k] (−1: none). */
struct Term {
  std::array<std::int32_t, 4> column;
  std::array<double, 4> slope;
  /* the same as a run of columns that belong to this law alone; length 0 where some are shared */
  std::size_t run_first, run_length;
  std::array<double, 4> run_slope;
  const SideColumns* side;
  double speed; /* m/s or rad/s: ∂²/∂rate² = −speed·slope by rate, ∂²/∂rate∂drop = −speed·slope by drop */
  const double* torque; /* [n] ∂T_j; nullptr: a jump's own */
  const double* jump;   /* [n] ∂Δb_j; nullptr: no jump at this sample */
};

/* A number that enters a joint's torque as it is. */
struct PlainTerm {
  std::int32_t column;
  std::size_t joint;
  double slope, jump;
};

class SampleRows {
 public:
  /* both must outlive the rows */
  SampleRows(const Unknowns& unknowns, const tendonfmu_finger* finger);

  /* the sample that the finger last took, by a step */
  void read();

  std::size_t joints() const { return derivative_.joints; }
  double torque(std::size_t joint) const { return finger_->scratch.friction[joint]; }    /* T_j of eq. (10), N·m */
  double jump(std::size_t joint) const { return finger_->scratch.bias_step[joint]; }     /* Δb_j, N·m */
  double measured(std::size_t joint) const { return finger_->remembered.torque[joint]; } /* τ_j, N·m */
  bool has_jump() const { return derivative_.has_jump != 0; }
  const std::vector<Term>& terms() const { return terms_; }
  const std::vector<PlainTerm>& plain_terms() const { return plain_; }

  /* ∂T_j/∂z and ∂Δb_j/∂z: [joints × unknowns], rows; jump_rows may be nullptr */
  void dense(double* torque_rows, double* jump_rows) const;

 private:
  void add(const law_term& from, bool is_jump);

  const Unknowns& unknowns_;
  const tendonfmu_finger* finger_;
  std::vector<double> memory_;
  parameter_derivative derivative_;
  std::vector<Term> terms_;
  std::vector<PlainTerm> plain_;
};

}  // namespace tendonfmu::estimation

#endif
