// An effect of the core at a place of a small finger, with a sample that it sees.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "model_inside.h"

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

// An effect at a place, with its numbers and what it remembers.
struct Effect {
  const effect_type* type;
  effect_place place;
  std::vector<double> numbers, memory;

  // from 1, as in a description; 0: nowhere
  Effect(const char* name, std::uint32_t joint, std::uint32_t tendon, std::vector<double> values)
      : type(effect_by_name(name)),
        place{joint ? joint - 1 : EFFECT_NOWHERE, tendon ? tendon - 1 : EFFECT_NOWHERE},
        numbers(std::move(values)) {
    memory.resize(type->state_count ? type->state_count(joints, tendons, place) : type->memory_count, 0.0);
  }

  // calls with the sample as an effect sees it
  template <class Call>
  static void see(const Sample& sample, Call call) {
    const auto velocity = sample.tendon_velocity();
    effect_sample seen{};
    seen.joints = joints;
    seen.tendons = tendons;
    seen.lanes = lanes;
    seen.first = sample.first;
    seen.source = 3;
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
    call(&seen);
  }

  std::vector<double> advanced(const Sample& sample) const {
    std::vector<double> after(memory.size(), std::numeric_limits<double>::quiet_NaN());
    if (type->advance) {
      see(sample, [&](auto* seen) { type->advance(place, numbers.data(), seen, memory.data(), after.data()); });
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

  PerJoint torque(const Sample& sample, const std::vector<double>& parameters, const std::vector<double>& after) const {
    PerJoint result{1.0, 2.0, 3.0};  // it adds
    see(sample, [&](auto* seen) { type->torque(place, parameters.data(), seen, after.data(), result.data()); });
    return {result[0] - 1.0, result[1] - 2.0, result[2] - 3.0};
  }
  PerJoint torque(const Sample& sample) const { return torque(sample, numbers, advanced(sample)); }

  PerJoint accept(const Sample& sample) {
    memory = advanced(sample);
    return torque(sample, numbers, memory);
  }

  PerJoint slope(const Sample& sample, const Sample& direction, const std::vector<double>& after) const {
    PerJoint result{};
    const effect_direction along = along_of(direction);
    see(sample, [&](auto* seen) { type->slope(place, numbers.data(), seen, after.data(), &along, result.data()); });
    return result;
  }
};

inline void expect_near(const PerJoint& found, const PerJoint& expected, double tolerance = 1e-15) {
  for (std::size_t j = 0; j < joints; ++j) {
    EXPECT_NEAR(found[j], expected[j], tolerance) << "joint " << j + 1;
  }
}
