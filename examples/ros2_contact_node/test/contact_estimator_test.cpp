// What the node makes of its messages, without ROS.
#include "contact_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using Texts = std::vector<std::string>;
using Numbers = std::vector<double>;

const char* const description = R"({
  "format": "tendonfmu-finger-1", "name": "two joints",
  "joints": [{"friction": {"static": 0.004, "coulomb": 0.003, "stribeck_velocity": 0.1}}, {}],
  "tendons": [{"stiffness": 4000, "moment_arms": [0.008, 0.006]}, {"stiffness": 3000, "moment_arms": [-0.008, 0]},
              {"stiffness": 5000, "moment_arms": [0, -0.006]}],
  "contact": {"threshold": [0.02, 0.02]}})";

const Texts tendon_names = {"flexor", "base_extensor", "tip_extensor"};
constexpr std::int64_t millisecond = 1000000;
constexpr std::int64_t start = 1700000000000000000; /* stamps count from 1970 */

// A message of its own data, of a finger that moves and is pulled from 0.2 s on for 0.1 s.
struct Message {
  std::int64_t stamp;
  Texts names = tendon_names;
  Numbers effort, position;

  explicit Message(int k) : stamp(start + k * millisecond) {
    const double arm[3][2] = {{0.008, 0.006}, {-0.008, 0.0}, {0.0, -0.006}}, stiffness[3] = {4000, 3000, 5000};
    const double q = 0.3 * std::sin(0.004 * k);
    for (int i = 0; i < 3; ++i) {
      effort.push_back(10.0 + i + (i == 0 && k > 200 && k < 300 ? 8.0 : 0.0));
      position.push_back((arm[i][0] + arm[i][1]) * q + effort.back() / stiffness[i]);
    }
  }

  // Tendons in this order, with a name that is not the finger's before them.
  Message in_order(const std::vector<int>& order) const {
    Message other = *this;
    other.names = {"wrist"};
    other.effort = other.position = {99.0};
    for (const int i : order) {
      other.names.push_back(names[i]);
      other.effort.push_back(effort[i]);
      other.position.push_back(position[i]);
    }
    return other;
  }

  tendon_state view() const { return {stamp, names, effort, position}; }
};

contact_estimator::settings chosen() {
  contact_estimator::settings found;
  found.tendon_names = tendon_names;
  found.joints = 2;
  return found;
}

tendonfmu::finger finger() {
  return tendonfmu::finger::from_json(description).value();
}

Numbers torques(const contact_estimator& estimator) {
  return {estimator.compensated_torque().begin(), estimator.compensated_torque().end()};
}

outcome take(contact_estimator& estimator, const Message& message) {
  return estimator.take(message.view());
}

// The torques of an estimator that got messages 0 .. last.
Numbers torques_after(int last) {
  contact_estimator estimator(finger(), chosen());
  for (int k = 0; k <= last; ++k) {
    EXPECT_EQ(take(estimator, Message(k)), outcome::taken);
  }
  return torques(estimator);
}

TEST(ContactEstimator, FeelsThePull) {
  contact_estimator estimator(finger(), chosen());
  EXPECT_FALSE(estimator.contact());
  std::vector<int> begins, ends;
  bool before = false;
  for (int k = 0; k < 400; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken) << estimator.reason();
    if (estimator.contact() != before) {
      (before ? ends : begins).push_back(k);
      before = estimator.contact();
    }
  }
  EXPECT_EQ(begins, std::vector<int>{201});
  ASSERT_EQ(ends.size(), 1u);
  EXPECT_NEAR(ends[0], 300, 10);
  EXPECT_EQ(estimator.reason(), "");
}

TEST(ContactEstimator, GivesTheTorquesOfTheFinger) {
  contact_estimator estimator(finger(), chosen());
  tendonfmu::finger alone = finger();
  Numbers torque(2);
  tendonfmu::outputs wanted;
  wanted.compensated_torque = torque;
  for (int k = 0; k < 400; ++k) {
    const Message message(k);
    ASSERT_EQ(take(estimator, message), outcome::taken);
    const double time = 1e-9 * static_cast<double>(k * millisecond);
    const tendonfmu::inputs sample = {message.effort, message.position};
    ASSERT_EQ(k == 0 ? alone.initialise(time, sample) : alone.step(time, sample), tendonfmu::status::ok);
    ASSERT_EQ(alone.get_outputs(wanted), tendonfmu::status::ok);
    ASSERT_EQ(torques(estimator), torque);
  }
}

TEST(ContactEstimator, TakesNamesInAnyOrderAndLeavesOthersOut) {
  contact_estimator estimator(finger(), chosen());
  const std::vector<std::vector<int>> orders = {{0, 1, 2}, {2, 0, 1}, {2, 1, 0}};
  for (int k = 0; k <= 300; ++k) {
    ASSERT_EQ(take(estimator, Message(k).in_order(orders[k / 50 % 3])), outcome::taken) << estimator.reason();
  }
  EXPECT_EQ(torques(estimator), torques_after(300));
}

