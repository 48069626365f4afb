// Fingers with extensions as a whole: what they remember, what a refused sample leaves, in which order rows act, places
// that slide at all times, and derivatives of the sample as it was taken.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "model_inside.h"

namespace {

using test_finger::Finger;
using test_finger::Motion;
using test_finger::Outputs;

// the test finger with these rows instead of its own, and more keys
std::vector<unsigned char> image_with(const std::string& rows, const std::string& keys = "") {
  std::string text = test_finger::json;
  const std::string list = "\"extensions\": [";
  text.erase(text.find(list));
  test_finger::put(text, test_finger::name, keys);
  return test_finger::image(text + list + rows + "]}");
}

Outputs outputs_of(const std::string& rows, const Motion& motion) {
  return Finger(image_with(rows)).run(motion);
}

void set(tendonfmu_finger* finger, const char* path, double value) {
  ASSERT_EQ(tendonfmu_set_parameter(finger, path, value), TENDONFMU_OK) << tendonfmu_last_error(finger);
}

std::array<double, 2> derivative(tendonfmu_finger* finger, const tendonfmu_inputs& direction) {
  std::array<double, 2> slope{};
  tendonfmu_outputs outputs = {};
  outputs.compensated_torque = slope.data();
  EXPECT_EQ(tendonfmu_get_directional_derivative(finger, &direction, &outputs), TENDONFMU_OK);
  return slope;
}

// --- memory and refused samples -------------------------------------------------------------------------------------

// so soon that an acceleration overflows; the run goes on as if it had not been
TEST(RefusedSample, ThatOverflowsLeavesEverything) {
  Motion motion(700);
  for (double& t : motion.time) {
    t -= motion.time[400];  // sample 400 at time 0
  }
  for (int source = 1; source <= 3; ++source) {
    SCOPED_TRACE(source);
    Finger disturbed(test_finger::image_of(test_finger::extended)), quiet(test_finger::image_of(test_finger::extended));
    for (const Finger* finger : {&disturbed, &quiet}) {
      tendonfmu_set_kinematics_source(*finger, source);
      // late joints would not have moved by then
      set(*finger, "extensions[22].delay", source == 1 ? 0.0033 : -0.0033);
      finger->run(motion, 0, 401);
    }
    EXPECT_EQ(disturbed.take(1e-306, motion.row(410)), TENDONFMU_BAD_SAMPLE);
    EXPECT_NE(std::strstr(tendonfmu_last_error(disturbed), "overflows"), nullptr) << tendonfmu_last_error(disturbed);
    EXPECT_EQ(disturbed.saved(), quiet.saved());
    disturbed.run(motion, 401, 700);
    quiet.run(motion, 401, 700);
    EXPECT_EQ(disturbed.saved(), quiet.saved());
  }
}

// --- rows -----------------------------------------------------------------------------------------------------------

TEST(Rows, OfSignalsActInTheirOwnOrder) {
  const std::string delay = R"({"effect": "time_delay", "delay": 0.0033})",
                    play = R"({"effect": "backlash", "tendon": 1, "width": 2e-4})",
                    joint_play = R"({"effect": "backlash", "joint": 2, "width": 0.02})",
                    spring = R"({"effect": "tendon_nonlinearity", "tendon": 1, "hardening": 1e6})";
  const Motion motion(900);
  const Outputs expected = outputs_of(delay + "," + play + "," + spring + "," + joint_play, motion);
  EXPECT_TRUE(outputs_of(spring + "," + joint_play + "," + play + "," + delay, motion) == expected);
  EXPECT_TRUE(outputs_of(play + "," + delay + "," + joint_play + "," + spring, motion) == expected);
  for (const std::string& without : {play + "," + joint_play + "," + spring, delay + "," + joint_play + "," + spring,
                                     delay + "," + play + "," + spring, delay + "," + play + "," + joint_play}) {
    EXPECT_FALSE(outputs_of(without, motion) == expected);  // each of them does something
  }
}

// however short its displacement: friction that is fully there at once
TEST(Presliding, OfTheShortestDisplacementsTakesEverySample) {
  const Motion motion(1300);
  const auto by_place = [](const std::string& displacement) {
    return R"({"effect": "presliding", "joint": 1, "displacement": )" + displacement +
           R"(}, {"effect": "presliding", "tendon": 1, "displacement": )" + displacement +
           R"(}, {"effect": "time_delay", "delay": 0.0033})";
  };
  const Outputs expected = outputs_of(by_place("1e-160"), motion);
  for (const char* displacement : {"1e-250", "1e-308", "5e-324"}) {
    EXPECT_TRUE(outputs_of(by_place(displacement), motion) == expected) << displacement;
  }
  for (const char* displacement : {"1e-160", "5e-324"}) {
    outputs_of(std::string(R"({"effect": "presliding", "displacement": )") + displacement +
                   R"(}, {"effect": "time_delay", "delay": 0.0033})",
               motion);
  }
}

// T without a place is the distance T·v_min at each place; a row that names the place is there instead
TEST(Presliding, EverywhereIsThatOfEveryPlaceByItsThreshold) {
  const Motion motion(1300);
  const auto row = [](const char* place, const char* displacement) {
    return std::string(R"({"effect": "presliding", )") + place + R"("displacement": )" + displacement + "}";
  };
  // powers of 2, so that T·v_min has no rounding: 0.25·0.0005 m, 0.25·0.02 rad
  const std::string joint1 = row(R"("joint": 1, )", "0.005"), joint2 = row(R"("joint": 2, )", "0.005");
  const std::string tendons = row(R"("tendon": 1, )", "0.000125") + ", " + row(R"("tendon": 2, )", "0.000125");
  const std::string tendon3 = row(R"("tendon": 3, )", "0.000125"), other = row(R"("tendon": 3, )", "0.002");
  const std::string other_joint = row(R"("joint": 2, )", "0.3"), everywhere = row("", "0.25");
  const Outputs all = outputs_of(joint1 + ", " + joint2 + ", " + tendons + ", " + tendon3, motion);
  EXPECT_TRUE(outputs_of(everywhere, motion) == all);
  EXPECT_FALSE(outputs_of(tendons + ", " + tendon3, motion) == all);
  const Outputs finer = outputs_of(other + ", " + joint1 + ", " + tendons + ", " + other_joint, motion);
  EXPECT_TRUE(outputs_of(other + ", " + everywhere + ", " + other_joint, motion) == finer);
  EXPECT_TRUE(outputs_of(everywhere + ", " + other_joint + ", " + other, motion) == finer);
  EXPECT_FALSE(finer == all);
}

TEST(Presliding, HasNoMemoryFromWhereItsTendonMovesNoJoint) {
  const Finger finger(test_finger::image(R"({
    "format": "tendonfmu-finger-1", "name": "f", "joints": [{}, {}],
    "tendons": [{"stiffness": 4000, "moment_arms": [0.01, 0]}, {"stiffness": 4000, "moment_arms": [0, 0.01]}],
    "contact": {"threshold": [1, 1]}, "extensions": [{"effect": "presliding", "displacement": 0.05}]})"));
  const double* remembers = finger.handle->memory.remembers;
  const std::size_t lanes = finger.handle->tendon_lanes;
  EXPECT_EQ(std::vector<double>(remembers, remembers + 3), (std::vector<double>{1.0, 1.0, 0.0}));
  EXPECT_EQ(std::vector<double>(remembers + lanes, remembers + lanes + 3), (std::vector<double>{0.0, 1.0, 0.0}));
  EXPECT_EQ(std::vector<double>(remembers + 2 * lanes, remembers + 2 * lanes + 3),
            (std::vector<double>{1.0, 1.0, 0.0}));
}

// --- derivatives ----------------------------------------------------------------------------------------------------

// numbers that change afterwards do not change what the sample was
TEST(Derivative, IsOfTheSignalsAsTheyWereTaken) {
  Finger finger(
      image_with(R"({"effect": "time_delay", "delay": 0.0033}, {"effect": "backlash", "joint": 2, "width": 0})"));
  const Motion motion(90);
  const std::vector<double> zeros(3, 0.0), force{1.0, -2.0, 0.5}, position{1e-3, 2e-3, -1e-3};
  const tendonfmu_inputs direction = {force.data(), position.data(), zeros.data(), zeros.data()};
  finger.run(motion);
  const auto before = derivative(finger, direction);
  EXPECT_NE(before[0], 0.0);
  set(finger, "extensions[1].delay", -0.002);
  set(finger, "extensions[2].width", 0.1);
  EXPECT_EQ(derivative(finger, direction), before);
}

// Below the threshold, past a reversal: the law is that of the side before, in derivatives too.
TEST(Derivative, OfWhatNeverSticksIsThatOfItsLaw) {
  Finger finger(test_finger::image(R"({"format": "tendonfmu-finger-1", "name": "one",
    "joints": [{"friction": {"positive": {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.1, "viscous": 0.3},
                             "negative": {"static": 0.5, "coulomb": 0.4, "stribeck_velocity": 0.1, "viscous": 0.1}}}],
    "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}],
    "velocity_threshold": {"tendon": 0, "joint": 0.1},
    "bias": {"noise_std": 0.1}, "contact": {"threshold": [1e6]},
    "extensions": [{"effect": "presliding", "joint": 1, "displacement": 0.01}]})"));
  tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_VELOCITIES);
  const double force = 20.0, angle = 0.1;
  const auto torque_at = [&](double time, double speed) {
    EXPECT_EQ(finger.take(time, {&force, nullptr, &angle, &speed}), TENDONFMU_OK) << tendonfmu_last_error(finger);
    double torque = 0.0;
    tendonfmu_outputs outputs = {};
    outputs.compensated_torque = &torque;
    tendonfmu_get_outputs(finger, &outputs);
    return torque;
  };
  const double speeds[] = {0.3, 0.4, -0.08, -0.07, -0.09, 0.3, 0.06, -0.06, -0.5, 0.08};
  for (std::size_t k = 0; k < std::size(speeds); ++k) {
    SCOPED_TRACE(k);
    const double time = 0.01 * static_cast<double>(k), step = 1e-6, zero = 0.0, one = 1.0;
    const auto before = finger.saved();
    double difference = 0.0;
    for (const double sign : {1.0, -1.0}) {
      tendonfmu_restore_state(finger, before.data(), before.size());
      difference += sign * torque_at(time, speeds[k] + sign * step) / (2.0 * step);
    }
    tendonfmu_restore_state(finger, before.data(), before.size());
    torque_at(time, speeds[k]);
    EXPECT_NEAR(derivative(finger, {&zero, &zero, &zero, &one})[0], difference, 1e-6);
  }
}

}  // namespace
