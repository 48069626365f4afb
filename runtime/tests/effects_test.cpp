// Torques beyond the paper, each by itself: values by hand, derivatives by differences, memory.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model_inside.h"
#include "sampled_effect.h"

#include "floating_point.h"

namespace {

// One of each, at each kind of place that it has.
std::vector<Effect> all_torques() {
  return {{"cover_hardening", 3, 0, {0.3}},
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
          {"moment_arm_variation", 2, 2, {-4e-4}},
          {"pulley_eccentricity", 3, 1, {5e-4, 3e-4, 1.0}},
          {"pulley_eccentricity", 2, 2, {5e-4, 3e-4, 7.5}}};
}

// --- values ----------------------------------------------------------------------------------------------------------

TEST(Torque, OfSpringsAtTheCovers) {
  const Sample s;
  expect_near(Effect("cover_hardening", 1, 0, {0.5}).torque(s), {0.5 * 0.2 * 0.2 * 0.2, 0, 0});
  // bends 0.2, −0.4, 1.1
  expect_near(Effect("joint_coupling", 1, 0, {0.1, 1.0}).torque(s), {0.06, -0.06, 0});
  expect_near(Effect("joint_coupling", 1, 0, {0.1, 0.5}).torque(s), {0.06, -0.03, 0});
  expect_near(Effect("joint_coupling", 2, 0, {0.1, 1.0}).torque(s), {0, -0.15, 0.15});
}

TEST(Torque, OfWeightIsFeltByAllJointsBefore) {
  Sample s;
  const double amount = 0.02 * std::sin(0.8) - 0.03 * std::cos(0.8);
  expect_near(Effect("gravity", 3, 0, {0.02, -0.03}).torque(s), {amount, amount, amount});
  const double of_second = 0.02 * std::sin(-0.1);
  expect_near(Effect("gravity", 2, 0, {0.02, 0.0}).torque(s), {of_second, of_second, 0});
  // the second axis against the third, the first across it
  s.cosine = {1, 0, 0, 0, 1, -1, 0, -1, 1};
  const double turned = 0.02 * std::sin(0.4 + 0.9);
  expect_near(Effect("gravity", 3, 0, {0.02, 0.0}).torque(s), {0, -turned, turned});
}

TEST(Torque, OfInertiaByTheVelocityBefore) {
  Effect inertia("inertia", 2, 0, {2e-3});
  Sample s;
  s.first = 1;
  expect_near(inertia.accept(s), {0, 0, 0});
  s.first = 0;
  s.velocity[1] = 0.3;
  expect_near(inertia.accept(s), {0, 2e-3 * 0.5 / 0.01, 0});
  s.step = 0.02;
  s.velocity[1] = 0.2;
  expect_near(inertia.accept(s), {0, -2e-3 * 0.1 / 0.02, 0});
}

TEST(Torque, OfInertiaThatTheNextJointVaries) {
  Effect varying("inertia_variation", 1, 0, {3e-3, 2e-3});
  Sample s;
  s.first = 1;
  s.velocity = {0.0, 0.0, 0.0};
  expect_near(varying.accept(s), {0, 0, 0});
  s.first = 0;
  s.velocity = {0.3, -0.7, 0.0};
  const double twice = 2.0 * s.angle[1], inertia = 3e-3 * std::sin(twice) + 2e-3 * std::cos(twice);
  const double by_angle = 6e-3 * std::cos(twice) - 4e-3 * std::sin(twice);
  const double expected = inertia * 0.3 / 0.01 - by_angle * 0.7 * 0.3;
  expect_near(varying.accept(s), {expected, -0.5 * by_angle * 0.09, 0});
}

// Work of both joints over time is the gain of the kinetic energy.
TEST(Torque, OfAVaryingInertiaIsThatOfAnEnergy) {
  Effect varying("inertia_variation", 1, 0, {3e-3, 2e-3});
  Sample s;
  s.step = 1e-5;
  double work = 0.0, start = 0.0, end = 0.0;
  for (int k = 0; k < 20000; ++k) {
    const double t = s.step * k;
    s.first = k == 0;
    s.velocity = {std::sin(9.0 * t) + 0.4, 2.0 * std::cos(5.0 * t), 0.0};
    s.angle[1] = 0.4 * std::sin(5.0 * t);
    const PerJoint torque = varying.accept(s);
    work += k ? (torque[0] * s.velocity[0] + torque[1] * s.velocity[1]) * s.step : 0.0;
    end = 0.5 * (3e-3 * std::sin(2.0 * s.angle[1]) + 2e-3 * std::cos(2.0 * s.angle[1])) * s.velocity[0] * s.velocity[0];
    start = k ? start : end;
  }
  EXPECT_GT(std::abs(end - start), 1e-4);
  EXPECT_NEAR(work, end - start, 1e-3 * std::abs(end - start));
}

TEST(Torque, OfFrictionOfATendonWithoutItsForce) {
  // ẋ_1 = 0.0066, 0.0016, 0.0028; ẋ_2 = −0.003, 0.001, 0
  const Sample s;
  expect_near(Effect("preload_friction", 2, 1, {0.4, 1.0}).torque(s), {0, 0.006 * 0.4, 0.004 * 0.4});
  expect_near(Effect("preload_friction", 2, 1, {0.4, 0.0}).torque(s), {0, 0.006 * 0.4, 0});
  expect_near(Effect("preload_friction", 1, 2, {0.4, 1.0}).torque(s), {0.008 * 0.4, 0.005 * 0.4, 0});
  expect_near(Effect("preload_friction", 3, 2, {0.4, 1.0}).torque(s), {0, 0, 0});
  // before joint 1: +1, +1, +1 along the first tendon, −1, +1, 0 along the second
  expect_near(Effect("preload_friction", 0, 1, {0.4, 1.0}).torque(s), {0.01 * 0.4, 0.006 * 0.8, 0.004 * 1.2});
  expect_near(Effect("preload_friction", 0, 1, {0.4, 0.0}).torque(s), {0.01 * 0.4, 0.006 * 0.4, 0.004 * 0.4});
  expect_near(Effect("preload_friction", 0, 2, {0.4, 1.0}).torque(s), {0.008 * 0.4, 0, 0});
}

TEST(Torque, OfFrictionInAJointByOneTendonsForce) {
  Sample s;
  expect_near(Effect("load_friction", 2, 1, {2e-4}).torque(s), {0, -2e-4 * 20.0, 0});
  s.force[0] = -20.0;
  expect_near(Effect("load_friction", 1, 1, {2e-4}).torque(s), {2e-4 * 20.0, 0, 0});
}

TEST(Torque, OfForcesMeasuredWrong) {
  const Sample s;
  expect_near(Effect("force_gain", 0, 1, {0.05}).torque(s), {-0.010, -0.006, -0.004});
  expect_near(Effect("force_offset", 0, 2, {0.5}).torque(s), {0.004, 0.0025, 0});
}

TEST(Torque, OfMomentArmsThatAreOthers) {
  const Sample s;
  expect_near(Effect("moment_arm", 3, 2, {1e-3}).torque(s), {0, 0, -0.03});
  expect_near(Effect("moment_arm_variation", 2, 1, {1e-3}).torque(s), {0, 0.008, 0});
  expect_near(Effect("pulley_eccentricity", 1, 2, {1e-3, 0.0, 1.0}).torque(s), {-0.03 * std::sin(0.3), 0, 0});
  expect_near(Effect("pulley_eccentricity", 1, 2, {0.0, 1e-3, 1.0}).torque(s), {-0.03 * std::cos(0.3), 0, 0});
  expect_near(Effect("pulley_eccentricity", 1, 2, {1e-3, 0.0, 9.0}).torque(s), {-0.03 * std::sin(2.7), 0, 0});
}

// --- memory ----------------------------------------------------------------------------------------------------------

TEST(Memory, SideStaysAtRestAndIsNoneBeforeTheFirstMotion) {
  Sample still, there, back;
  still.velocity = {0.005, 0.0, 0.0};  // below 0.01 rad/s; 5e-5 m/s
  back.velocity = {-0.5, 0.0, 0.0};
  Effect load("load_friction", 1, 1, {1e-3}), preload("preload_friction", 1, 1, {0.1, 1.0});
  Sample first = still;
  first.first = 1;
  for (Effect* effect : {&load, &preload}) {
    expect_near(effect->accept(first), {0, 0, 0});
    expect_near(effect->accept(still), {0, 0, 0});
    const PerJoint moving = effect->accept(there);
    EXPECT_GT(moving[0], 0.0);
    EXPECT_EQ(effect->accept(still), moving);
    const PerJoint other = effect->accept(back);
    EXPECT_NEAR(other[0], -moving[0], 1e-15);
    EXPECT_EQ(effect->accept(still), other);
    expect_near(effect->accept(first), {0, 0, 0});  // what was before the first sample does not count
  }
}

TEST(Memory, OnlyAcceptedSamplesChangeIt) {
  Effect load("load_friction", 1, 1, {1e-3});
  Sample still;
  still.velocity = {};
  const std::vector<double> before = load.memory;
  EXPECT_GT(load.torque(Sample{})[0], 0.0);
  EXPECT_EQ(load.memory, before);
  EXPECT_EQ(load.accept(still)[0], 0.0);
}

TEST(Memory, OfPreloadFrictionIsASideForEachJointItIsBefore) {
  const Effect everywhere("preload_friction", 0, 1, {0.4, 1.0}), one("preload_friction", 2, 1, {0.4, 1.0});
  EXPECT_EQ(everywhere.memory.size(), joints);
  EXPECT_EQ(one.memory.size(), 1u);
  EXPECT_EQ(everywhere.advanced(Sample{}), (std::vector<double>{1, 1, 1}));
  EXPECT_EQ(Effect("preload_friction", 0, 2, {0.4, 1.0}).advanced(Sample{}), (std::vector<double>{-1, 1, 0}));
}

// --- derivatives -----------------------------------------------------------------------------------------------------

TEST(Slope, IsTheCentralDifferenceWithTheMemoryHeld) {
  Sample before, direction;
  before.first = 1;
  before.velocity = {0.4, 0.1, -0.3};
  direction.angle = {0.7, -1.1, 0.4};
  direction.velocity = {-0.9, 0.3, 0.8};
  direction.force = {1.3, -0.6};
  const double h = 1e-5;
  for (Effect& effect : all_torques()) {
    SCOPED_TRACE(effect.type->name);
    effect.accept(before);
    PerJoint difference{}, expected{};
    for (const double side : {1.0, -1.0}) {
      Sample moved;
      for (std::size_t j = 0; j < joints; ++j) {
        moved.angle[j] += side * h * direction.angle[j];
        moved.velocity[j] += side * h * direction.velocity[j];
      }
      for (std::size_t i = 0; i < tendons; ++i) {
        moved.force[i] += side * h * direction.force[i];
      }
      const PerJoint torque = effect.torque(moved);
      for (std::size_t j = 0; j < joints; ++j) {
        difference[j] += side * torque[j] / (2.0 * h);
      }
    }
    expected = effect.slope(Sample{}, direction, effect.advanced(Sample{}));
    expect_near(difference, expected, 1e-9);
    const bool constant = std::set<std::string>{"preload_friction", "force_offset"}.count(effect.type->name) > 0;
    EXPECT_EQ(expected == PerJoint{}, constant);
  }
}

TEST(Slope, OfInertiaIsZeroAtTheFirstSample) {
  Effect inertia("inertia", 2, 0, {2e-3});
  Sample first;
  first.first = 1;
  inertia.accept(first);
  expect_near(inertia.slope(first, Sample{}, inertia.memory), {0, 0, 0});
}

TEST(Slope, OfInertiaFollowsTheVelocityBeforeToo) {
  Effect inertia("inertia", 2, 0, {2e-3});
  Sample first, second, first_direction, second_direction;
  first.first = 1;
  first_direction.velocity[1] = 0.3;
  second_direction.velocity[1] = -0.5;
  std::vector<double> slopes(inertia.memory.size(), 0.0);
  for (const auto& [sample, direction] : {std::pair{&first, &first_direction}, {&second, &second_direction}}) {
    std::vector<double> next(slopes.size());
    const effect_direction along = Effect::along_of(*direction);
    Effect::see(*sample, [&](auto* seen) {
      inertia.type->advance_slope(inertia.place, inertia.numbers.data(), seen, inertia.memory.data(), &along,
                                  slopes.data(), next.data());
    });
    inertia.accept(*sample);
    slopes = next;
  }
  expect_near(inertia.torque(second, inertia.numbers, slopes), {0, 2e-3 * (-0.5 - 0.3) / 0.01, 0});
}

TEST(Slope, OfAVaryingInertiaFollowsAllThatItReadBefore) {
  Effect varying("inertia_variation", 1, 0, {3e-3, 2e-3});
  Sample first, direction;
  first.first = 1;
  first.velocity = {0.2, 0.5, 0.0};
  direction.angle = {0.0, 0.6, 0.0};
  direction.velocity = {-0.9, 0.3, 0.0};
  const double h = 1e-6;
  PerJoint difference{};
  for (const double side : {1.0, -1.0}) {
    Effect moved = varying;
    for (Sample sample : {first, Sample{}}) {
      for (std::size_t j = 0; j < joints; ++j) {
        sample.angle[j] += side * h * direction.angle[j];
        sample.velocity[j] += side * h * direction.velocity[j];
      }
      const PerJoint torque = moved.accept(sample);
      for (std::size_t j = 0; j < joints && !sample.first; ++j) {
        difference[j] += side * torque[j] / (2.0 * h);
      }
    }
  }
  const effect_direction along = Effect::along_of(direction);
  std::vector<double> slopes(varying.memory.size(), 0.0), next = slopes;
  for (const Sample& sample : {first, Sample{}}) {
    Effect::see(sample, [&](auto* seen) {
      varying.type->advance_slope(varying.place, varying.numbers.data(), seen, varying.memory.data(), &along,
                                  slopes.data(), next.data());
    });
    varying.accept(sample);
    slopes = next;
  }
  expect_near(varying.torque(Sample{}, varying.numbers, slopes), difference, 1e-9);
}

TEST(Slope, OfLoadFrictionFollowsTheMagnitudeOfTheForce) {
  Sample pushed, direction;
  pushed.force = {-20.0, 0.0};
  direction.force = {1.0, 1.0};
  const Effect effect("load_friction", 1, 1, {1e-3});
  EXPECT_EQ(effect.slope(pushed, direction, effect.advanced(pushed))[0], -1e-3);
}

TEST(Slope, WithoutADirectionIsZero) {
  for (Effect& effect : all_torques()) {
    PerJoint slope{};
    const effect_direction nowhere{};
    effect.accept(Sample{});
    Effect::see(Sample{}, [&](auto* seen) {
      effect.type->slope(effect.place, effect.numbers.data(), seen, effect.memory.data(), &nowhere, slope.data());
    });
    expect_near(slope, {0, 0, 0}, 0.0);
  }
}

TEST(Torque, IsLinearInItsNumbers) {
  Sample before;
  before.first = 1;
  before.velocity = {0.1, 0.4, -0.3};
  for (Effect& effect : all_torques()) {
    if (effect.type->by_parameter) {
      continue;
    }
    effect.accept(before);
    const std::vector<double> after = effect.advanced(Sample{});
    PerJoint sum{};
    for (std::size_t p = 0; p < effect.numbers.size(); ++p) {
      std::vector<double> unit(effect.numbers.size(), 0.0);
      unit[p] = 1.0;
      const PerJoint column = effect.torque(Sample{}, unit, after);
      EXPECT_NE(column, PerJoint{});
      for (std::size_t j = 0; j < joints; ++j) {
        sum[j] += effect.numbers[p] * column[j];
      }
    }
    expect_near(effect.torque(Sample{}, effect.numbers, after), sum, 1e-14);
  }
}

TEST(Torque, ThatIsNotLinearSaysItsDerivatives) {
  const double h = 1e-6;
  std::set<std::string> checked;
  for (Effect& effect : all_torques()) {
    const std::vector<double> after = effect.advanced(Sample{});
    for (std::uint32_t k = 0; effect.type->by_parameter && k < effect.numbers.size(); ++k) {
      const auto at = [&](double step) {
        std::vector<double> moved = effect.numbers;
        moved[k] += step;
        return effect.torque(Sample{}, moved, after);
      };
      PerJoint found{};
      Effect::see(Sample{}, [&](auto* seen) {
        effect.type->by_parameter(effect.place, effect.numbers.data(), k, seen, after.data(), found.data());
      });
      for (std::size_t j = 0; j < joints; ++j) {
        EXPECT_NEAR(found[j], (at(h)[j] - at(-h)[j]) / (2.0 * h), 1e-8);
      }
      checked.insert(effect.type->name);
    }
  }
  EXPECT_EQ(checked, (std::set<std::string>{"joint_coupling", "preload_friction", "pulley_eccentricity"}));
}

// --- friction --------------------------------------------------------------------------------------------------------

effect_grip grip_of(const Effect& effect) {
  return effect.type->grip(effect.place, effect.numbers.data(), effect.memory.data(), 0);
}

TEST(Friction, DriftsFromTheFirstSample) {
  Effect drift("friction_drift", 0, 0, {0.4, 5.0});
  Sample first, later;
  first.first = 1;
  first.time = -2.0;
  later.time = 1.5;
  drift.memory = drift.advanced(first);
  EXPECT_EQ(grip_of(drift).value, 1.0);
  EXPECT_EQ(grip_of(drift).by_parameter[1], 0.0);
  drift.memory = drift.advanced(later);
  EXPECT_EQ(grip_of(drift).slides, 0);
  // the numbers as they were, and another time constant after the sample
  for (const double constant : {5.0, 0.3}) {
    drift.numbers[1] = constant;
    const double left = std::exp(-3.5 / constant);
    EXPECT_NEAR(grip_of(drift).value, 1.0 + 0.4 * (1.0 - left), 1e-15);
    EXPECT_NEAR(grip_of(drift).by_parameter[0], 1.0 - left, 1e-15);
    EXPECT_NEAR(grip_of(drift).by_parameter[1], -0.4 * left * 3.5 / (constant * constant), 1e-15);
  }
  drift.numbers[1] = 1e-300;
  EXPECT_EQ(grip_of(drift).value, 1.4);
  EXPECT_EQ(grip_of(drift).by_parameter[1], 0.0);
}

TEST(Friction, NearStandstillDiffersByStribeck) {
  Effect near("stribeck", 2, 0, {-0.5, 0.1});
  near.memory = near.advanced(Sample{});
  const double share = std::exp(-2.0);  // −0.2 rad/s
  EXPECT_NEAR(grip_of(near).value, 1.0 - 0.5 * share, 1e-15);
  EXPECT_NEAR(grip_of(near).by_velocity, -0.5 * share / 0.1, 1e-14);
  EXPECT_NEAR(grip_of(near).by_parameter[0], share, 1e-15);
  EXPECT_NEAR(grip_of(near).by_parameter[1], -0.5 * share * 0.2 / 0.01, 1e-14);
}

TEST(Friction, BuildsUpOverADistance) {
  Effect presliding("presliding", 1, 0, {0.01});
  Sample first, later;
  first.first = 1;
  presliding.memory = presliding.advanced(first);
  EXPECT_EQ(grip_of(presliding).value, 0.0);
  EXPECT_EQ(grip_of(presliding).slides, 1);
  presliding.memory = presliding.advanced(later);  // 0.005 rad
  EXPECT_NEAR(grip_of(presliding).value, 1.0 - std::exp(-0.5), 1e-15);
  later.velocity[0] = -1.0;  // 0.01 rad back
  const double before = grip_of(presliding).value;
  presliding.memory = presliding.advanced(later);
  EXPECT_NEAR(grip_of(presliding).value, -1.0 + (1.0 + before) * std::exp(-1.0), 1e-15);
}

TEST(Friction, BuildsUpEverywhereByThresholds) {
  Effect presliding("presliding", 0, 0, {0.1});
  ASSERT_EQ(presliding.memory.size(), 4 * joints * (tendons + 1));
  Sample sample;
  presliding.memory = presliding.advanced(sample);
  const auto grip_at = [&](std::size_t member) {
    return presliding.type->grip(presliding.place, presliding.numbers.data(), presliding.memory.data(), member);
  };
  const auto tendon_velocity = sample.tendon_velocity();
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t i = 0; i < tendons; ++i) {
      const double ratio = tendon_velocity[j * lanes + i] * 0.01 / (0.1 * 0.0005), left = std::exp(-std::fabs(ratio));
      EXPECT_NEAR(grip_at(j * tendons + i).value, std::copysign(ratio == 0.0 ? 0.0 : 1.0 - left, ratio), 1e-15);
    }
    const double ratio = sample.velocity[j] * 0.01 / (0.1 * 0.01), left = std::exp(-std::fabs(ratio));
    EXPECT_NEAR(grip_at(joints * tendons + j).value, std::copysign(1.0 - left, ratio), 1e-15);
    EXPECT_NEAR(grip_at(joints * tendons + j).by_parameter[0], -left * ratio / 0.1, 1e-13);
    EXPECT_NEAR(grip_at(joints * tendons + j).by_motion, left * 0.01 / (0.1 * 0.01), 1e-12);
  }
}

