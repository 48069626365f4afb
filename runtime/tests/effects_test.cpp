// Torques beyond the paper, each by itself: derivatives by differences; and the table of all effects. Their values are
// compared with the oracle's (python_tests/model/test_random_extensions.py).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core_inside.h"

namespace {

constexpr std::size_t joints = 3, tendons = 2, lanes = 4;
using PerJoint = std::array<double, joints>;
using PerTendon = std::array<double, tendons>;

// A sample of three joints and two tendons; the second tendon passes the first two joints only.
struct Sample {
  PerJoint angle{0.3, -0.4, 0.9}, velocity{0.5, -0.2, 0.7}, rest{0.1, 0.0, -0.2};
  PerTendon force{20.0, 30.0};
  std::array<double, joints * lanes> arm{0.010, -0.008, 0, 0, 0.006, -0.005, 0, 0, 0.004, 0.0, 0, 0};
  std::array<double, joints * joints> cosine{1, 1, 1, 1, 1, 1, 1, 1, 1};
  double time = 0.1, step = 0.01;
  int first = 0;

  // ẋ_ij = Σ_{j' >= j} r_ij'·q̇_j'
  std::array<double, joints * lanes> tendon_velocity() const {
    std::array<double, joints * lanes> result{};
    for (std::size_t j = 0; j < joints; ++j) {
      for (std::size_t k = j; k < joints; ++k) {
        for (std::size_t i = 0; i < tendons; ++i) {
          result[j * lanes + i] += arm[k * lanes + i] * velocity[k];
        }
      }
    }
    return result;
  }
};

const effect_type* effect_of(const char* name) {
  for (std::size_t i = 0; effect_at(i); ++i) {
    if (std::string(effect_at(i)->name) == name) {
      return effect_at(i);
    }
  }
  return nullptr;
}

// An effect at a place, with its numbers and what it remembers.
struct Effect {
  const effect_type* type;
  effect_place place;
  std::vector<double> numbers, memory;

  // from 1, as in a description; 0: nowhere
  Effect(const char* name, std::uint32_t joint, std::uint32_t tendon, std::vector<double> values)
      : type(effect_of(name)),
        place{joint ? joint - 1 : EFFECT_NOWHERE, tendon ? tendon - 1 : EFFECT_NOWHERE, EFFECT_NOWHERE},
        numbers(std::move(values)) {
    const effect_action& acts = *type->action;
    memory.resize(acts.state_count ? acts.state_count(joints, tendons, place) : acts.memory_count, 0.0);
  }

  // Calls with the sample as an effect sees it, and its row with what it remembers after it.
  template <class Call>
  void see(const Sample& sample, std::vector<double> after, Call call) const {
    const auto velocity = sample.tendon_velocity();
    effect_sample seen{};
    seen.joints = joints;
    seen.tendons = tendons;
    seen.lanes = lanes;
    seen.first = sample.first;
    seen.time = sample.time;
    seen.step = sample.step;
    seen.angle = sample.angle.data();
    seen.velocity = sample.velocity.data();
    seen.tendon_velocity = velocity.data();
    seen.force = sample.force.data();
    seen.moment_arm = sample.arm.data();
    seen.rest_angle = sample.rest.data();
    seen.axis_cosine = sample.cosine.data();
    seen.tendon_threshold = 0.0005;
    seen.joint_threshold = 0.01;
    const extension_row row = {type->action, place, numbers.data(), memory.data(), after.data(), memory.size()};
    call(&row, &seen);
  }

  std::vector<double> advanced(const Sample& sample) const {
    std::vector<double> after(memory.size(), std::numeric_limits<double>::quiet_NaN());
    if (type->action->advance) {
      see(sample, after, [&](auto* row, auto* seen) {
        type->action->advance(row, seen);
        after.assign(row->now, row->now + row->memory_count);
      });
    }
    return after;
  }

  static effect_direction along_of(const Sample& direction) {
    effect_direction along{};
    along.angle = direction.angle.data();
    along.velocity = direction.velocity.data();
    along.force = direction.force.data();
    return along;
  }

  PerJoint torque(const Sample& sample, const std::vector<double>& after) const {
    PerJoint result{1.0, 2.0, 3.0};  // it adds
    see(sample, after, [&](auto* row, auto* seen) { type->action->torque(row, seen, result.data()); });
    return {result[0] - 1.0, result[1] - 2.0, result[2] - 3.0};
  }
  PerJoint torque(const Sample& sample) const { return torque(sample, advanced(sample)); }

  PerJoint accept(const Sample& sample) {
    memory = advanced(sample);
    return torque(sample, memory);
  }

