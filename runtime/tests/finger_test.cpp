// The public interface as a control loop and a simulator use it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "test_finger.h"

using test_finger::Finger;
using test_finger::joints;
using test_finger::Motion;
using test_finger::Outputs;
using test_finger::tendons;

namespace {

constexpr std::size_t samples = 4000;

const Motion& motion() {
  static const Motion m(samples);
  return m;
}

Outputs run(Finger& finger, std::size_t from = 0, std::size_t to = samples) {
  Outputs outputs(to - from);
  const tendonfmu_outputs view = outputs.view();
  const tendonfmu_inputs inputs = motion().row(from);
  std::size_t done = 0;
  EXPECT_EQ(tendonfmu_run(finger, to - from, &motion().time[from], &inputs, &view, &done), TENDONFMU_OK)
      << tendonfmu_last_error(finger);
  EXPECT_EQ(done, to - from);
  return outputs;
}

TEST(Finger, MotionOfTheTestsMovesRestsTouchesAndReverses) {
  Finger finger;
  const Outputs o = run(finger);
  std::size_t contacts = 0, rests = 0, forwards = 0, backwards = 0;
  for (std::size_t k = 0; k < samples; ++k) {
    contacts += o.contact[k];
    forwards += o.speed[k * joints] > 0.5;
    backwards += o.speed[k * joints] < -0.5;
    rests += std::abs(o.speed[k * joints]) < 0.02;
  }
  EXPECT_GT(contacts, samples / 50);
  EXPECT_LT(contacts, samples / 2);
  EXPECT_GT(rests, samples / 20);
  EXPECT_GT(forwards, samples / 10);
  EXPECT_GT(backwards, samples / 10);
}

TEST(Finger, AllKernelsGiveTheSameBits) {
  for (int source = 1; source <= 3; ++source) {
    Finger plain;
    ASSERT_EQ(tendonfmu_set_kernel(plain, "plain"), TENDONFMU_OK);
    tendonfmu_set_kinematics_source(plain, source);
    const Outputs expected = run(plain);
    int compared = 0;
    for (const char* name : {"sse2", "avx2", "auto"}) {
      Finger other;
      if (tendonfmu_set_kernel(other, name) != TENDONFMU_OK) {
        continue;
      }
      tendonfmu_set_kinematics_source(other, source);
      EXPECT_TRUE(run(other) == expected) << name << ", source " << source;
      EXPECT_EQ(other.saved(), plain.saved()) << name;
      ++compared;
    }
    EXPECT_GE(compared, 1);
  }
}

TEST(Finger, UnknownKernelIsRefused) {
  Finger finger;
  const std::string before = tendonfmu_get_kernel(finger);
  EXPECT_EQ(tendonfmu_set_kernel(finger, "quantum"), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_get_kernel(finger), before);
}

TEST(Finger, BatchEqualsSingleSteps) {
  Finger batch, single;
  const Outputs expected = run(batch);
  Outputs one(1);
  const tendonfmu_outputs view = one.view();
  for (std::size_t k = 0; k < samples; ++k) {
    const tendonfmu_inputs inputs = motion().row(k);
    const auto call = k == 0 ? tendonfmu_initialise : tendonfmu_step;
    ASSERT_EQ(call(single, motion().time[k], &inputs), TENDONFMU_OK);
    ASSERT_EQ(tendonfmu_get_outputs(single, &view), TENDONFMU_OK);
    for (std::size_t j = 0; j < joints; ++j) {
      ASSERT_EQ(one.compensated[j], expected.compensated[k * joints + j]);
      ASSERT_EQ(one.bias[j], expected.bias[k * joints + j]);
    }
    ASSERT_EQ(one.contact[0], expected.contact[k]);
  }
}

TEST(Finger, RestoredStateContinuesBitForBit) {
  Finger whole;
  const Outputs expected = run(whole);
  for (std::size_t cut : {std::size_t{1}, std::size_t{777}, std::size_t{1900}, std::size_t{3999}}) {
    Finger first, second;
    run(first, 0, cut);
    const auto bytes = first.saved();
    ASSERT_EQ(tendonfmu_restore_state(second, bytes.data(), bytes.size()), TENDONFMU_OK);
    const Outputs rest = run(second, cut, samples);
    for (std::size_t k = 0; k < rest.compensated.size(); ++k) {
      ASSERT_EQ(rest.compensated[k], expected.compensated[cut * joints + k]);
    }
  }
}

TEST(Finger, RestoredStateBringsItsParameters) {
  Finger tuned, plain;
  ASSERT_EQ(tendonfmu_set_parameter(tuned, "joints[1].friction.coulomb", 0.001), TENDONFMU_OK);
  const auto bytes = tuned.saved();
  ASSERT_EQ(tendonfmu_restore_state(plain, bytes.data(), bytes.size()), TENDONFMU_OK);
  double value = 0.0;
  ASSERT_EQ(tendonfmu_get_parameter(plain, "joints[1].friction.coulomb", &value), TENDONFMU_OK);
  EXPECT_EQ(value, 0.001);
  EXPECT_TRUE(run(plain) == run(tuned));
}

TEST(Finger, DamagedStateIsRefusedAndChangesNothing) {
  Finger finger;
  run(finger, 0, 500);
  const auto good = finger.saved();
  run(finger, 500, 600);
  const auto before = finger.saved();
  for (std::size_t at = 0; at < good.size(); at += 13) {
    auto bad = good;
    bad[at] ^= 0x20;
    EXPECT_EQ(tendonfmu_restore_state(finger, bad.data(), bad.size()), TENDONFMU_BAD_STATE) << at;
    EXPECT_NE(std::string(tendonfmu_last_error(finger)), "");
  }
  EXPECT_EQ(tendonfmu_restore_state(finger, good.data(), good.size() - 1), TENDONFMU_BAD_STATE);
  EXPECT_EQ(finger.saved(), before);
}

TEST(Finger, StateOfAnotherFingerIsRefused) {
  std::string text = test_finger::json;
  text.replace(text.find("0.008, 0.006"), 12, "0.009, 0.006");
  Finger one, other(test_finger::image(text));
  const auto bytes = other.saved();
  EXPECT_EQ(tendonfmu_restore_state(one, bytes.data(), bytes.size()), TENDONFMU_BAD_STATE);
}

TEST(Finger, BadSamplesAreRefusedByNameAndChangeNothing) {
  Finger finger;
  run(finger, 0, 100);
  const auto before = finger.saved();
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (double bad : {nan, inf, -inf, 1e13}) {
    for (std::size_t i = 0; i < tendons; ++i) {
      std::vector<double> force(tendons, 5.0), position(tendons, 0.01);
      const tendonfmu_inputs inputs = {force.data(), position.data(), nullptr, nullptr};
      force[i] = bad;
      EXPECT_EQ(tendonfmu_step(finger, 0.1, &inputs), TENDONFMU_BAD_SAMPLE);
      EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("tendon_force[" + std::to_string(i + 1) + "]"),
                std::string::npos);
      force[i] = 5.0;
      position[i] = bad;
      EXPECT_EQ(tendonfmu_step(finger, 0.1, &inputs), TENDONFMU_BAD_SAMPLE);
      EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("tendon_position["), std::string::npos);
    }
  }
  for (double time : {nan, inf, 0.0989, -1.0}) {
    const tendonfmu_inputs inputs = motion().row(100);
    EXPECT_EQ(tendonfmu_step(finger, time, &inputs), TENDONFMU_BAD_SAMPLE) << time;
    EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("time"), std::string::npos);
  }
  EXPECT_EQ(finger.saved(), before);
}

