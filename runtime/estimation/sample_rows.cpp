#include "sample_rows.h"

#include <algorithm>

#include "refusal.h"

namespace tendonfmu::estimation {

sample_rows::sample_rows(const unknown_list& unknowns, const tendonfmu_finger* finger, derivatives wanted)
    : unknowns_(unknowns),
      finger_(finger),
      memory_((parameter_derivative_size(finger) + sizeof(double) - 1) / sizeof(double)) {
  const bool exact = wanted == derivatives::exact;
  if (exact && finger->memory.elements > 0) {
    throw refused("friction with a memory (presliding): its derivative by the numbers is not known here");
  }
  for (std::uint32_t p = 0; exact && p < finger->shape.parameter_count; ++p) {
    if (unknowns.plain(p) >= 0 && parameter_item(&finger->shape, p).kind == ITEM_EXTENSION) {
      throw refused("extensions: the derivative by their numbers is not known here");
    }
  }
  parameter_derivative_place(finger, memory_.data(), &derivative_);
  terms_.reserve(6 * derivative_.places);
}

bool sample_rows::sees_event() const {
  const double* event = finger_->remembered.event;
  return std::any_of(event, event + finger_->slots, [](double each) { return each != 0.0; });
}

/* slopes by static, coulomb, 1/vs, viscous to those by coulomb, drop, 1/vs, viscous: static = coulomb + drop */
void sample_rows::add(const law_term& from, bool is_jump) {
  const side_columns& side = unknowns_.side(from.side);
  const double coulomb = from.slope[SIDE_COULOMB] + (side.static_follows ? from.slope[SIDE_STATIC] : 0.0);
  const std::size_t row = from.place * derivative_.joints;
  const double* jump = is_jump ? derivative_.bias_factor + row : derivative_.jump_factor + row;
  sensitivity_term term{side.column,
                        {coulomb, from.slope[SIDE_STATIC], from.slope[SIDE_RATE], from.slope[SIDE_VISCOUS]},
                        0,
                        0,
                        {},
                        &side,
                        from.speed,
                        is_jump ? nullptr : derivative_.torque_factor + row,
                        derivative_.has_jump ? jump : nullptr,
                        from.place};
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

void sample_rows::read() {
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
      plain_.push_back({unknowns_.plain(term.parameter), term.joint, term.slope});
    }
  }
}

void sample_rows::dense(double* torque_rows, double* jump_rows) const {
  for (double* rows : {torque_rows, jump_rows}) {
    if (rows) {
      std::fill_n(rows, joints() * unknowns_.count(), 0.0);
    }
  }
  add_dense(torque_rows, jump_rows, 1.0);
}

void sample_rows::add_dense(double* torque_rows, double* jump_rows, double share) const {
  const std::size_t n = joints(), p = unknowns_.count();
  for (const sensitivity_term& term : terms_) {
    for (std::size_t k = 0; k < 4; ++k) {
      if (term.column[k] < 0) {
        continue;
      }
      for (std::size_t j = 0; j < n; ++j) {
        const std::size_t at = j * p + static_cast<std::size_t>(term.column[k]);
        if (torque_rows && term.torque) {
          torque_rows[at] += share * term.slope[k] * term.torque[j];
        }
        if (jump_rows && term.jump) {
          jump_rows[at] += share * term.slope[k] * term.jump[j];
        }
      }
    }
  }
  for (const plain_slope& term : plain_) {
    if (torque_rows) {
      torque_rows[term.joint * p + static_cast<std::size_t>(term.column)] += share * term.slope;
    }
  }
}

segment_states states_with(const recording_track& recording, free_finger* finger, const std::vector<double>& numbers) {
  segment_states states;
  finger->begin(numbers, recording.kinematics_source());
  for (std::size_t k = 0; states.size() < recording.segments(); ++k) {
    if (k % recording.segment_length() == 0) {
      states.push_back(finger->save());
    }
    finger->step(k, recording.time(k), recording.inputs(k));
  }
  return states;
}

}  // namespace tendonfmu::estimation