  PerJoint slope(const Sample& sample, const Sample& direction, const std::vector<double>& after) const {
    PerJoint result{};
    const effect_direction along = along_of(direction);
    if (type->action->slope) {
      see(sample, after, [&](auto* row, auto* seen) { type->action->slope(row, seen, &along, result.data()); });
    }
    return result;
  }
};

void expect_near(const PerJoint& found, const PerJoint& expected, double tolerance = 1e-15) {
  for (std::size_t j = 0; j < joints; ++j) {
    EXPECT_NEAR(found[j], expected[j], tolerance) << "joint " << j + 1;
  }
}

// One of each, at each kind of place that it has.
std::vector<Effect> all_torques() {
  return {{"cover_hardening", 3, 0, {0.3, -0.2}},
          {"gravity", 3, 0, {0.02, -0.03}},
          {"gravity", 1, 0, {0.02, -0.03}},
          {"inertia", 2, 0, {2e-4}},
          {"inertia_variation", 2, 0, {2e-3, -1e-3}},
          {"joint_coupling", 1, 0, {0.05, 0.3}},
          {"preload_friction", 0, 1, {0.4, 1.0}},
          {"preload_friction", 1, 1, {0.4, 0.2}},
          {"load_friction", 2, 1, {2e-4}},
          {"force_gain", 0, 2, {0.07}},
          {"force_offset", 0, 1, {-0.5}},
          {"moment_arm", 3, 1, {6e-4}},
          {"moment_arm_variation", 2, 2, {-4e-4, 3e-4}},
          {"pulley_eccentricity", 3, 1, {5e-4, 3e-4, 1.0}},
          {"pulley_eccentricity", 2, 2, {5e-4, 3e-4, 7.5}}};
}

// --- torques --------------------------------------------------------------------------------------------------------

// The sample, moved along a direction.
Sample moved(Sample sample, const Sample& direction, double length) {
  for (std::size_t j = 0; j < joints; ++j) {
    sample.angle[j] += length * direction.angle[j];
    sample.velocity[j] += length * direction.velocity[j];
  }
  for (std::size_t i = 0; i < tendons; ++i) {
    sample.force[i] += length * direction.force[i];
  }
  return sample;
}

const Sample direction = [] {
  Sample along;
  along.angle = {0.7, -1.1, 0.4};
  along.velocity = {-0.9, 0.3, 0.8};
  along.force = {1.3, -0.6};
  return along;
}();

TEST(Slope, IsTheCentralDifferenceWithTheMemoryHeld) {
  Sample before;
  before.first = 1;
  before.velocity = {0.4, 0.1, -0.3};
  const double h = 1e-5;
  for (Effect& effect : all_torques()) {
    SCOPED_TRACE(effect.type->name);
    effect.accept(before);
    for (const double sign : {1.0, -1.0}) {
      Sample here;
      here.force = {sign * 20.0, 30.0};
      PerJoint difference{};
      for (const double side : {1.0, -1.0}) {
        const PerJoint torque = effect.torque(moved(here, direction, side * h));
        for (std::size_t j = 0; j < joints; ++j) {
          difference[j] += side * torque[j] / (2.0 * h);
        }
      }
      const PerJoint expected = effect.slope(here, direction, effect.advanced(here));
      expect_near(difference, expected, 1e-9);
      const bool constant = std::set<std::string>{"preload_friction", "force_offset"}.count(effect.type->name) > 0;
      EXPECT_EQ(expected == PerJoint{}, constant);
    }
  }
}

// --- the table ------------------------------------------------------------------------------------------------------

TEST(Table, HasDifferentNamesAndNumbers) {
  std::set<std::string> names;
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; effect_at(i); ++i) {
    const effect_type* effect = effect_at(i);
    EXPECT_TRUE(names.insert(effect->name).second) << effect->name;
    EXPECT_TRUE(ids.insert(effect->id).second) << effect->name;
    EXPECT_EQ(effect_by_id(effect->id), effect);
    EXPECT_LE(effect->parameter_count, std::uint32_t{EFFECT_MAX_PARAMETERS});
    EXPECT_LT(effect->id, 64) << effect->name << ": a bit of TENDONFMU_EFFECTS";
    const effect_action& acts = *effect->action;
    EXPECT_EQ(acts.state_count || acts.memory_count, acts.advance || acts.kind == EFFECT_SIGNAL) << effect->name;
    for (std::uint32_t p = 0; p < effect->parameter_count; ++p) {
      const effect_parameter& number = effect->parameters[p];
      EXPECT_GE(effect_expectation_of(effect, p)->scale, 0.0) << effect->name << "." << number.name;
      EXPECT_LT(number.minimum, number.maximum) << effect->name << "." << number.name;
      EXPECT_TRUE(number.unit && *number.unit) << effect->name << "." << number.name;
    }
  }
  EXPECT_GE(names.size(), 11u);
  EXPECT_EQ(effect_by_id(0), nullptr);
}

TEST(Table, KeepsItsNumbers) {  // they stand in model images
  const char* const torques[] = {
      "cover_hardening",     "gravity",          "inertia",      "joint_coupling", "preload_friction",
      "load_friction",       "force_gain",       "force_offset", "moment_arm",     "moment_arm_variation",
      "pulley_eccentricity", "inertia_variation"};
  for (std::uint32_t id = 1; id <= 12; ++id) {
    ASSERT_NE(effect_by_id(id), nullptr) << id;
    EXPECT_STREQ(effect_by_id(id)->name, torques[id - 1]);
    EXPECT_EQ(effect_by_id(id)->action->kind, EFFECT_TORQUE);
  }
}

}  // namespace
