#include "sample_rows.h"

#include <algorithm>

#include "refusal.h"

namespace tendonfmu::estimation {

sample_rows::sample_rows(const unknown_list& unknowns, const tendonfmu_finger* finger)
    : unknowns_(unknowns),
      finger_(finger),
      memory_((parameter_derivative_size(finger) + sizeof(double) - 1) / sizeof(double)) {
  if (finger->memory.elements > 0) {
    throw refused("friction with a memory (presliding): its derivative by the numbers is not known here");
  }
  for (std::uint32_t p = 0; p < finger->shape.parameter_count; ++p) {
    if (unknowns.plain(p) >= 0 && parameter_item(&finger->shape, p).kind == ITEM_EXTENSION) {
      throw refused("extensions: the derivative by their numbers is not known here");
    }
  }
  parameter_derivative_place(finger, memory_.data(), &derivative_);
  terms_.reserve(6 * derivative_.places);
  if (finger->derived.settings.remembers_entry_load) {
    entries_.assign(derivative_.places * unknowns.count(), 0.0);
  }
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
      plain_.push_back({unknowns_.plain(term.parameter), term.joint, term.slope, 0.0});
    }
  }
  if (!entries_.empty() && derivative_.has_jump) {
    leave_rest();
    come_to_rest();
  }
}

/* −κ·e of every place that leaves rest, at all joints that it turns */
void sample_rows::leave_rest() {
  const std::size_t n = joints(), ends = 2 * n * derivative_.tendons;
  for (std::size_t place = 0; place < derivative_.places; ++place) {
    const double kept = derivative_.left_share[place];
    const double* slopes = entry(place);
    for (std::size_t c = 0; kept != 0.0 && c < unknowns_.count(); ++c) {
      for (std::size_t j = 0; slopes[c] != 0.0 && j < n; ++j) {
        double arm = place >= ends && (place - ends) / 2 == j ? 1.0 : 0.0;
        if (place < ends && j >= place % (2 * n) / 2) {
          arm = finger_->derived.moment_arm[j * finger_->tendon_lanes + place / (2 * n)];
        }
        if (arm != 0.0) {
          plain_.push_back({static_cast<std::int32_t>(c), j, 0.0, -kept * arm * slopes[c]});
        }
      }
    }
  }
}

/* ∂(acting·b) of every place that comes to rest: its own b, and what the friction before it makes of what acts */
void sample_rows::come_to_rest() {
  const std::size_t n = joints(), ends = 2 * n * derivative_.tendons;
  for (std::size_t place = 0; place < derivative_.places; ++place) {
    const double jump = derivative_.stop_jump[place];
    if (jump == 0.0) {
      continue;
    }
    double* slopes = entry(place);
    std::fill_n(slopes, unknowns_.count(), 0.0);
    add_slopes(place, true, derivative_.acting[place], slopes);
    if (place < ends) {
      for (std::size_t k = 0; k < place % (2 * n); ++k) {
        add_slopes(place - place % (2 * n) + k, false, jump * derivative_.acting_factor[place * 2 * n + k], slopes);
      }
    } else if ((place - ends) % 2 == 1) { /* T_jvf·Σ f_B */
      for (std::size_t other = 0; other < ends; ++other) {
        add_slopes(other, false, jump * derivative_.load_factor[other * n + (place - ends) / 2], slopes);
      }
    }
  }
}

/* factor·∂F, or ∂b, of a place */
void sample_rows::add_slopes(std::size_t place, bool is_jump, double factor, double* entry) const {
  if (factor == 0.0) {
    return;
  }
  for (const sensitivity_term& term : terms_) {
    if (term.place == place && (term.torque == nullptr) == is_jump) {
      for (std::size_t k = 0; k < 4; ++k) {
        if (term.column[k] >= 0) {
          entry[term.column[k]] += factor * term.slope[k];
        }
      }
    }
  }
}

void sample_rows::dense(double* torque_rows, double* jump_rows) const {
  const std::size_t n = joints(), p = unknowns_.count();
  std::fill_n(torque_rows, n * p, 0.0);
  if (jump_rows) {
    std::fill_n(jump_rows, n * p, 0.0);
  }
  for (const sensitivity_term& term : terms_) {
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
  for (const plain_slope& term : plain_) {
    const std::size_t at = term.joint * p + static_cast<std::size_t>(term.column);
    torque_rows[at] += term.slope;
    if (jump_rows) {
      jump_rows[at] += term.jump;
    }
  }
}

segment_states states_with(const recording_track& recording, free_finger* finger, sample_rows* rows,
                           const std::vector<double>& numbers) {
  segment_states states;
  finger->begin(numbers, recording.kinematics_source());
  rows->forget();
  for (std::size_t k = 0; states.size() < recording.segments(); ++k) {
    if (k % recording.segment_length() == 0) {
      states.push_back({finger->save(), rows->entries()});
    }
    finger->step(k, recording.time(k), recording.inputs(k));
    rows->follow();
  }
  return states;
}

}  // namespace tendonfmu::estimation
