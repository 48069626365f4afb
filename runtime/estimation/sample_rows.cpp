#include "sample_rows.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace tendonfmu::estimation {

/* --- where the laws stand ----------------------------------------------------------------------------------------- */

placed_laws::placed_laws(const unknown_list& unknowns, const tendonfmu_finger* finger)
    : edge(2 + finger->shape.edge_law_count + 2 * std::size_t{finger->shape.edge_count}),
      pulley(finger->joints * finger->tendon_lanes),
      joint(finger->joint_lanes),
      load(finger->joint_lanes) {
  std::uint32_t next_record = 2; /* as derived_numbers.c counts them */
  std::uint32_t angles = 1;      /* working points of the edge being read */
  visit_items(finger->shape, [&](const model_item& item) {
    const auto sides = [&]() -> law_sides {
      return {&unknowns.side(item.first), &unknowns.side(item.first + (item.law == LAW_ASYMMETRIC ? 4 : 0))};
    };
    switch (item.kind) {
      case ITEM_JOINT_FRICTION: joint[item.joint] = sides(); break;
      case ITEM_LOAD_FRICTION: load[item.joint] = sides(); break;
      case ITEM_PULLEY_FRICTION: pulley[(item.joint + 1) * finger->tendon_lanes + item.tendon] = sides(); break;
      case ITEM_EDGE_ANGLES: angles = item.count; break;
      case ITEM_EDGE_FRICTION: { /* an edge with K laws has K + 2 records: L1 L1 L2 … LK LK */
        const std::uint32_t points = item.has_angles ? angles : 1;
        edge[next_record + item.point + 1] = sides();
        if (item.point == 0) {
          edge[next_record] = sides();
        }
        if (item.point + 1 == points) {
          edge[next_record + points + 1] = sides();
          next_record += points + 2;
        }
        break;
      }
      case ITEM_COVER:
        covers.push_back({item.joint, unknowns.plain(item.first), unknowns.plain(item.first + 1)});
        break;
      default: break;
    }
  });
}

/* --- what a sample says ------------------------------------------------------------------------------------------- */

constexpr double nearly_slips = 1.0 - 1e-9; /* of a limit: rounding */

sample_rows::sample_rows(const unknown_list& unknowns, const tendonfmu_finger* finger, derivatives wanted)
    : finger_(finger),
      laws_(unknowns, finger),
      joints_(finger->joints),
      places_(2 * joints_ * (finger->tendons + 1)),
      unknowns_(unknowns.count()),
      torque_factor_(places_ * joints_),
      jump_factor_(places_ * joints_),
      bias_factor_(places_ * joints_),
      moved_(2 * joints_),
      jumped_(2 * joints_),
      acting_(2 * joints_),
      by_force_(2 * joints_),
      by_limit_(elements_of(finger) * places_) {
  const bool exact = wanted == derivatives::exact;
  if (exact && elements_of(finger) > 0) {
    throw std::invalid_argument("friction with a memory (presliding): its derivative by the numbers is not known here");
  }
  for (std::uint32_t p = 0; exact && p < finger->shape.parameter_count; ++p) {
    if (unknowns.plain(p) >= 0 && parameter_item(&finger->shape, p).kind == ITEM_EXTENSION) {
      throw std::invalid_argument("extensions: the derivative by their numbers is not known here");
    }
  }
  terms_.reserve(6 * places_);
  plain_.reserve(2 * laws_.covers.size());
}

bool sample_rows::sees_event() const {
  const double* event = finger_->remembered.event;
  return std::any_of(event, event + finger_->slots, [](double each) { return each != 0.0; });
}

/* --- what F and b depend on --------------------------------------------------------------------------------------- */

/* whether the friction of a slot remembers (docs/reference/semantics/presliding.md) */
bool sample_rows::remembers(std::size_t slot) const {
  return elements_of(finger_) > 0 && finger_->memory.remembers[slot] != 0.0;
}

/* what friction rows make of a slot */
double sample_rows::grip(const double* grips, std::size_t slot) const {
  return finger_->extensions.frictions > 0 ? grips[slot] : 1.0;
}

sample_rows::friction_place sample_rows::edge_at(std::size_t tendon, std::size_t joint) const {
  const std::size_t slot = joint * finger_->tendon_lanes + tendon;
  const double angle = joint ? finger_->remembered.angle[joint - 1] : 0.0;
  const derived_numbers& d = finger_->derived;
  const std::size_t record = d.edge_record[slot] + slot_segment(finger_, joint, tendon, angle);
  const double* segment = d.edge_segment + 2 * record;
  return {2 * (tendon * joints_ + joint),
          slot,
          d.settings.tendon_threshold,
          d.edge_law + record * LAW_NUMBERS,
          &laws_.edge[record],
          (angle - segment[0]) * segment[1]};
}

