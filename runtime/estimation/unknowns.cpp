#include "unknowns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

namespace tendonfmu::estimation {
namespace {

constexpr double smallest_share = 1e-6; /* of the scale: what is present stays present */
constexpr double slowest_share = 1e-3;  /* of the scale of 1/vs */
constexpr double threshold_share =
    0.2; /* vs_min of v_min: below, nothing is left of the Stribeck effect where it moves */

/* A number that can be estimated. */
struct column_candidate {
  std::uint32_t parameter;
  unknown_role role;
  model_item_kind kind;
  std::size_t joint;
};

struct finger_structure {
  const tendonfmu_finger* finger;
  std::vector<column_candidate> candidates; /* in canonical order */
  std::vector<std::uint32_t> statics;       /* of every side */
  std::vector<double> threshold;            /* v_min of every side */
  std::int64_t initial_first = -1;
};

void add_side(finger_structure* s, const model_item& item, std::uint32_t first, double threshold) {
  const unknown_role roles[] = {unknown_role::drop, unknown_role::coulomb, unknown_role::rate, unknown_role::viscous};
  for (std::uint32_t k = 0; k < 4; ++k) {
    s->candidates.push_back({first + k, roles[k], item.kind, item.joint});
  }
  s->statics.push_back(first);
  s->threshold.push_back(threshold);
}

void add_item(finger_structure* s, const model_item& item) {
  const finger_settings& settings = s->finger->derived.settings;
  switch (item.kind) {
    case ITEM_JOINT_FRICTION:
    case ITEM_LOAD_FRICTION:
    case ITEM_PULLEY_FRICTION:
    case ITEM_EDGE_FRICTION:
      for (std::uint32_t side = 0; side < (item.law == LAW_ASYMMETRIC ? 2u : 1u); ++side) {
        add_side(s, item, item.first + 4 * side,
                 item.kind <= ITEM_LOAD_FRICTION ? settings.joint_threshold : settings.tendon_threshold);
      }
      break;
    case ITEM_INITIAL_TORQUE:
      s->initial_first = item.first;
      for (std::uint32_t k = 0; k < item.count; ++k) {
        s->candidates.push_back({item.first + k, unknown_role::value, item.kind, k});
      }
      break;
    case ITEM_COVER:
    case ITEM_EXTENSION:
      for (std::uint32_t k = 0; k < item.count; ++k) {
        s->candidates.push_back({item.first + k, unknown_role::value, item.kind, item.joint});
      }
      break;
    default: break;
  }
}

std::string path_of(const tendonfmu_finger* finger, std::uint32_t parameter) {
  char path[PARAMETER_PATH_BYTES];
  const model_item item = parameter_item(&finger->shape, parameter);
  parameter_path(&item, parameter, path);
  return path;
}

/* expected of a number of an extension where nothing else says it */
double scale_of(const model_item& item, std::uint32_t parameter) {
  const effect_expectation& number = *effect_expectation_of(item.effect, parameter - item.first);
  return is_everywhere(item.place) && number.scale_everywhere > 0.0 ? number.scale_everywhere : number.scale;
}

/* a number of an extension that is a property of the mechanism, not 0 where nobody says it */
bool left_out(const finger_structure& s, std::uint32_t parameter) {
  const model_item item = parameter_item(&s.finger->shape, parameter);
  const double missing = effect_expectation_of(item.effect, parameter - item.first)->missing_value;
  return missing != 0.0 && s.finger->start[parameter] == missing;
}

/* what is present is estimated, what is absent stays absent */
std::vector<std::int32_t> present_groups(const finger_structure& s) {
  const double* value = s.finger->start;
  std::vector<std::int32_t> group(s.finger->shape.parameter_count, -1);
  for (const column_candidate& c : s.candidates) {
    const auto p = static_cast<std::int32_t>(c.parameter);
    const bool rest_angle =
        c.kind == ITEM_COVER && parameter_item(&s.finger->shape, c.parameter).first + 1 == c.parameter;
    const bool always = (c.kind == ITEM_EXTENSION && !left_out(s, c.parameter)) || c.kind == ITEM_INITIAL_TORQUE ||
                        c.role == unknown_role::coulomb;
    const std::uint32_t first = c.parameter - (c.role == unknown_role::rate ? 2 : 0);
    const bool stribeck =
        (c.role == unknown_role::rate || c.role == unknown_role::drop) && value[first] != value[first + 1];
    const bool other = c.role == unknown_role::viscous || c.kind == ITEM_COVER;
    if (!rest_angle && (always || stribeck || (other && value[c.parameter] != 0.0))) {
      group[c.parameter] = p;
    }
  }
  for (const std::uint32_t first : s.statics) {
    if (value[first] == value[first + 1]) {
      group[first] = group[first + 1]; /* they move together */
    }
  }
  return group;
}

/* value of an unknown, from the numbers of the description */
double value_of(unknown_role role, std::uint32_t parameter, const double* numbers) {
  switch (role) {
    case unknown_role::drop: return numbers[parameter] - numbers[parameter + 1];
    case unknown_role::rate: return 1.0 / numbers[parameter];
    default: return numbers[parameter];
  }
}

/* Columns in the making. */
class column_maker {
 public:
  column_maker(const finger_structure& structure, std::vector<std::int32_t> group, const numbers& scale)
      : s_(structure), group_(std::move(group)), scale_(scale), column_(structure.finger->shape.parameter_count, -1) {
    check_groups();
    for (const column_candidate& c : s_.candidates) {
      if (group_[c.parameter] >= 0 && !follows_coulomb(c)) {
        add(c);
      }
    }
    for (std::size_t k = 0; k < list.size(); ++k) {
      finish(&list[k], k);
    }
    sort();
  }