TEST(Finger, OverflowIsRefusedAndChangesNothing) {
  std::string text = test_finger::json;
  text.replace(text.find("\"viscous\": 0.3"), 14, "\"viscous\": 1e9");
  Finger finger(test_finger::image(text));
  tendonfmu_set_kinematics_source(finger, 3);
  const std::vector<double> force(tendons, 1e12), angle(joints, 0.0);
  std::vector<double> velocity(joints, 0.0);
  const tendonfmu_inputs inputs = {force.data(), nullptr, angle.data(), velocity.data()};
  ASSERT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK);
  const auto before = finger.saved();
  velocity.assign(joints, -1e12);
  const tendonfmu_status status = tendonfmu_step(finger, 1.0, &inputs);
  if (status == TENDONFMU_OK) { /* large but finite is as good */
    double torque[joints];
    tendonfmu_outputs view = {};
    view.friction_torque = torque;
    tendonfmu_get_outputs(finger, &view);
    EXPECT_TRUE(std::isfinite(torque[0]) && std::isfinite(torque[1]));
  } else {
    EXPECT_EQ(status, TENDONFMU_BAD_SAMPLE);
    EXPECT_EQ(finger.saved(), before);
  }
}

TEST(Finger, ShortestStepDoesNotPoisonTheState) {
  Finger finger;
  tendonfmu_inputs inputs = motion().row(0);
  ASSERT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK);
  const auto before = finger.saved();
  inputs = motion().row(1500);
  const tendonfmu_status status = tendonfmu_step(finger, std::numeric_limits<double>::denorm_min(), &inputs);
  if (status != TENDONFMU_OK) {
    EXPECT_EQ(finger.saved(), before);
  }
  EXPECT_EQ(tendonfmu_step(finger, 1e12, &inputs), TENDONFMU_OK) << tendonfmu_last_error(finger);
}