sample_rows::magnitude sample_rows::magnitude_at(const friction_place& p, bool negative, double speed) {
  magnitude m{};
  m.speed = speed;
  m.weight = p.weight;
  for (std::size_t above = 0; above <= (p.weight != 0.0 ? 1 : 0); ++above) {
    const double* law = p.law + above * LAW_NUMBERS + (negative ? LAW_SIDE_NUMBERS : 0);
    m.side[above] = p.sides[above][negative];
    m.at[above] = law_with_slopes(law, speed);
    m.drop[above] = law[LAW_DROP];
  }
  m.value = p.weight != 0.0 ? m.at[0].value + p.weight * (m.at[1].value - m.at[0].value) : m.at[0].value;
  return m;
}

sample_rows::magnitude sample_rows::present_magnitude(const friction_place& p) const {
  const double velocity = finger_->scratch.velocity[p.slot];
  return magnitude_at(p, velocity < 0.0, std::fabs(velocity));
}

/* F = Fc + drop·E + Fv·v, E = exp(−v·rate): slopes by what is estimated of one side, times a factor */
void sample_rows::add_side(const magnitude& m, int above, double factor, const friction_place& p, bool own_jump) {
  const side_columns& side = *m.side[above];
  const double decay = m.at[above].decay, coulomb = side.static_follows ? 1.0 : 1.0 - decay;
  const std::size_t row = p.place * joints_;
  const double* jump = (own_jump ? bias_factor_ : jump_factor_).data() + row;
  sensitivity_term term{&side,
                        {factor * coulomb, factor * decay, -factor * m.speed * m.drop[above] * decay, factor * m.speed},
                        {},
                        m.speed,
                        own_jump ? nullptr : torque_factor_.data() + row,
                        has_jump_ ? jump : nullptr};
  for (std::size_t k = 0; side.run_length > 0 && k < 4; ++k) {
    if (side.column[k] >= 0) {
      term.run_slope[static_cast<std::size_t>(side.column[k]) - side.run_first] = term.slope[k];
    }
  }
  terms_.push_back(term);
}

/* the slopes of factor·|F| */
void sample_rows::add_terms(const magnitude& m, double factor, const friction_place& p, bool own_jump) {
  if (m.weight != 0.0) {
    add_side(m, 1, factor * m.weight, p, own_jump);
    factor *= 1.0 - m.weight;
  }
  add_side(m, 0, factor, p, own_jump);
}

/* slope of what a slot's elements hold by its limit: what slips has its sign, and what is free keeps what it had; in
 * the relative form all that is held is in proportion to the limit */
double sample_rows::slope_by_limit(const friction_place& p, double limit) {
  const friction_memory& memory = finger_->memory;
  const bool tendon = p.place < 2 * joints_ * finger_->tendons;
  double slope = 0.0;
  for (std::size_t e = 0; e < elements_of(finger_); ++e) {
    const friction_element& element = memory.element[e];
    const std::size_t row = 2 * e + (tendon ? p.place % 2 : 0); /* edges, pulleys */
    const double held = finger_->remembered.element[row * finger_->slots + p.slot];
    const double most = element.share[p.slot] * limit;
    double& own = by_limit_[e * places_ + p.place];
    if (std::fabs(held) >= nearly_slips * most) {
      own = most > 0.0 ? (held < 0.0 ? -1.0 : 1.0) : 0.0;
    } else if (element.stiffness[p.slot] == 0.0) {
      own = held / most;
    } else {
      const double yield =
          tendon && memory.stretch > 0.0 ? element.stiff[p.slot] * memory.sections[p.slot] * memory.stretch : 0.0;
      own *= (element.kept[p.slot] + yield) / (1.0 + yield);
    }
    slope += element.share[p.slot] * own;
  }
  return slope;
}

/* F of an edge or a pulley where the acting force is known: 0 where it sticks; by its laws, if it remembers */
double sample_rows::read_friction(const friction_place& p, double acting) {
  const bool held = remembers(p.slot);
  if (finger_->remembered.moving[p.slot] == 0.0 && !held) {
    return 0.0;
  }
  const magnitude m = present_magnitude(p);
  const double gripped = grip(finger_->scratch.grip, p.slot), most = gripped * m.value;
  const double sign = finger_->scratch.velocity[p.slot] < 0.0 ? -1.0 : 1.0;
  const double share = held ? slope_by_limit(p, acting * most) : sign;
  add_terms(m, share * gripped, p, false);
  return share * most;
}

