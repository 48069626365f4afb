// Fingers with extensions as a whole: what they remember, what a refused sample leaves, in which order rows act, and
// derivatives of the sample as it was taken.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "core_inside.h"
#include "test_finger.h"

namespace {

using test_finger::Finger;
using test_finger::Motion;

// the test finger with these rows instead of its own
std::string with_extensions(const std::string& rows) {
  std::string text = test_finger::json;
  const std::string list = "\"extensions\": [";
  text.erase(text.find(list));
  return text + list + rows + "]}";
}

tendonfmu_status take(tendonfmu_finger* finger, double time, const tendonfmu_inputs& inputs) {
  return tendonfmu_is_initialised(finger) ? tendonfmu_step(finger, time, &inputs)
                                          : tendonfmu_initialise(finger, time, &inputs);
}

void run(tendonfmu_finger* finger, const Motion& motion, std::size_t first, std::size_t last) {
  for (std::size_t k = first; k < last; ++k) {
    const tendonfmu_inputs inputs = motion.row(k);
    ASSERT_EQ(take(finger, motion.time[k], inputs), TENDONFMU_OK)
        << "row " << k << ": " << tendonfmu_last_error(finger);
  }
}

const char* const kernels[] = {"plain", "sse2", "avx2"};

// one that runs here
bool choose(tendonfmu_finger* finger, const char* kernel) {
  return tendonfmu_set_kernel(finger, kernel) == TENDONFMU_OK;
}

void set(tendonfmu_finger* finger, const char* path, double value) {
  const std::size_t index = tendonfmu_find_parameter(finger, path);
  ASSERT_EQ(tendonfmu_set_parameters(finger, 1, &index, &value), TENDONFMU_OK) << tendonfmu_last_error(finger);
}

std::array<double, 2> derivative(tendonfmu_finger* finger, const tendonfmu_inputs& direction) {
  std::array<double, 2> slope{};
  tendonfmu_outputs outputs = {};
  outputs.compensated_torque = slope.data();
  EXPECT_EQ(tendonfmu_get_directional_derivative(finger, &direction, &outputs), TENDONFMU_OK);
  return slope;
}

// --- memory ----------------------------------------------------------------------------------------------------------

// a finger that has gone elsewhere takes up what another one has left, with the same bits in every kernel
TEST(Memory, SavedMidRunGoesOnWithTheSameBits) {
  const auto image = test_finger::image(test_finger::every_effect());
  const Motion motion(1800);
  for (int source = 1; source <= 3; ++source) {
    std::vector<unsigned char> expected;
    for (const char* kernel : kernels) {
      SCOPED_TRACE(std::string(kernel) + ", source " + std::to_string(source));
      Finger whole(image), other(image);
      if (!choose(whole, kernel) || !choose(other, kernel)) {
        continue;
      }
      tendonfmu_set_kinematics_source(whole, source);
      tendonfmu_set_kinematics_source(other, source % 3 + 1);
      run(other, motion, 0, 300);
      run(whole, motion, 0, 7);  // before the 64 samples of a delay are full, while it moves, at rest, in contact
      for (const std::size_t at : {std::size_t{7}, std::size_t{700}, std::size_t{1250}, std::size_t{1790}}) {
        const std::size_t until = std::min<std::size_t>(at + 90, 1800);
        const auto state = whole.saved();
        ASSERT_EQ(tendonfmu_restore_state(other, state.data(), state.size()), TENDONFMU_OK);
        run(whole, motion, at, until);
        run(other, motion, at, until);
        EXPECT_EQ(whole.saved(), other.saved()) << "from sample " << at;
        run(whole, motion, until, at == 7 ? 700 : at == 700 ? 1250 : at == 1250 ? 1790 : until);
      }
      expected = expected.empty() ? whole.saved() : expected;
      EXPECT_EQ(whole.saved(), expected);
    }
  }
}

// what effects on tendon positions have left with source 1 is not carried into a run without them
TEST(Memory, OfAnotherSourceEndsWithAReset) {
  const auto image = test_finger::image(test_finger::every_effect());
  const Motion motion(200);
  Finger used(image), fresh(image);
  run(used, motion, 0, 200);
  ASSERT_EQ(tendonfmu_reset(used), TENDONFMU_OK);
  for (tendonfmu_finger* finger : {used.handle, fresh.handle}) {
    tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_POSITIONS);
    run(finger, motion, 0, 50);
  }
  EXPECT_EQ(used.saved(), fresh.saved());
}

