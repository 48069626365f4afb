// tendonfmu.hpp: what it adds to the C interface, and that it takes nothing away. Compiled as C++17 and as C++20.
#include "tendonfmu.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "allocation_count.h"
#include "test_finger.h"

using tendonfmu::span;
using tendonfmu::status;
using test_finger::joints;
using test_finger::Motion;
using test_finger::Outputs;
using test_finger::tendons;

namespace {

static_assert(!std::is_copy_constructible_v<tendonfmu::finger> && !std::is_copy_assignable_v<tendonfmu::finger>);
static_assert(std::is_nothrow_move_constructible_v<tendonfmu::finger>);
static_assert(std::is_nothrow_move_assignable_v<tendonfmu::finger>);
static_assert(!std::is_copy_constructible_v<tendonfmu::image>);

// a span of what must not change, or not outlive the call, is a span of const
static_assert(std::is_convertible_v<std::vector<double>&, span<double>>);
static_assert(std::is_convertible_v<const std::vector<double>&, span<const double>>);
static_assert(std::is_convertible_v<std::vector<double>, span<const double>>);
static_assert(std::is_convertible_v<std::array<double, 3>&, span<double>>);
static_assert(std::is_convertible_v<double (&)[3], span<const double>>);
static_assert(std::is_convertible_v<span<double>, span<const double>>);
static_assert(!std::is_convertible_v<std::vector<double>, span<double>>);
static_assert(!std::is_convertible_v<const std::vector<double>&, span<double>>);
static_assert(!std::is_convertible_v<span<const double>, span<double>>);
static_assert(!std::is_convertible_v<std::vector<float>&, span<const double>>);
static_assert(!std::is_convertible_v<double&, span<double>>);
#if defined(__cpp_lib_span)
static_assert(std::is_convertible_v<span<double>, std::span<double>>);
static_assert(std::is_convertible_v<span<double>, std::span<const double>>);
static_assert(std::is_convertible_v<std::span<double>, span<const double>>);
static_assert(std::is_convertible_v<std::span<double>, span<double>>);
static_assert(!std::is_convertible_v<std::span<const double>, span<double>>);
#endif

tendonfmu::inputs row(const Motion& motion, std::size_t k) {
  return {{&motion.force[k * tendons], tendons},
          {&motion.position[k * tendons], tendons},
          {&motion.angle[k * joints], joints},
          {&motion.velocity[k * joints], joints}};
}

// Rows from `begin` on of all that Outputs has room for.
tendonfmu::outputs rows(Outputs& o, std::size_t begin, std::size_t samples) {
  tendonfmu::outputs wanted;
  tendonfmu_outputs view = o.view();
  tendonfmu::detail::for_each_output(
      wanted, view, joints, tendons, [&](const char*, const auto& array, auto* row, std::size_t size) {
        const_cast<std::decay_t<decltype(array)>&>(array) = {row + begin * size, samples * size};
      });
  return wanted;
}

tendonfmu::finger made(const std::string& text = test_finger::json) {
  return tendonfmu::finger::from_json(text).value();
}

// Samples from..to, one by one; returns how many were refused.
int steps(tendonfmu::finger& finger, const Motion& motion, std::size_t from, std::size_t to, Outputs& outputs) {
  int refused = 0;
  for (std::size_t k = from; k < to; ++k) {
    const tendonfmu::inputs sample = row(motion, k);
    refused += (finger.is_initialised() ? finger.step(motion.time[k], sample)
                                        : finger.initialise(motion.time[k], sample)) != status::ok;
    refused += finger.get_outputs(rows(outputs, k, 1)) != status::ok;
  }
  return refused;
}

Outputs by_c(const std::string& text, const Motion& motion) {
  return test_finger::Finger(test_finger::image(text)).run(motion);
}

TEST(CppFinger, GivesTheBitsOfTheCInterface) {
  const Motion motion(4000);
  for (const std::string& text : {std::string(test_finger::json), test_finger::every_key(),
                                  test_finger::watched_sensors(), test_finger::every_effect()}) {
    tendonfmu::finger finger = made(text), batch = made(text);
    ASSERT_EQ(finger.joint_count(), joints);
    ASSERT_EQ(finger.tendon_count(), tendons);
    Outputs outputs(motion.time.size()), of_batch(motion.time.size());
    EXPECT_EQ(steps(finger, motion, 0, motion.time.size(), outputs), 0);
    EXPECT_TRUE(outputs == by_c(text, motion));
    std::size_t done = 0;
    ASSERT_EQ(batch.run(motion.time, {motion.force, motion.position}, rows(of_batch, 0, motion.time.size()), done),
              status::ok);
    EXPECT_EQ(done, motion.time.size());
    EXPECT_TRUE(of_batch == outputs);
    EXPECT_EQ(batch.get_time(), motion.time.back());
    // and the derivative
    const std::array<double, tendons> direction = {1.0, -0.5, 0.25};
    std::array<double, joints> slope = {}, slope_by_c = {};
    tendonfmu::outputs wanted;
    wanted.compensated_torque = slope;
    ASSERT_EQ(finger.get_directional_derivative({direction}, wanted), status::ok);
    const tendonfmu_inputs along = {direction.data(), nullptr, nullptr, nullptr};
    tendonfmu_outputs derivative = {};
    derivative.compensated_torque = slope_by_c.data();
    ASSERT_EQ(tendonfmu_get_directional_derivative(finger.handle(), &along, &derivative), TENDONFMU_OK);
    EXPECT_EQ(slope, slope_by_c);
    EXPECT_NE(slope[0], 0.0);
  }
}

TEST(CppFinger, HasTheSettingsOfTheCInterface) {
  tendonfmu::finger finger = made();
  EXPECT_EQ(finger.set_kernel("plain"), status::ok);
  EXPECT_STREQ(finger.get_kernel(), "plain");
  EXPECT_EQ(finger.set_kernel("abacus"), status::bad_argument);
  ASSERT_EQ(finger.set_kinematics_source(tendonfmu::kinematics_source::joint_velocities), status::ok);
  EXPECT_EQ(finger.get_kinematics_source(), tendonfmu::kinematics_source::joint_velocities);
}

TEST(CppFinger, AnotherSizeIsRefusedByName) {
  const Motion motion(2);
  tendonfmu::finger finger = made();
  const tendonfmu::inputs good = row(motion, 0);
  EXPECT_EQ(finger.initialise(0.0, {{motion.force.data(), 2}, good.tendon_position}), status::bad_argument);
  EXPECT_STREQ(finger.last_error(), "tendon_force: 2 values, expected 3");
  EXPECT_FALSE(finger.is_initialised());
  EXPECT_EQ(finger.initialise(0.0, {good.tendon_force, {motion.position.data(), 4}}), status::bad_argument);
  EXPECT_STREQ(finger.last_error(), "tendon_position: 4 values, expected 3");
  ASSERT_EQ(finger.initialise(0.0, good), status::ok);

  std::vector<double> two(2), three(3);
  tendonfmu::outputs wanted;
  wanted.compensated_torque = two;
  EXPECT_EQ(finger.get_outputs(wanted), status::ok);
  wanted.contact_terms = three;
  EXPECT_EQ(finger.get_outputs(wanted), status::bad_argument);
  EXPECT_STREQ(finger.last_error(), "contact_terms: 3 values, expected 64");

  std::size_t done = 9;
  EXPECT_EQ(finger.run(motion.time, {motion.force, motion.position}, wanted, done), status::bad_argument);
  EXPECT_EQ(done, 0u);
  EXPECT_STREQ(finger.last_error(), "compensated_torque: 2 values, expected 4");
  const std::size_t index = 0;
  EXPECT_EQ(finger.set_parameters({&index, 1}, two), status::bad_argument);
  EXPECT_STREQ(finger.last_error(), "indices: 1 values, expected 2");
}

TEST(CppFinger, RefusalsOfTheCInterfaceComeWithTheirReason) {
  const Motion motion(2);
  tendonfmu::finger finger = made();
  EXPECT_EQ(finger.step(0.0, row(motion, 0)), status::wrong_order);
  EXPECT_STREQ(finger.last_error(), "a step before the first sample: expected tendonfmu_initialise()");
  EXPECT_EQ(finger.initialise(0.0, {{motion.force.data(), tendons}, {}}), status::bad_sample);
  EXPECT_EQ(std::string(finger.last_error()).rfind("tendon_position is missing", 0), 0u) << finger.last_error();
  ASSERT_EQ(finger.initialise(1.0, row(motion, 0)), status::ok);
  EXPECT_EQ(finger.step(0.5, row(motion, 1)), status::bad_sample);
  EXPECT_EQ(std::string(finger.last_error()).rfind("time = 0.5", 0), 0u) << finger.last_error();
  const std::array<double, tendons> force = {1.0, NAN, 1.0};
  // the last reason counts, whoever gave it
  EXPECT_EQ(finger.step(2.0, {{force.data(), 2}}), status::bad_argument);
  EXPECT_STREQ(finger.last_error(), "tendon_force: 2 values, expected 3");
  EXPECT_EQ(finger.set_parameter("joints[1].friction.statik", 1.0), status::bad_argument);
  EXPECT_NE(std::string(finger.last_error()).find("statik"), std::string::npos) << finger.last_error();
}

TEST(CppFinger, WhatCannotBeMadeSaysWhy) {
  const std::string refused = R"({"format": "tendonfmu-finger-1", "joints": []})";
  auto read = tendonfmu::finger::from_json(refused);
  EXPECT_FALSE(read);
  EXPECT_EQ(read.code(), status::bad_image);
  EXPECT_NE(std::string(read.message()).find("name: missing"), std::string::npos) << read.message();
  EXPECT_FALSE(*read);

  std::vector<unsigned char> image = test_finger::image();
  image[image.size() / 2] ^= 1;
  auto created = tendonfmu::finger::create(image);
  EXPECT_EQ(created.code(), status::bad_image);
  EXPECT_STRNE(created.message(), "");
  EXPECT_FALSE(tendonfmu::finger::create({}));

  try {
    const tendonfmu::finger finger(image);
    FAIL() << "a damaged image was taken";
  } catch (const tendonfmu::error& caught) {
    EXPECT_EQ(caught.code(), status::bad_image);
    EXPECT_STREQ(caught.what(), created.message());
  }
  EXPECT_THROW(tendonfmu::image::from_json("{").value(), tendonfmu::error);
}

TEST(CppFinger, MovesKeepTheStateAndLeaveAnEmptyOne) {
  const Motion motion(2000);
  Outputs outputs(motion.time.size());
  tendonfmu::finger first(test_finger::image());
  EXPECT_EQ(steps(first, motion, 0, 500, outputs), 0);
  tendonfmu::finger second(std::move(first));
  EXPECT_EQ(steps(second, motion, 500, 1000, outputs), 0);
  tendonfmu::finger third = made(test_finger::every_key()); /* freed by the assignment */
  third = std::move(second);
  EXPECT_EQ(steps(third, motion, 1000, 1500, outputs), 0);
  std::vector<tendonfmu::finger> several;
  several.push_back(std::move(third));
  several.reserve(several.capacity() + 1);
  EXPECT_EQ(steps(several[0], motion, 1500, 2000, outputs), 0);
  EXPECT_TRUE(outputs == by_c(test_finger::json, motion));

  for (tendonfmu::finger* empty : {&first, &second, &third}) {
    EXPECT_FALSE(*empty);
    EXPECT_EQ(empty->joint_count(), 0u);
    EXPECT_EQ(empty->state_size(), 0u);
    EXPECT_EQ(empty->step(3.0, row(motion, 0)), status::bad_argument);
    EXPECT_EQ(empty->set_parameter("contact.threshold[1]", 1.0), status::bad_argument);
    EXPECT_STREQ(empty->last_error(), "no finger: NULL");
  }
}

TEST(CppFinger, AStateGoesOnInAnotherFinger) {
  const Motion motion(2000);
  Outputs outputs(motion.time.size()), again(motion.time.size());
  tendonfmu::finger finger = made(test_finger::every_key()), other = made(test_finger::every_key());
  EXPECT_EQ(steps(finger, motion, 0, 1000, outputs), 0);
  EXPECT_EQ(steps(other, motion, 0, 1000, again), 0);
  std::vector<unsigned char> state(finger.state_size());
  ASSERT_EQ(finger.save_state(state), status::ok);
  EXPECT_EQ(other.reset(), status::ok);
  ASSERT_EQ(other.restore_state(state), status::ok);
  EXPECT_EQ(steps(finger, motion, 1000, 2000, outputs), 0);
  EXPECT_EQ(steps(other, motion, 1000, 2000, again), 0);
  EXPECT_TRUE(outputs == again);
  EXPECT_EQ(other.save_state({state.data(), state.size() - 1}), status::bad_argument);
  EXPECT_EQ(made().restore_state(state), status::bad_state);
}

TEST(CppFinger, ParametersHaveAPathAnIndexAndAValue) {
  tendonfmu::finger finger = made();
  const char* const path = "joints[1].friction.static";
  double value = 0.0;
  ASSERT_EQ(finger.set_parameter(path, 0.0041), status::ok);
  ASSERT_EQ(finger.get_parameter(path, value), status::ok);
  EXPECT_EQ(value, 0.0041);
  const std::size_t index = finger.find_parameter(path);
  ASSERT_LT(index, finger.parameter_count());
  EXPECT_EQ(finger.find_parameter("no such path"), finger.parameter_count());
  ASSERT_EQ(finger.get_parameters(tendonfmu::one(index), tendonfmu::one(value)), status::ok);
  EXPECT_EQ(value, 0.0041);
  std::array<char, 80> found = {};
  ASSERT_EQ(finger.get_parameter_path(index, found), status::ok);
  EXPECT_STREQ(found.data(), path);
  tendonfmu_parameter_info info;
  ASSERT_EQ(finger.get_parameter_info(index, info), status::ok);
  EXPECT_EQ(info.start, 0.004);
  std::vector<double> all(finger.parameter_count());
  ASSERT_EQ(finger.get_parameters({}, all), status::ok);
  EXPECT_EQ(all[index], 0.0041);
  all[index] = -1.0;
  EXPECT_EQ(finger.set_parameters({}, all), status::bad_parameter);
  EXPECT_NE(std::string(finger.last_error()).find(path), std::string::npos) << finger.last_error();
}

TEST(CppFinger, LivesInMemoryOfTheCaller) {
  const Motion motion(1000);
  const std::vector<unsigned char> image = test_finger::image();
  std::vector<unsigned char> memory(tendonfmu::finger::memory_size(image));
  auto short_of = tendonfmu::finger::place({memory.data(), memory.size() - 1}, image);
  EXPECT_NE(std::string(short_of.message()).find("too little memory"), std::string::npos) << short_of.message();
  Outputs outputs(motion.time.size());
  {
    tendonfmu::finger placed = tendonfmu::finger::place(memory, image).value();
    tendonfmu::finger moved = std::move(placed);
    const auto* at = reinterpret_cast<const unsigned char*>(moved.handle());
    EXPECT_TRUE(at >= memory.data() && at < memory.data() + memory.size());
    EXPECT_EQ(steps(moved, motion, 0, 1000, outputs), 0);
  }
  EXPECT_TRUE(outputs == by_c(test_finger::json, motion));
}

TEST(CppFinger, ALoopAllocatesNothing) {
#if !defined(COUNTS_ALLOCATIONS)
  GTEST_SKIP() << "SKIPPED: malloc can only be counted with glibc and without sanitizers";
#else
  const Motion motion(2000);
  Outputs outputs(motion.time.size());
  tendonfmu::finger finger = made(test_finger::every_effect());
  std::vector<unsigned char> state(finger.state_size());
  ASSERT_TRUE(allocations_count());
  count_allocations_anew();
  int wrong = steps(finger, motion, 0, 2000, outputs);
  wrong += finger.save_state(state) != status::ok;
  wrong += finger.set_parameter("contact.threshold[1]", 0.05) != status::ok;
  wrong += finger.restore_state(state) != status::ok;
  wrong += finger.step(3.0, {{motion.force.data(), 2}}) != status::bad_argument; /* refused, with a reason */
  wrong += finger.step(0.0, row(motion, 0)) != status::bad_sample;
  tendonfmu::finger moved = std::move(finger);
  wrong += moved.reset() != status::ok;
  const long counted = counted_allocations();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(counted, 0);
#endif
}

}  // namespace