TEST(ContactEstimator, RefusesByNameAndGoesOn) {
  contact_estimator estimator(finger(), chosen());
  ASSERT_EQ(take(estimator, Message(0)), outcome::taken);
  ASSERT_EQ(take(estimator, Message(1)), outcome::taken);
  const Numbers before = torques(estimator);
  const auto expect_refused = [&](const Message& message, const std::string& reason) {
    EXPECT_EQ(take(estimator, message), outcome::refused);
    EXPECT_EQ(estimator.reason(), reason);
    EXPECT_EQ(torques(estimator), before);
  };

  Message message(2);
  message.names[1] = "base";
  expect_refused(message, "tendon base_extensor is missing; the message has flexor, base, tip_extensor");
  message = Message(2).in_order({0, 1});
  expect_refused(message, "tendon tip_extensor is missing; the message has wrist, flexor, base_extensor");
  message = Message(2).in_order({0, 1, 2, 1});
  expect_refused(message, "tendon base_extensor is there twice");
  message = Message(2);
  message.names.clear();
  message.effort.clear();
  message.position.clear();
  expect_refused(message, "tendon flexor is missing; the message has no names");
  message = Message(2);
  message.effort.pop_back();
  expect_refused(message, "effort: 2 values for 3 names");
  message = Message(2);
  message.position.clear();
  expect_refused(message, "position: 0 values for 3 names");
  message = Message(2).in_order({2, 1, 0});
  message.effort[2] = NAN;
  expect_refused(message, "effort of tendon base_extensor is not finite");
  message.effort[2] = 1.0;
  message.position[1] = INFINITY;
  expect_refused(message, "position of tendon tip_extensor is not finite");
  message = Message(2);
  message.effort[1] = 1e13; /* finite, and refused by the library */
  EXPECT_EQ(take(estimator, message), outcome::refused);
  EXPECT_EQ(estimator.reason().rfind("tendon_force[2] = 1e+13", 0), 0u) << estimator.reason();

  for (int k = 2; k <= 250; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken) << estimator.reason();
  }
  EXPECT_EQ(torques(estimator), torques_after(250));
}

TEST(ContactEstimator, StampsThatGoBackAreRefusedAndRepeatedOnesPassedOver) {
  contact_estimator estimator(finger(), chosen());
  for (int k = 0; k <= 100; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken);
  }
  EXPECT_EQ(take(estimator, Message(98)), outcome::refused);
  EXPECT_EQ(estimator.reason(), "the stamp goes back by 0.002 s");
  EXPECT_EQ(take(estimator, Message(100)), outcome::repeated);
  EXPECT_NE(estimator.reason().find("is that of the last message"), std::string::npos);
  EXPECT_EQ(torques(estimator), torques_after(100));
  EXPECT_EQ(take(estimator, Message(101)), outcome::taken);
}

TEST(ContactEstimator, AStampThatIsNeverSetIsNamed) {
  contact_estimator estimator(finger(), chosen());
  Message message(0);
  message.stamp = 0;
  EXPECT_EQ(take(estimator, message), outcome::taken);
  EXPECT_EQ(take(estimator, message), outcome::repeated);
  EXPECT_EQ(estimator.reason(), "stamp 0 s is that of the last message; does the driver set it?");
}

TEST(ContactEstimator, AClockThatStartsAgainStartsTheFingerAnew) {
  contact_estimator estimator(finger(), chosen());
  for (int k = 0; k <= 1500; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken);
  }
  EXPECT_EQ(take(estimator, Message(0)), outcome::restarted);
  EXPECT_EQ(estimator.reason(), "the stamp went back by 1.5 s: starting anew");
  for (int k = 1; k <= 250; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken) << estimator.reason();
  }
  EXPECT_EQ(torques(estimator), torques_after(250));
  EXPECT_TRUE(estimator.contact());
}

TEST(ContactEstimator, MissingMessagesAreNamedAndTheNextOneIsTaken) {
  contact_estimator estimator(finger(), chosen());
  for (int k = 0; k <= 50; ++k) {
    ASSERT_EQ(take(estimator, Message(k)), outcome::taken);
  }
  EXPECT_EQ(take(estimator, Message(150)), outcome::taken) << "the longest gap is allowed";
  EXPECT_EQ(take(estimator, Message(251)), outcome::taken_after_gap);
  EXPECT_EQ(estimator.reason(), "messages are missing: 0.101 s since the last one");
  EXPECT_TRUE(estimator.contact());
}

TEST(ContactEstimator, SilenceIsNoticed) {
  contact_estimator estimator(finger(), chosen());
  EXPECT_TRUE(estimator.watch(0));
  EXPECT_TRUE(estimator.watch(100 * millisecond));
  EXPECT_FALSE(estimator.watch(150 * millisecond)) << "no message ever came";
  EXPECT_EQ(estimator.reason(), "no message for 0.15 s");
  take(estimator, Message(0));
  EXPECT_TRUE(estimator.watch(200 * millisecond));
  EXPECT_TRUE(estimator.watch(300 * millisecond));
  EXPECT_FALSE(estimator.watch(301 * millisecond));
  EXPECT_EQ(estimator.reason(), "no message for 0.101 s");
  take(estimator, Message(1));
  EXPECT_TRUE(estimator.watch(1000 * millisecond));
}

TEST(ContactEstimator, NamesThatDoNotFitTheFingerAreRefused) {
  const auto reason = [](const contact_estimator::settings& wrong) -> std::string {
    try {
      contact_estimator estimator(finger(), wrong);
    } catch (const std::invalid_argument& caught) {
      return caught.what();
    }
    return "";
  };
  contact_estimator::settings wrong = chosen();
  EXPECT_EQ(reason(wrong), "");
  wrong.tendon_names.pop_back();
  EXPECT_EQ(reason(wrong), "tendon_names: 2 names, the finger has 3 tendons");
  wrong.tendon_names.push_back("flexor");
  EXPECT_EQ(reason(wrong), "tendon_names: a name is there twice: flexor, base_extensor, flexor");
  wrong = chosen();
  wrong.joints = 4;
  EXPECT_EQ(reason(wrong), "joint_names: 4 names, the finger has 2 joints");
}

}  // namespace