TEST(Finger, RefusedRowOfABatchIsNamedAndRowsBeforeItAreWritten) {
  Motion broken(200);
  broken.force[150 * tendons + 1] = NAN;
  Finger finger;
  Outputs outputs(200);
  const tendonfmu_outputs view = outputs.view();
  const tendonfmu_inputs inputs = broken.all();
  std::size_t done = 0;
  EXPECT_EQ(tendonfmu_run(finger, 200, broken.time.data(), &inputs, &view, &done), TENDONFMU_BAD_SAMPLE);
  EXPECT_EQ(done, 150u);
  EXPECT_TRUE(std::isfinite(outputs.compensated[149 * joints]));
  EXPECT_TRUE(std::isnan(outputs.compensated[150 * joints]));
}

// the bias may learn from nothing before row 40, and a torque is known
std::vector<double> run_guided(Finger& finger, tendonfmu_status expected = TENDONFMU_OK) {
  std::vector<unsigned char> learns(300);
  std::vector<double> known(300 * joints), variance(300 * joints);
  for (std::size_t k = 0; k < 300; ++k) {
    learns[k] = k > 40 && k % 50 > 10;
    known[k * joints] = 1e-3 * static_cast<double>(k);
  }
  Outputs outputs(300);
  const tendonfmu_outputs view = outputs.view();
  const tendonfmu_inputs inputs = motion().row(0);
  const tendonfmu_guide guide = {learns.data(), known.data(), variance.data()};
  EXPECT_EQ(tendonfmu_run_guided(finger, 300, motion().time.data(), &inputs, &guide, &view, nullptr), expected);
  outputs.bias.insert(outputs.bias.end(), variance.begin() + 60 * joints, variance.end());
  return outputs.bias;
}

TEST(Finger, GuidedRunGivesTheSameBitsWithAllKernels) {
  Finger plain;
  ASSERT_EQ(tendonfmu_set_kernel(plain, "plain"), TENDONFMU_OK);
  const std::vector<double> expected = run_guided(plain);
  for (const char* kernel : {"sse2", "avx2"}) {
    Finger other;
    if (tendonfmu_set_kernel(other, kernel) == TENDONFMU_OK) {
      EXPECT_EQ(run_guided(other), expected) << kernel;
    }
  }
}

TEST(Finger, GuidedRunBeginsAnewAndLeavesNoTrace) {
  Finger finger, fresh;
  run_guided(finger);
  run_guided(finger, TENDONFMU_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_reset(finger), TENDONFMU_OK);
  EXPECT_EQ(run(finger).bias, run(fresh).bias);
  EXPECT_EQ(finger.saved(), fresh.saved());
  Finger watching(test_finger::image(test_finger::watched_sensors()));
  run_guided(watching, TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_run_guided(fresh, 1, motion().time.data(), nullptr, nullptr, nullptr, nullptr),
            TENDONFMU_BAD_ARGUMENT);
}

TEST(Finger, SameTimeAgainChangesNothing) {
  Finger finger;
  run(finger, 0, 300);
  const auto before = finger.saved();
  const tendonfmu_inputs other = motion().row(1700);
  EXPECT_EQ(tendonfmu_step(finger, motion().time[299], &other), TENDONFMU_OK);
  EXPECT_EQ(finger.saved(), before);
}

// Without a filter ∂v/∂q is 1/Δt, which overflows; the state must stay one that can be restored.
TEST(Finger, ShortestStepAtRestLeavesAStateThatRestores) {
  Finger finger;
  ASSERT_EQ(tendonfmu_set_parameter(finger, "velocity_filter_cutoff", 0.0), TENDONFMU_OK);
  const tendonfmu_inputs inputs = motion().row(0);
  ASSERT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK);
  ASSERT_EQ(tendonfmu_step(finger, std::numeric_limits<double>::denorm_min(), &inputs), TENDONFMU_OK);
  const auto bytes = finger.saved();
  EXPECT_EQ(tendonfmu_restore_state(finger, bytes.data(), bytes.size()), TENDONFMU_OK) << tendonfmu_last_error(finger);
  double speed[joints];
  const double still[tendons] = {};
  const tendonfmu_inputs direction = {still, still, nullptr, nullptr};
  tendonfmu_outputs view = {};
  view.joint_speed = speed;
  ASSERT_EQ(tendonfmu_get_directional_derivative(finger, &direction, &view), TENDONFMU_OK);
  EXPECT_EQ(speed[0], 0.0);
}