  std::int32_t column(std::uint32_t parameter) const { return column_[parameter]; }
  bool tied(std::uint32_t first) const {
    return group_[first + 1] >= 0 && (group_[first] == group_[first + 1] || (group_[first] < 0 && equal(first)));
  }

  std::vector<unknown_item> list;

 private:
  void check_groups() const {
    std::vector<bool> known(column_.size(), false);
    for (const column_candidate& c : s_.candidates) {
      known[c.parameter] = true;
    }
    for (std::uint32_t p = 0; p < column_.size(); ++p) {
      if (group_[p] >= 0 && !known[p]) {
        throw std::invalid_argument(path_of(s_.finger, p) +
                                    ": not a number that can be estimated; expected one of a law, a cover, an "
                                    "extension or bias.initial_torque");
      }
    }
  }

  bool equal(std::uint32_t first) const { return s_.finger->start[first] == s_.finger->start[first + 1]; }

  /* the static friction of a law without Stribeck effect */
  bool follows_coulomb(const column_candidate& c) const { return c.role == unknown_role::drop && tied(c.parameter); }

  void add(const column_candidate& c) {
    const auto [place, is_new] = by_group_.try_emplace(group_[c.parameter], list.size());
    if (is_new) {
      list.push_back({c.role, {}, 0.0, 0.0, 0.0, 0.0, c.joint, path_of(s_.finger, c.parameter), false});
      kinds_.push_back(c.kind);
    }
    unknown_item& unknown = list[place->second];
    if (unknown.role != c.role) {
      throw std::invalid_argument(path_of(s_.finger, c.parameter) + ": shares its value with " + unknown.path +
                                  "; expected numbers of the same kind");
    }
    unknown.parameters.push_back(c.parameter);
    unknown.joint = std::min(unknown.joint, c.joint);
    column_[c.parameter] = static_cast<std::int32_t>(place->second);
  }

  /* start, bounds and scale of a column, from all that it moves */
  void finish(unknown_item* unknown, std::size_t column) {
    const double* start = s_.finger->start;
    const double count = static_cast<double>(unknown->parameters.size());
    double scale = 0.0;
    for (const std::uint32_t p : unknown->parameters) {
      unknown->start += value_of(unknown->role, p, start) / count;
      scale += expected(unknown->role, p) / count;
      const model_item item = parameter_item(&s_.finger->shape, p);
      /* torques are linear in their numbers; what turns friction or the signals is not */
      unknown->curved = unknown->curved || unknown->role == unknown_role::rate ||
                        (item.kind == ITEM_EXTENSION && item.effect->action->kind != EFFECT_TORQUE);
    }
    unknown->scale = scale > 0.0 ? scale : neighbours_scale(column);
    bound(unknown);
    unknown->start = std::min(std::max(unknown->start, unknown->lower), unknown->upper);
  }

  double given(std::uint32_t p) const {
    return !scale_.empty() && std::isfinite(scale_[p]) ? std::fabs(scale_[p]) : 0.0;
  }