// rings with indices, counts and times that none can have: a sample is refused, or taken with finite outputs
TEST(Memory, FromOutsideMayHoldAnyFiniteNumber) {
  const double odd[] = {1e308, -1e308, 1e19, 4294967296.0, 64.0, 63.5, -1.0, 5e-324};
  const auto image = test_finger::image(
      with_extensions(R"({"effect": "time_delay", "delay": 0.004}, {"effect": "backlash", "tendon": 1, "width": 1e-4},
    {"effect": "presliding", "tendon": 1, "displacement": 1e-4}, {"effect": "gravity", "joint": 2, "sine": 0.1})"));
  const Motion motion(120);
  Finger finger(image);
  run(finger, motion, 0, 100);
  const auto good = finger.saved();
  std::size_t refused = 0, taken = 0;
  for (std::size_t at = good.size() - 8 * finger.handle->shape.extension_memory; at < good.size(); at += 8) {
    for (const double value : odd) {
      auto state = good;
      store_f64(state.data() + at, value);
      store_u64(state.data() + 24, hash_bytes(state.data() + 32, state.size() - 32, 0));
      ASSERT_EQ(tendonfmu_restore_state(finger, state.data(), state.size()), TENDONFMU_OK);
      const tendonfmu_inputs inputs = motion.row(100);
      if (take(finger, motion.time[100], inputs) != TENDONFMU_OK) {
        EXPECT_EQ(finger.saved(), state);
        ++refused;
        continue;
      }
      ++taken;
      std::array<double, 2> torque{};
      tendonfmu_outputs outputs = {};
      outputs.compensated_torque = torque.data();
      ASSERT_EQ(tendonfmu_get_outputs(finger, &outputs), TENDONFMU_OK);
      EXPECT_TRUE(std::isfinite(torque[0]) && std::isfinite(torque[1]));
    }
  }
  EXPECT_GT(refused, 0u);
  EXPECT_GT(taken, refused);
}

// --- samples ---------------------------------------------------------------------------------------------------------

// out of range, and so soon that an acceleration overflows; the run goes on as if they had not been
TEST(RefusedSample, LeavesEverything) {
  const auto image = test_finger::image(test_finger::every_effect());
  Motion motion(700);
  for (double& t : motion.time) {
    t -= motion.time[400];  // sample 400 at time 0
  }
  for (int source = 1; source <= 3; ++source) {
    SCOPED_TRACE(source);
    Finger disturbed(image), quiet(image);
    for (tendonfmu_finger* finger : {disturbed.handle, quiet.handle}) {
      tendonfmu_set_kinematics_source(finger, source);
      set(finger, "extensions[22].delay", source == 1 ? 0.0033 : -0.0033);  // late joints would not have moved by then
      run(finger, motion, 0, 401);
    }
    const auto state = disturbed.saved();
    Motion bad = motion;
    bad.force[401 * test_finger::tendons + 1] = NAN;
    EXPECT_EQ(take(disturbed, motion.time[401], bad.row(401)), TENDONFMU_BAD_SAMPLE);
    EXPECT_EQ(disturbed.saved(), state);
    EXPECT_EQ(take(disturbed, 1e-306, motion.row(410)), TENDONFMU_BAD_SAMPLE);
    EXPECT_NE(std::strstr(tendonfmu_last_error(disturbed), "overflows"), nullptr) << tendonfmu_last_error(disturbed);
    EXPECT_EQ(disturbed.saved(), state);
    run(disturbed, motion, 401, 700);
    run(quiet, motion, 401, 700);
    EXPECT_EQ(disturbed.saved(), quiet.saved());
  }
}

TEST(Rows, OfSignalsActInTheirOwnOrder) {
  const std::string delay = R"({"effect": "time_delay", "delay": 0.0033})",
                    play = R"({"effect": "backlash", "tendon": 1, "width": 2e-4})",
                    joint_play = R"({"effect": "backlash", "joint": 2, "width": 0.02})",
                    spring = R"({"effect": "tendon_nonlinearity", "tendon": 1, "hardening": 1e6})";
  const Motion motion(900);
  const auto outputs_of = [&](const std::string& rows) {
    Finger finger(test_finger::image(with_extensions(rows)));
    test_finger::Outputs outputs(900);
    const tendonfmu_inputs inputs = motion.all();
    const tendonfmu_outputs view = outputs.view();
    EXPECT_EQ(tendonfmu_run(finger, 900, motion.time.data(), &inputs, &view, nullptr), TENDONFMU_OK);
    return outputs;
  };
  const auto expected = outputs_of(delay + "," + play + "," + spring + "," + joint_play);
  EXPECT_TRUE(outputs_of(spring + "," + joint_play + "," + play + "," + delay) == expected);
  EXPECT_TRUE(outputs_of(play + "," + delay + "," + joint_play + "," + spring) == expected);
  EXPECT_FALSE(outputs_of(play + "," + joint_play + "," + spring).torque == expected.torque &&
               outputs_of(play + "," + joint_play + "," + spring) == expected);  // each of them does something
  EXPECT_FALSE(outputs_of(delay + "," + joint_play + "," + spring) == expected);
  EXPECT_FALSE(outputs_of(delay + "," + play + "," + spring) == expected);
  EXPECT_FALSE(outputs_of(delay + "," + play + "," + joint_play) == expected);
}

// however short its displacement: friction that is fully there at once
TEST(Presliding, OfTheShortestDisplacementsTakesEverySample) {
  const Motion motion(1300);
  std::vector<test_finger::Outputs> found;
  for (const char* displacement : {"1e-160", "1e-250", "1e-308", "5e-324"}) {
    SCOPED_TRACE(displacement);
    Finger finger(test_finger::image(
        with_extensions(std::string(R"({"effect": "presliding", "joint": 1, "displacement": )") + displacement +
                        R"(}, {"effect": "presliding", "tendon": 1, "displacement": )" + displacement +
                        R"(}, {"effect": "time_delay", "delay": 0.0033})")));
    found.emplace_back(1300);
    const tendonfmu_inputs inputs = motion.all();
    const tendonfmu_outputs view = found.back().view();
    ASSERT_EQ(tendonfmu_run(finger, 1300, motion.time.data(), &inputs, &view, nullptr), TENDONFMU_OK)
        << tendonfmu_last_error(finger);
    EXPECT_TRUE(found.back() == found.front());
  }
}

// T without a place is the distance T·v_min at each place; a row that names the place is there instead
TEST(Presliding, EverywhereIsThatOfEveryPlaceByItsThreshold) {
  const Motion motion(1300);
  const auto outputs_of = [&motion](const std::string& rows) {
    Finger finger(test_finger::image(with_extensions(rows)));
    test_finger::Outputs found(1300);
    const tendonfmu_inputs inputs = motion.all();
    const tendonfmu_outputs view = found.view();
    EXPECT_EQ(tendonfmu_run(finger, 1300, motion.time.data(), &inputs, &view, nullptr), TENDONFMU_OK);
    return found;
  };
  const auto row = [](const char* place, const char* displacement) {
    return std::string(R"({"effect": "presliding", )") + place + R"("displacement": )" + displacement + "}";
  };
  // powers of 2, so that T·v_min has no rounding: 0.25·0.0005 m, 0.25·0.02 rad
  const std::string joint1 = row(R"("joint": 1, )", "0.005"), joint2 = row(R"("joint": 2, )", "0.005");
  const std::string tendons = row(R"("tendon": 1, )", "0.000125") + ", " + row(R"("tendon": 2, )", "0.000125");
  const std::string tendon3 = row(R"("tendon": 3, )", "0.000125"), other = row(R"("tendon": 3, )", "0.002");
  const std::string other_joint = row(R"("joint": 2, )", "0.3"), everywhere = row("", "0.25");
  const auto all = outputs_of(joint1 + ", " + joint2 + ", " + tendons + ", " + tendon3);
  EXPECT_TRUE(outputs_of(everywhere) == all);
  EXPECT_FALSE(outputs_of(tendons + ", " + tendon3) == all);
  const auto finer = outputs_of(other + ", " + joint1 + ", " + tendons + ", " + other_joint);
  EXPECT_TRUE(outputs_of(other + ", " + everywhere + ", " + other_joint) == finer);
  EXPECT_TRUE(outputs_of(everywhere + ", " + other_joint + ", " + other) == finer);
  EXPECT_FALSE(finer == all);
}

TEST(Presliding, EverywhereOfTheShortestTimeTakesEverySample) {
  const Motion motion(300);
  for (const char* displacement : {"1e-160", "5e-324"}) {
    SCOPED_TRACE(displacement);
    Finger finger(
        test_finger::image(with_extensions(std::string(R"({"effect": "presliding", "displacement": )") + displacement +
                                           R"(}, {"effect": "time_delay", "delay": 0.0033})")));
    run(finger, motion, 0, 300);
  }
}

TEST(Presliding, EverywhereNeedsThresholds) {
  Finger finger(test_finger::image(with_extensions(R"({"effect": "presliding", "displacement": 0.1})")));
  for (const char* path : {"velocity_threshold.tendon", "velocity_threshold.joint"}) {
    EXPECT_EQ(tendonfmu_set_parameter(finger, path, 0.0), TENDONFMU_BAD_PARAMETER);
    EXPECT_EQ(std::string(tendonfmu_last_error(finger)).find(path), 0u) << tendonfmu_last_error(finger);
    EXPECT_EQ(tendonfmu_set_parameter(finger, path, 0.003), TENDONFMU_OK);
  }
  const tendonfmu_parameter_info info = [&finger] {
    tendonfmu_parameter_info found{};
    tendonfmu_get_parameter_info(finger, tendonfmu_find_parameter(finger, "extensions[1].displacement"), &found);
    return found;
  }();
  EXPECT_STREQ(info.unit, "s");
  Finger free(test_finger::image(with_extensions(R"({"effect": "presliding", "joint": 1, "displacement": 0.1})")));
  EXPECT_EQ(tendonfmu_set_parameter(free, "velocity_threshold.joint", 0.0), TENDONFMU_OK);
}

// --- places ----------------------------------------------------------------------------------------------------------

TEST(Places, OfARowAreTheSlotsThatItActsOn) {
  Finger finger(test_finger::image());
  const effect_place places[] = {{0, EFFECT_NOWHERE},
                                 {1, EFFECT_NOWHERE},
                                 {EFFECT_NOWHERE, 0},
                                 {EFFECT_NOWHERE, 2},
                                 {EFFECT_NOWHERE, EFFECT_NOWHERE}};
  for (const effect_place& place : places) {
    extension_row row{};
    row.effect = effect_by_name("friction_drift");
    row.place = place;
    std::vector<std::size_t> member(finger.handle->slots, 99);
    for (std::size_t k = 0; k < friction_members(finger, place); ++k) {
      member[friction_slot(finger, place, k)] = k;
    }
    for (std::size_t slot = 0; slot < finger.handle->slots; ++slot) {
      std::size_t found = 0;
      const bool acts = friction_acts_on(finger, &row, slot, &found) != 0;
      EXPECT_EQ(acts, member[slot] != 99) << "slot " << slot;
      EXPECT_TRUE(!acts || found == member[slot]) << "slot " << slot;
    }
  }
}

// --- derivatives -----------------------------------------------------------------------------------------------------

// numbers that change afterwards do not change what the sample was
TEST(Derivative, IsOfTheSignalsAsTheyWereTaken) {
  Finger finger(test_finger::image(
      with_extensions(R"({"effect": "time_delay", "delay": 0.0033}, {"effect": "backlash", "joint": 2, "width": 0})")));
  const Motion motion(90);
  const std::vector<double> zeros(3, 0.0), force{1.0, -2.0, 0.5}, position{1e-3, 2e-3, -1e-3};
  const tendonfmu_inputs direction = {force.data(), position.data(), zeros.data(), zeros.data()};
  run(finger, motion, 0, 90);
  const auto before = derivative(finger, direction);
  EXPECT_NE(before[0], 0.0);
  set(finger, "extensions[1].delay", -0.002);
  set(finger, "extensions[2].width", 0.1);
  EXPECT_EQ(derivative(finger, direction), before);
}

// Between the thresholds of a hysteresis, past a reversal: the law is that of the side before, in derivatives too.
TEST(Derivative, OfWhatNeverSticksIsThatOfItsLaw) {
  Finger finger(test_finger::image(R"({"format": "tendonfmu-finger-1", "name": "one",
    "joints": [{"friction": {"positive": {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.1, "viscous": 0.3},
                             "negative": {"static": 0.5, "coulomb": 0.4, "stribeck_velocity": 0.1, "viscous": 0.1}}}],
    "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}],
    "velocity_threshold": {"tendon": 0, "joint": 0.1, "hysteresis": 0.5},
    "bias": {"noise_std": 0.1}, "contact": {"threshold": [1e6]},
    "extensions": [{"effect": "presliding", "joint": 1, "displacement": 0.01}]})"));
  tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_VELOCITIES);
  const double force = 20.0, angle = 0.1;
  const auto torque_at = [&](double time, double speed) {
    const tendonfmu_inputs inputs = {&force, nullptr, &angle, &speed};
    EXPECT_EQ(take(finger, time, inputs), TENDONFMU_OK) << tendonfmu_last_error(finger);
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

// Forces that come early bend a hardening spring behind a play: within the play the position stays, its spring does
// not.
TEST(Derivative, OfADelayPassesAPlayAndASpring) {
  const auto image = test_finger::image(with_extensions(
      R"({"effect": "time_delay", "delay": -0.0033}, {"effect": "backlash", "tendon": 1, "width": 3e-3},
         {"effect": "tendon_nonlinearity", "tendon": 1, "hardening": 1e6})"));
  const Motion motion(1000);
  const double change = 1e-6;
  Finger middle(image), more(image), less(image);
  set(more, "extensions[1].delay", -0.0033 + change);
  set(less, "extensions[1].delay", -0.0033 - change);
  double largest = 0.0;
  for (std::size_t k = 0; k < 1000; ++k) {
    for (tendonfmu_finger* finger : {middle.handle, more.handle, less.handle}) {
      run(finger, motion, k, k + 1);
    }
    const double* slopes = signal_slopes(middle, signal_row(middle, 0), 0);
    for (std::size_t j = 0; k >= 64 && j < test_finger::joints; ++j) {
      const double difference = (more.handle->remembered.angle[j] - less.handle->remembered.angle[j]) / (2.0 * change);
      ASSERT_NEAR(slopes[j], difference, 1e-5) << "sample " << k << ", joint " << j + 1;
      largest = std::max(largest, std::fabs(difference));
    }
  }
  EXPECT_GT(largest, 1e-2);
}

}  // namespace