// --- the table -------------------------------------------------------------------------------------------------------

TEST(Table, HasDifferentNamesAndNumbers) {
  std::set<std::string> names;
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; effect_at(i); ++i) {
    const effect_type* effect = effect_at(i);
    EXPECT_TRUE(names.insert(effect->name).second) << effect->name;
    EXPECT_TRUE(ids.insert(effect->id).second) << effect->name;
    EXPECT_EQ(effect_by_id(effect->id), effect);
    EXPECT_EQ(effect_by_name(effect->name), effect);
    EXPECT_LE(effect->parameter_count, std::uint32_t{EFFECT_MAX_PARAMETERS});
    EXPECT_EQ(effect->state_count || effect->memory_count, effect->advance || effect->kind == EFFECT_SIGNAL)
        << effect->name;
    for (std::uint32_t p = 0; p < effect->parameter_count; ++p) {
      const effect_parameter& number = effect->parameters[p];
      EXPECT_GT(number.scale, 0.0) << effect->name << "." << number.name;
      EXPECT_LT(number.minimum, number.maximum) << effect->name << "." << number.name;
      EXPECT_TRUE(number.unit && *number.unit) << effect->name << "." << number.name;
    }
  }
  EXPECT_GE(names.size(), 11u);
  EXPECT_EQ(effect_by_name("dragons"), nullptr);
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
    EXPECT_EQ(effect_by_id(id)->kind, EFFECT_TORQUE);
  }
}

}  // namespace