  double expected(unknown_role role, std::uint32_t p) const {
    if (given(p) > 0.0) {
      if (role == unknown_role::drop) {
        return given(p + 1) < given(p) ? given(p) - given(p + 1) : given(p);
      }
      return role == unknown_role::rate ? 1.0 / given(p) : given(p);
    }
    const double value = std::fabs(value_of(role, p, s_.finger->start));
    const model_item item = parameter_item(&s_.finger->shape, p);
    return item.kind == ITEM_EXTENSION ? std::max(value, scale_of(item, p)) : value;
  }

  /* an unknown that starts at 0: as large as the largest of its kind */
  double neighbours_scale(std::size_t column) const {
    double largest = 0.0;
    for (std::size_t k = 0; k < list.size(); ++k) {
      if (list[k].role == list[column].role && kinds_[k] == kinds_[column]) {
        for (const std::uint32_t p : list[k].parameters) {
          largest = std::max(largest, expected(list[k].role, p));
        }
      }
    }
    if (largest > 0.0) {
      return largest;
    }
    if (kinds_[column] == ITEM_INITIAL_TORQUE) {
      return 1.0;
    }
    throw std::invalid_argument(list[column].path + " = 0: its size is unknown; expected a scale, or a start above 0");
  }

  void bound(unknown_item* unknown) const {
    unknown->lower = -std::numeric_limits<double>::infinity();
    unknown->upper = std::numeric_limits<double>::infinity();
    if (unknown->role == unknown_role::value) {
      for (const std::uint32_t p : unknown->parameters) {
        const model_item item = parameter_item(&s_.finger->shape, p);
        const parameter_range range = parameter_range_of(&item, p);
        const double least = range.above_minimum ? smallest_share * unknown->scale : 0.0;
        unknown->lower = std::max(unknown->lower, range.minimum + least);
        unknown->upper = std::min(unknown->upper, range.maximum);
      }
      return;
    }
    unknown->lower = smallest_share * unknown->scale;
    unknown->upper = 0.5e9; /* static = coulomb + drop <= 1e9, as parameters.c */
    if (unknown->role == unknown_role::rate) {
      unknown->lower = slowest_share * unknown->scale;
      unknown->upper = fastest(*unknown);
    } else if (unknown->role == unknown_role::coulomb) {
      for (const std::uint32_t p : unknown->parameters) {
        if (group_[p - 1] < 0 && !tied(p - 1)) { /* below a static friction that stays */
          unknown->upper = std::min(unknown->upper, s_.finger->start[p - 1]);
        }
      }
    }
  }

  /* 1/vs_min */
  double fastest(const unknown_item& unknown) const {
    double rate = unknown.scale / slowest_share;
    for (std::size_t k = 0; k < s_.statics.size(); ++k) {
      const bool among = std::count(unknown.parameters.begin(), unknown.parameters.end(), s_.statics[k] + 2) > 0;
      if (among && s_.threshold[k] > 0.0) {
        rate = std::min(rate, 1.0 / (threshold_share * s_.threshold[k]));
      }
    }
    return std::max(rate, 2.0 * unknown.scale);
  }

  /* joints in order: what turns joint j is then among the columns before those of joint j + 1 */
  void sort() {
    std::vector<std::size_t> order(list.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [this](std::size_t a, std::size_t b) { return list[a].joint < list[b].joint; });
    std::vector<unknown_item> sorted;
    std::vector<std::int32_t> place(list.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
      place[order[k]] = static_cast<std::int32_t>(k);
      sorted.push_back(list[order[k]]);
    }
    list = std::move(sorted);
    for (std::int32_t& column : column_) {
      column = column < 0 ? -1 : place[static_cast<std::size_t>(column)];
    }
  }

  const finger_structure& s_;
  const std::vector<std::int32_t> group_;
  const numbers& scale_;
  std::vector<std::int32_t> column_;
  std::map<std::int32_t, std::size_t> by_group_;
  std::vector<model_item_kind> kinds_;
};

}  // namespace

void expect_length(std::size_t length, std::size_t expected, const char* name, const char* what) {
  if (length != expected) {
    throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(expected) + " " + what);
  }
}

