#include "sample_rows.h"

#include <algorithm>

namespace tendonfmu::estimation {

SampleRows::SampleRows(const Unknowns& unknowns, const tendonfmu_finger* finger)
    : unknowns_(unknowns),
      finger_(finger),
      memory_((parameter_derivative_size(finger) + sizeof(double) - 1) / sizeof(double)) {
  parameter_derivative_place(finger, memory_.data(), &derivative_);
  terms_.reserve(6 * derivative_.places);
}

/* slopes by static, coulomb, 1/vs, viscous to those by coulomb, drop, 1/vs, viscous: static = coulomb + drop */
void SampleRows::add(const law_term& from, bool is_jump) {
  const SideColumns& side = unknowns_.side(from.side);
  const double coulomb = from.slope[SIDE_COULOMB] + (side.static_follows ? from.slope[SIDE_STATIC] : 0.0);
  const std::size_t row = from.place * derivative_.joints;
  const double* jump = is_jump ? derivative_.bias_factor + row : derivative_.jump_factor + row;
  Term term{side.column,
            {coulomb, from.slope[SIDE_STATIC], from.slope[SIDE_RATE], from.slope[SIDE_VISCOUS]},
            0,
            0,
            {},
            &side,
            from.speed,
            is_jump ? nullptr : derivative_.torque_factor + row,
            derivative_.has_jump ? jump : nullptr};
  if (side.run_length > 0) {
    term.run_first = side.run_first;
    term.run_length = side.run_length;
    for (std::size_t k = 0; k < 4; ++k) {
      if (side.column[k] >= 0) {
        term.run_slope[static_cast<std::size_t>(side.column[k]) - side.run_first] = term.slope[k];
      }
    }
  }
  terms_.push_back(term);
}

void SampleRows::read() {
  parameter_derivative_read(finger_, &derivative_);
  terms_.clear();
  plain_.clear();
  for (std::size_t k = 0; k < derivative_.friction_count; ++k) {
    add(derivative_.friction[k], false);
  }
  for (std::size_t k = 0; k < derivative_.bias_count; ++k) {
    add(derivative_.bias[k], true);
  }
  for (std::size_t k = 0; k < derivative_.plain_count; ++k) {
    const plain_term& term = derivative_.plain[k];
    if (unknowns_.plain(term.parameter) >= 0) {
      plain_.push_back({unknowns_.plain(term.parameter), term.joint, term.slope, term.jump});
    }
  }
}

void SampleRows::dense(double* torque_rows, double* jump_rows) const {
  const std::size_t n = joints(), p = unknowns_.count();
  std::fill_n(torque_rows, n * p, 0.0);
  if (jump_rows) {
    std::fill_n(jump_rows, n * p, 0.0);
  }
  for (const Term& term : terms_) {
    for (std::size_t k = 0; k < 4; ++k) {
      if (term.column[k] < 0) {
        continue;
      }
      for (std::size_t j = 0; j < n; ++j) {
        const std::size_t at = j * p + static_cast<std::size_t>(term.column[k]);
        if (term.torque) {
          torque_rows[at] += term.slope[k] * term.torque[j];
        }
        if (jump_rows && term.jump) {
          jump_rows[at] += term.slope[k] * term.jump[j];
        }
      }
    }
  }
  for (const PlainTerm& term : plain_) {
    const std::size_t at = term.joint * p + static_cast<std::size_t>(term.column);
    torque_rows[at] += term.slope;
    if (jump_rows) {
      jump_rows[at] += term.jump;
    }
  }
}

}  // namespace tendonfmu::estimation