/* b of fig. 5: |F| at v_min where a place comes to rest, and where it leaves rest that of the side now, and what was
 * not forgotten of the side before */
double sample_rows::read_jump(const friction_place& p) {
  const finger_state& s = finger_->remembered;
  const double before = side_before(finger_, p.slot), now = s.side[p.slot], event = s.event[p.slot];
  const double gripped = grip(finger_->scratch.bias_grip, p.slot);
  if (event == 0.0 || gripped == 0.0 || remembers(p.slot) || (event > 0.0 && before == 0.0)) {
    return 0.0;
  }
  double jump = 0.0;
  const auto add = [&](double side, double share) {
    const magnitude m = magnitude_at(p, side < 0.0, p.threshold);
    add_terms(m, gripped * share * side, p, true);
    jump += gripped * share * side * m.value;
  };
  if (event > 0.0) {
    add(before, 1.0);
    return jump;
  }
  const double kept =
      before == 0.0 ? 0.0 : law_exponential(rest_exponent(finger_, p.slot, s.scalar[STATE_ABSORBED_BEFORE]));
  add(now, kept - 1.0);
  if (kept != 0.0) {
    add(before, -kept);
  }
  return jump;
}

/* --- what F does to the torques ----------------------------------------------------------------------------------- */

/* the forces along one tendon, from what it lost at each place */
void sample_rows::follow_forces(std::size_t tendon) {
  const finger_scratch& s = finger_->scratch;
  const bool bidirectional = finger_->derived.bidirectional[tendon] != 0.0;
  const std::size_t lanes = finger_->tendon_lanes, slots = finger_->slots;
  double force = finger_->remembered.force[tendon];
  for (std::size_t k = 0; k < 2 * joints_; ++k) {
    const std::size_t pulley = k % 2, at = k / 2 * lanes + tendon, slot = at + pulley * lanes;
    acting_[k] = (pulley ? s.force_between : s.force_at)[at];
    by_force_[k] = !bidirectional ? (acting_[k] > 0.0 ? 1.0 : 0.0) : force < 0.0 ? -1.0 : 1.0;
    if (k + 1 == 2 * joints_) {
      break; /* no pulley behind the last edge */
    }
    double lost = acting_[k] * (pulley ? s.pulley : s.edge)[slot];
    if (remembers(slot)) {
      lost = 0.0;
      for (std::size_t e = 0; e < elements_of(finger_); ++e) {
        lost += finger_->remembered.element[(2 * e + pulley) * slots + slot];
      }
    }
    force -= lost;
  }
}

/* factors of place k of a tendon: a change of F there, and what it does to forces, losses and jumps behind it */
void sample_rows::follow_change(std::size_t tendon, std::size_t k) {
  const finger_scratch& s = finger_->scratch;
  const std::size_t row = (2 * tendon * joints_ + k) * joints_;
  double *torque = &torque_factor_[row], *jump = &jump_factor_[row], *bias = &bias_factor_[row];
  double force = -acting_[k], lost = acting_[k], jumped = 0.0;
  std::fill_n(torque, k / 2 + 1, 0.0);
  std::fill_n(jump, k / 2 + 1, 0.0);
  std::fill_n(bias, k / 2 + 1, 0.0);
  for (std::size_t next = k + 1; next <= 2 * joints_; ++next) {
    if (next % 2 == 0) { /* past the pulley of joint j */
      const std::size_t j = next / 2 - 1;
      const double arm = finger_->derived.moment_arm[j * finger_->tendon_lanes + tendon];
      torque[j] += arm * lost;
      jump[j] += arm * jumped;
      bias[j] = arm * acting_[k];
    }
    if (next == 2 * joints_) {
      break;
    }
    const double acting = by_force_[next] * force;
    if (next % 2 == 1) { /* f_B of joint j, just past its edge */
      const std::size_t j = next / 2;
      torque[j] = s.load_friction[j] * acting;
      jump[j] = has_jump_ ? s.load_bias[j] * acting : 0.0;
    }
    jumped += acting * jumped_[next];
    lost += acting * moved_[next];
    force = by_force_[next] != 0.0 ? force - acting * moved_[next] : 0.0;
  }
}