unknown_list::unknown_list(const tendonfmu_finger* finger, const std::vector<std::int32_t>& group,
                           const numbers& scale) {
  const std::size_t count = finger->shape.parameter_count;
  expect_length(group.empty() ? count : group.size(), count, "group", "numbers");
  expect_length(scale.empty() ? count : scale.size(), count, "scale", "numbers");
  finger_structure structure{finger, {}, {}, {}, -1};
  visit_items(finger->shape, [&](const model_item& item) { add_item(&structure, item); });
  column_maker columns(structure, group.empty() ? present_groups(structure) : group, scale);
  list_ = std::move(columns.list);
  start_.assign(finger->start, finger->start + count);
  sides_.assign(count, {{-1, -1, -1, -1}, false, 0, 0, -1});
  plain_.assign(count, -1);
  initial_first_ = structure.initial_first;
  for (const std::uint32_t first : structure.statics) {
    const bool tied = columns.tied(first);
    const std::int32_t drop = tied ? -1 : columns.column(first);
    sides_[first] = {{columns.column(first + 1), drop, columns.column(first + 2), columns.column(first + 3)},
                     tied || drop >= 0,
                     0,
                     0,
                     -1};
    find_run(first);
  }
  for (const column_candidate& c : structure.candidates) {
    if (c.role == unknown_role::value) {
      plain_[c.parameter] = columns.column(c.parameter);
    }
  }
}

/* whether the columns of a side follow each other and move nothing else */
void unknown_list::find_run(std::uint32_t first) {
  side_columns& side = sides_[first];
  std::vector<std::int32_t> columns;
  bool alone = true;
  for (const std::int32_t column : side.column) {
    if (column >= 0) {
      const std::vector<std::uint32_t>& moved = list_[static_cast<std::size_t>(column)].parameters;
      columns.push_back(column);
      alone = alone && moved.size() == 1;
    }
  }
  std::sort(columns.begin(), columns.end());
  if (!columns.empty() && alone && columns.back() - columns.front() + 1 == static_cast<std::int32_t>(columns.size())) {
    side.run_first = static_cast<std::size_t>(columns.front());
    side.run_length = columns.size();
  }
  if (side.column[2] >= 0) {
    side.index = static_cast<std::int32_t>(rates_.size());
    rates_.push_back({side.column[2], side.column[1]});
    const bool tied = side.static_follows && side.column[1] < 0;
    fixed_drops_.push_back(tied ? 0.0 : start_[first] - start_[first + 1]);
  }
}

std::vector<double> unknown_list::read(const double* parameters) const {
  std::vector<double> unknowns(count(), 0.0);
  for (std::size_t k = 0; k < count(); ++k) {
    for (const std::uint32_t p : list_[k].parameters) {
      unknowns[k] += value_of(list_[k].role, p, parameters) / static_cast<double>(list_[k].parameters.size());
    }
  }
  return unknowns;
}

std::vector<double> unknown_list::write(const double* unknowns) const {
  std::vector<double> numbers(start_.size());
  write(unknowns, numbers.data());
  return numbers;
}

void unknown_list::write(const double* unknowns, double* numbers) const {
  std::copy(start_.begin(), start_.end(), numbers);
  const auto at = [unknowns](std::int32_t column, double otherwise) {
    return column < 0 ? otherwise : unknowns[column];
  };
  for (std::uint32_t p = 0; p < start_.size(); ++p) {
    const side_columns& side = sides_[p];
    if (plain_[p] >= 0) {
      /* scaling back and forth may round a number at its bound beyond it */
      const unknown_item& unknown = list_[static_cast<std::size_t>(plain_[p])];
      numbers[p] = std::clamp(unknowns[plain_[p]], unknown.lower, unknown.upper);
    }
    if (side.column[2] >= 0) {
      numbers[p + 2] = 1.0 / unknowns[side.column[2]];
    }
    if (side.column[3] >= 0) {
      numbers[p + 3] = unknowns[side.column[3]];
    }
    if (side.column[0] >= 0 || side.column[1] >= 0) {
      const bool tied = side.static_follows && side.column[1] < 0;
      const double drop = tied ? 0.0 : at(side.column[1], start_[p] - start_[p + 1]);
      numbers[p + 1] = at(side.column[0], start_[p + 1]);
      numbers[p] = side.static_follows || side.column[1] >= 0 ? numbers[p + 1] + drop : start_[p];
    }
  }
}

}  // namespace tendonfmu::estimation