TEST(Finger, SoftestSpringDoesNotPoisonTheAngles) {
  std::string text = test_finger::json;
  text.replace(text.find("\"stiffness\": 5000"), 17, "\"stiffness\": 1e-320");
  Finger finger(test_finger::image(text));
  const double force[tendons] = {5.0, 5.0, 0.0}, position[tendons] = {};
  const tendonfmu_inputs inputs = {force, position, nullptr, nullptr};
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK) << tendonfmu_last_error(finger);
}

TEST(Finger, MissingArgumentIsRefusedInWords) {
  Finger finger;
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("missing"), std::string::npos);
  EXPECT_EQ(tendonfmu_set_parameter(finger, nullptr, 1.0), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_step(nullptr, 0.0, nullptr), TENDONFMU_BAD_ARGUMENT);
}

TEST(Finger, OrderOfCallsIsHeld) {
  Finger finger;
  const tendonfmu_inputs inputs = motion().row(0);
  double torque[joints];
  tendonfmu_outputs view = {};
  view.joint_torque = torque;
  EXPECT_EQ(tendonfmu_step(finger, 0.0, &inputs), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_get_outputs(finger, &view), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_get_directional_derivative(finger, &inputs, &view), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK);
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_kinematics_source(finger, 2), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "tendons[1].stiffness", 1000.0), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "tendons[1].pulley_friction[1].coulomb", 0.01), TENDONFMU_OK);
}

TEST(Finger, MissingInputOfTheSourceIsNamed) {
  Finger finger;
  tendonfmu_set_kinematics_source(finger, 2);
  tendonfmu_inputs inputs = motion().row(0);
  inputs.joint_position = nullptr;
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_BAD_SAMPLE);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("joint_position is missing"), std::string::npos);
}

TEST(Finger, ResetGivesTheFingerOfTheImage) {
  Finger fresh, used;
  run(used, 0, 900);
  tendonfmu_set_parameter(used, "contact.threshold[1]", 9.0);
  ASSERT_EQ(tendonfmu_reset(used), TENDONFMU_OK);
  EXPECT_EQ(used.saved(), fresh.saved());
}

TEST(Finger, PlacedAtAnyAddressItBehavesTheSame) {
  const auto bytes = test_finger::image();
  Finger created(bytes);
  const Outputs expected = run(created);
  const std::size_t size = tendonfmu_memory_size(bytes.data(), bytes.size());
  std::vector<unsigned char> memory(size + 64);
  for (std::size_t shift : {0, 1, 7, 33}) {
    char message[200];
    tendonfmu_finger* placed =
        tendonfmu_place(memory.data() + shift, size, bytes.data(), bytes.size(), message, sizeof message);
    ASSERT_NE(placed, nullptr) << message;
    Outputs outputs(samples);
    const tendonfmu_outputs view = outputs.view();
    const tendonfmu_inputs inputs = motion().all();
    ASSERT_EQ(tendonfmu_run(placed, samples, motion().time.data(), &inputs, &view, nullptr), TENDONFMU_OK);
    EXPECT_TRUE(outputs == expected);
  }
  char message[200];
  EXPECT_EQ(tendonfmu_place(memory.data(), size - 1, bytes.data(), bytes.size(), message, sizeof message), nullptr);
  EXPECT_NE(std::string(message).find("too little memory"), std::string::npos);
}

TEST(Finger, ParametersAreWrittenAllOrNone) {
  Finger finger;
  const std::size_t fs = tendonfmu_find_parameter(finger, "joints[1].friction.static");
  const std::size_t fc = tendonfmu_find_parameter(finger, "joints[1].friction.coulomb");
  const std::size_t both[] = {fs, fc};
  const double raised[] = {0.02, 0.015}, crossed[] = {0.01, 0.015}, negative[] = {0.02, -1.0};
  const auto before = finger.saved();
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, crossed), TENDONFMU_BAD_PARAMETER);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("at least coulomb"), std::string::npos);
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, negative), TENDONFMU_BAD_PARAMETER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "joints[1].friction.static", NAN), TENDONFMU_BAD_PARAMETER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "joints[9].friction.static", 1.0), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(finger.saved(), before);
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, raised), TENDONFMU_OK);
  EXPECT_NE(finger.saved(), before);
}