void sample_rows::read_tendon(std::size_t tendon) {
  const finger_scratch& s = finger_->scratch;
  const derived_numbers& d = finger_->derived;
  std::array<bool, 2 * MODEL_MAX_JOINTS> present{};
  const auto read = [&](const friction_place& p, double acting) {
    const std::size_t k = p.place % (2 * joints_);
    present[k] = (*p.sides)[0] != nullptr;
    moved_[k] = present[k] ? read_friction(p, acting) : 0.0;
    jumped_[k] = present[k] ? read_jump(p) : 0.0;
  };
  for (std::size_t j = 0; j < joints_; ++j) {
    const friction_place edge = edge_at(tendon, j);
    const std::size_t behind = edge.slot + finger_->tendon_lanes;
    read(edge, s.force_at[edge.slot]);
    if (j + 1 < joints_) {
      read({edge.place + 1, behind, edge.threshold, d.pulley_law + behind * LAW_NUMBERS, &laws_.pulley[behind], 0.0},
           s.force_between[edge.slot]);
    }
  }
  follow_forces(tendon);
  for (std::size_t k = 0; k + 1 < 2 * joints_; ++k) {
    if (present[k]) {
      follow_change(tendon, k);
    }
  }
}

void sample_rows::read_joint(std::size_t joint) {
  const derived_numbers& d = finger_->derived;
  const std::size_t slot = joints_ * finger_->tendon_lanes + joint, first = 2 * joints_ * finger_->tendons + 2 * joint;
  const double threshold = d.settings.joint_threshold, factor[2] = {1.0, finger_->scratch.load[joint]};
  const friction_place place[2] = {
      {first, slot, threshold, d.joint_law + joint * LAW_NUMBERS, &laws_.joint[joint], 0.0},
      {first + 1, slot, threshold, d.load_law + joint * LAW_NUMBERS, &laws_.load[joint], 0.0}};
  const bool held = remembers(slot), acts = held || finger_->remembered.moving[slot] != 0.0;
  double limit = held ? finger_->scratch.own_limit[joint] : 0.0;
  magnitude own[2];
  for (int loaded = 0; loaded < 2; ++loaded) {
    if (acts && (*place[loaded].sides)[0]) {
      own[loaded] = present_magnitude(place[loaded]);
      limit += factor[loaded] * grip(finger_->scratch.grip, slot) * own[loaded].value;
    }
  }
  const double sign = finger_->scratch.velocity[slot] < 0.0 ? -1.0 : 1.0;
  const double share = held ? slope_by_limit(place[0], limit) : sign;
  for (int loaded = 0; loaded < 2; ++loaded) {
    if (!(*place[loaded].sides)[0]) {
      continue;
    }
    const std::size_t at = place[loaded].place * joints_ + joint; /* of the other joints 0 */
    torque_factor_[at] = bias_factor_[at] = factor[loaded];
    if (acts) {
      add_terms(own[loaded], share * grip(finger_->scratch.grip, slot), place[loaded], false);
    }
    read_jump(place[loaded]);
  }
}

/* --- all of a sample ---------------------------------------------------------------------------------------------- */

void sample_rows::read() {
  terms_.clear();
  plain_.clear();
  has_jump_ = sees_event();
  for (std::size_t i = 0; i < finger_->tendons; ++i) {
    read_tendon(i);
  }
  for (std::size_t j = 0; j < joints_; ++j) {
    read_joint(j);
  }
  const derived_numbers& d = finger_->derived;
  for (const cover_columns& cover : laws_.covers) {
    if (cover.stiffness >= 0) {
      plain_.push_back(
          {cover.stiffness, cover.joint, finger_->remembered.angle[cover.joint] - d.cover_rest[cover.joint]});
    }
    if (cover.rest_angle >= 0) {
      plain_.push_back({cover.rest_angle, cover.joint, -d.cover_stiffness[cover.joint]});
    }
  }
}

void sample_rows::dense(double* torque_rows, double* jump_rows) const {
  for (double* rows : {torque_rows, jump_rows}) {
    if (rows) {
      std::fill_n(rows, joints_ * unknowns_, 0.0);
    }
  }
  add_dense(torque_rows, jump_rows, 1.0);
}

void sample_rows::add_dense(double* torque_rows, double* jump_rows, double share) const {
  for (const sensitivity_term& term : terms_) {
    for (std::size_t k = 0; k < 4; ++k) {
      if (term.side->column[k] < 0) {
        continue;
      }
      for (std::size_t j = 0; j < joints_; ++j) {
        const std::size_t at = j * unknowns_ + static_cast<std::size_t>(term.side->column[k]);
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
      torque_rows[term.joint * unknowns_ + static_cast<std::size_t>(term.column)] += share * term.slope;
    }
  }
}

}  // namespace tendonfmu::estimation
