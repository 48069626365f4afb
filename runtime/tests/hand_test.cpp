// Several fingers in one call, and parameters that another thread prepares. Built a second time with the thread
// sanitizer.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <string>
#include <thread>
#include <vector>

#include "test_finger.h"

using test_finger::Finger;
using test_finger::image_of;
using test_finger::Motion;
using test_finger::Outputs;

namespace {

constexpr std::size_t fingers = test_finger::kinds;

// A hand of one finger of each kind.
struct Hand {
  std::array<Finger, fingers> finger = {Finger(image_of(0)), Finger(image_of(1)), Finger(image_of(2)),
                                        Finger(image_of(3))};
  std::array<tendonfmu_finger*, fingers> handle = {};
  std::vector<Outputs> outputs = std::vector<Outputs>(fingers, Outputs(1));
  std::array<tendonfmu_outputs, fingers> view = {};
  std::array<tendonfmu_status, fingers> status = {};

  Hand() {
    for (std::size_t k = 0; k < fingers; ++k) {
      handle[k] = finger[k];
      view[k] = outputs[k].view();
    }
  }
  tendonfmu_status step(double time, const std::array<tendonfmu_inputs, fingers>& inputs) {
    return tendonfmu_step_hand(fingers, handle.data(), time, inputs.data(), view.data(), status.data());
  }
};

std::array<tendonfmu_inputs, fingers> rows(const Motion& motion, std::size_t k) {
  std::array<tendonfmu_inputs, fingers> inputs = {};
  for (std::size_t i = 0; i < fingers; ++i) {
    inputs[i] = motion.row(k + 100 * i);  // each finger is elsewhere in the motion
  }
  return inputs;
}

// A program of a later header: its outputs are longer, and have arrays that this library does not know.
struct LaterOutputs {
  tendonfmu_outputs known;
  double* unknown;
};

TEST(Hand, GivesProgramsOfOtherHeadersWhatBothKnow) {
  const Motion motion(1000);
  Hand hand, whole;
  double untouched = 7.0;
  std::array<LaterOutputs, fingers> later = {};
  for (std::size_t k = 0; k < fingers; ++k) {
    later[k] = {hand.view[k], &untouched};
    later[k].known.size = sizeof(LaterOutputs);
  }
  const auto inputs = rows(motion, 0);
  ASSERT_EQ(whole.step(0.0, inputs), TENDONFMU_OK);
  ASSERT_EQ(tendonfmu_step_hand(fingers, hand.handle.data(), 0.0, inputs.data(), &later[0].known, nullptr),
            TENDONFMU_OK);
  for (std::size_t k = 0; k < fingers; ++k) {
    EXPECT_TRUE(hand.outputs[k] == whole.outputs[k]) << k;
  }
  EXPECT_EQ(untouched, 7.0);

  std::vector<double> torque(4, -1.0), friction(4, -1.0);
  tendonfmu_outputs earlier = {};
  earlier.size = offsetof(tendonfmu_outputs, friction_torque);
  earlier.joint_torque = torque.data();
  earlier.friction_torque = friction.data();
  ASSERT_EQ(tendonfmu_get_outputs(whole.handle[0], &earlier), TENDONFMU_OK);
  EXPECT_NE(torque[0], -1.0);
  EXPECT_EQ(friction[0], -1.0);
}

TEST(Hand, GivesTheBitsOfItsFingers) {
  const Motion motion(3000);
  Hand hand, alone;
  for (std::size_t k = 0; k < 2000; ++k) {
    const auto inputs = rows(motion, k);
    ASSERT_EQ(hand.step(motion.time[k], inputs), TENDONFMU_OK);
    for (std::size_t i = 0; i < fingers; ++i) {
      ASSERT_EQ(alone.finger[i].take(motion.time[k], inputs[i]), TENDONFMU_OK);
      ASSERT_EQ(tendonfmu_get_outputs(alone.handle[i], &alone.view[i]), TENDONFMU_OK);
      ASSERT_TRUE(hand.outputs[i] == alone.outputs[i]) << "finger " << i << " sample " << k;
    }
  }
}

TEST(Hand, ARefusedSampleIsThatOfOneFingerAlone) {
  const Motion motion(600);
  Hand hand;
  ASSERT_EQ(hand.step(0.0, rows(motion, 0)), TENDONFMU_OK);
  const std::vector<unsigned char> before = hand.finger[1].saved();
  auto inputs = rows(motion, 1);
  const std::vector<double> broken(test_finger::tendons, NAN);
  inputs[1].tendon_force = broken.data();
  const Outputs kept = hand.outputs[1];
  EXPECT_EQ(hand.step(motion.time[1], inputs), TENDONFMU_BAD_SAMPLE);
  EXPECT_EQ(hand.status,
            (std::array<tendonfmu_status, fingers>{TENDONFMU_OK, TENDONFMU_BAD_SAMPLE, TENDONFMU_OK, TENDONFMU_OK}));
  EXPECT_EQ(hand.finger[1].saved(), before);
  EXPECT_TRUE(hand.outputs[1] == kept);
  EXPECT_EQ(tendonfmu_get_time(hand.handle[3]), motion.time[1]);
}

TEST(Hand, MissingArgumentsAreRefused) {
  const Motion motion(600);
  const auto inputs = rows(motion, 0);
  Hand hand;
  EXPECT_EQ(tendonfmu_step_hand(fingers, nullptr, 0.0, inputs.data(), nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_step_hand(fingers, hand.handle.data(), 0.0, nullptr, nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_step_hand(0, nullptr, 0.0, nullptr, nullptr, nullptr), TENDONFMU_OK);
  hand.handle[2] = nullptr;
  EXPECT_EQ(hand.step(0.0, inputs), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(hand.status[2], TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_is_initialised(hand.handle[3]), 1);
}

// Makes every parameter that may change between steps larger by a share.
void change_all(tendonfmu_finger* finger, double share) {
  std::vector<std::size_t> indices;
  std::vector<double> values;
  for (std::size_t i = 0; i < tendonfmu_parameter_count(finger); ++i) {
    tendonfmu_parameter_info info;
    double value = 0.0;
    tendonfmu_get_parameter_info(finger, i, &info);
    tendonfmu_get_parameters(finger, 1, &i, &value);
    if (info.tunable != 0) {
      indices.push_back(i);
      values.push_back((1.0 + share) * value);
    }
  }
  ASSERT_EQ(tendonfmu_set_parameters(finger, values.size(), indices.data(), values.data()), TENDONFMU_OK)
      << tendonfmu_last_error(finger);
}

TEST(TakeParameters, IsWhatWritingThemIs) {
  const Motion motion(3000);
  for (const char* kernel : test_finger::kernels()) {
    for (std::size_t kind = 0; kind < fingers; ++kind) {
      const Finger taking(image_of(static_cast<int>(kind))), writing(image_of(static_cast<int>(kind)));
      const Finger spare(image_of(static_cast<int>(kind)));
      tendonfmu_set_kernel(taking, kernel);
      tendonfmu_set_kernel(writing, kernel);
      spare.run(motion, 0, 700);  // what the spare remembers is its own
      change_all(spare, 0.1);
      taking.run(motion, 0, 1000);
      writing.run(motion, 0, 1000);
      change_all(writing, 0.1);
      ASSERT_EQ(tendonfmu_take_parameters(taking, spare), TENDONFMU_OK);
      ASSERT_EQ(taking.saved(), writing.saved());
      ASSERT_TRUE(taking.run(motion, 1000, 3000) == writing.run(motion, 1000, 3000)) << kernel << " kind " << kind;
      ASSERT_EQ(taking.saved(), writing.saved());
    }
  }
}

TEST(TakeParameters, FixedOnesMayOnlyDifferBeforeTheFirstSample) {
  const Motion motion(300);
  const Finger finger, spare;
  ASSERT_EQ(tendonfmu_set_parameter(spare, "tendons[2].moment_arms[1]", -0.0085), TENDONFMU_OK);
  const Finger written;
  ASSERT_EQ(tendonfmu_set_parameter(written, "tendons[2].moment_arms[1]", -0.0085), TENDONFMU_OK);
  const Finger early;
  ASSERT_EQ(tendonfmu_take_parameters(early, spare), TENDONFMU_OK);
  EXPECT_TRUE(early.run(motion) == written.run(motion));
  finger.run(motion);
  const std::vector<unsigned char> before = finger.saved();
  EXPECT_EQ(tendonfmu_take_parameters(finger, spare), TENDONFMU_WRONG_ORDER);
  EXPECT_STREQ(tendonfmu_last_error(finger), "tendons[2].moment_arms[1] is fixed once the first sample is taken");
  EXPECT_EQ(finger.saved(), before);
}

TEST(TakeParameters, OfAnotherFingerAreRefused) {
  const Finger finger, other(image_of(test_finger::detecting));
  const std::vector<unsigned char> before = finger.saved();
  EXPECT_EQ(tendonfmu_take_parameters(finger, other), TENDONFMU_BAD_ARGUMENT);
  EXPECT_STREQ(tendonfmu_last_error(finger), "prepared: a finger of another image");
  EXPECT_EQ(tendonfmu_take_parameters(finger, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_take_parameters(nullptr, other), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(finger.saved(), before);
}

// As docs/guide/in_your_loop.md has it: two threads exchange one spare finger.
TEST(TakeParameters, ThatAnotherThreadPreparesArriveWhole) {
  const Motion motion(2000);
  const Finger finger(image_of(test_finger::extended)), spare(image_of(test_finger::extended));
  std::atomic<tendonfmu_finger*> wanted{spare}, ready{nullptr};
  std::atomic<bool> ended{false};
  std::thread preparing([&] {
    for (double threshold = 0.04; !ended.load();) {
      tendonfmu_finger* prepared = wanted.exchange(nullptr);
      if (prepared != nullptr) {
        threshold = threshold > 1.0 ? 0.04 : threshold + 1e-4;
        EXPECT_EQ(tendonfmu_set_parameter(prepared, "contact.threshold[1]", threshold), TENDONFMU_OK);
        EXPECT_EQ(tendonfmu_set_parameter(prepared, "contact.threshold[2]", threshold), TENDONFMU_OK);
        ready.store(prepared);
      }
      std::this_thread::yield();
    }
  });
  std::size_t taken = 0;
  double threshold[2] = {};
  for (std::size_t k = 0; k < motion.time.size() || taken < 20; ++k) {
    if (tendonfmu_finger* prepared = ready.exchange(nullptr)) {
      ASSERT_EQ(tendonfmu_take_parameters(finger, prepared), TENDONFMU_OK);
      wanted.store(prepared);
      ++taken;
    }
    if (k < motion.time.size()) {
      ASSERT_EQ(finger.take(motion.time[k], motion.row(k)), TENDONFMU_OK);
    }
    tendonfmu_get_parameter(finger, "contact.threshold[1]", &threshold[0]);
    tendonfmu_get_parameter(finger, "contact.threshold[2]", &threshold[1]);
    ASSERT_EQ(threshold[0], threshold[1]);
    std::this_thread::yield();
  }
  ended.store(true);
  preparing.join();
}

}  // namespace