TEST(Finger, EveryParameterHasAPathThatFindsIt) {
  Finger finger;
  const std::size_t count = tendonfmu_parameter_count(finger);
  ASSERT_GT(count, 50u);
  for (std::size_t i = 0; i < count; ++i) {
    char path[80];
    ASSERT_EQ(tendonfmu_get_parameter_path(finger, i, path, sizeof path), TENDONFMU_OK);
    EXPECT_EQ(tendonfmu_find_parameter(finger, path), i) << path;
    tendonfmu_parameter_info info;
    ASSERT_EQ(tendonfmu_get_parameter_info(finger, i, &info), TENDONFMU_OK);
    EXPECT_LE(info.minimum, info.start) << path;
    EXPECT_GE(info.maximum, info.start) << path;
    EXPECT_STRNE(info.unit, "") << path;
  }
}

// Central differences on samples whose branches both neighbours share.
TEST(Finger, DirectionalDerivativeMatchesCentralDifferences) {
  for (int source = 1; source <= 3; ++source) {
    Finger finger;
    tendonfmu_set_kinematics_source(finger, source);
    std::size_t checked = 0;
    for (std::size_t k = 0; k < samples; ++k) {
      const auto before = finger.saved();
      const tendonfmu_inputs at = motion().row(k);
      const auto call = k == 0 ? tendonfmu_initialise : tendonfmu_step;
      if (k % 37 == 5) {
        double direction_force[tendons], direction_position[tendons], direction_angle[joints], direction_speed[joints];
        for (std::size_t i = 0; i < tendons; ++i) {
          direction_force[i] = std::sin(1.0 + static_cast<double>(i + k));
          direction_position[i] = 1e-3 * std::cos(2.0 + static_cast<double>(i * 3 + k));
        }
        for (std::size_t j = 0; j < joints; ++j) {
          direction_angle[j] = 0.1 * std::sin(3.0 + static_cast<double>(j + k));
          direction_speed[j] = std::cos(static_cast<double>(j + 2 * k));
        }
        const tendonfmu_inputs direction = {direction_force, direction_position, direction_angle, direction_speed};
        const double h = 1e-6;
        Outputs sides[2] = {Outputs(1), Outputs(1)};
        for (int s = 0; s < 2; ++s) {
          const double step = s == 0 ? -h : h;
          std::vector<double> f(at.tendon_force, at.tendon_force + tendons),
              x(at.tendon_position, at.tendon_position + tendons), q(at.joint_position, at.joint_position + joints),
              v(at.joint_velocity, at.joint_velocity + joints);
          for (std::size_t i = 0; i < tendons; ++i) {
            f[i] += step * direction_force[i];
            x[i] += step * direction_position[i];
          }
          for (std::size_t j = 0; j < joints; ++j) {
            q[j] += step * direction_angle[j];
            v[j] += step * direction_speed[j];
          }
          const tendonfmu_inputs moved = {f.data(), x.data(), q.data(), v.data()};
          ASSERT_EQ(tendonfmu_restore_state(finger, before.data(), before.size()), TENDONFMU_OK);
          ASSERT_EQ(call(finger, motion().time[k], &moved), TENDONFMU_OK);
          const tendonfmu_outputs view = sides[s].view();
          tendonfmu_get_outputs(finger, &view);
        }
        ASSERT_EQ(tendonfmu_restore_state(finger, before.data(), before.size()), TENDONFMU_OK);
        ASSERT_EQ(call(finger, motion().time[k], &at), TENDONFMU_OK);
        Outputs slope(1);
        const tendonfmu_outputs view = slope.view();
        ASSERT_EQ(tendonfmu_get_directional_derivative(finger, &direction, &view), TENDONFMU_OK);
        const bool same_branch = sides[0].contact == sides[1].contact;
        for (std::size_t j = 0; same_branch && j < joints; ++j) {
          const auto check = [&](const std::vector<double>& low, const std::vector<double>& high, double derivative) {
            const double numeric = (high[j] - low[j]) / (2.0 * h);
            EXPECT_NEAR(derivative, numeric, 1e-6 + 2e-4 * std::abs(numeric)) << "sample " << k << " source " << source;
          };
          check(sides[0].compensated, sides[1].compensated, slope.compensated[j]);
          check(sides[0].torque, sides[1].torque, slope.torque[j]);
          check(sides[0].friction, sides[1].friction, slope.friction[j]);
          check(sides[0].bias, sides[1].bias, slope.bias[j]);
          check(sides[0].angle, sides[1].angle, slope.angle[j]);
          check(sides[0].speed, sides[1].speed, slope.speed[j]);
        }
        checked += same_branch;
      } else {
        ASSERT_EQ(call(finger, motion().time[k], &at), TENDONFMU_OK);
      }
    }
    EXPECT_GT(checked, 90u);
  }
}

}  // namespace
