// docs/reference/semantics/position_filter.md: what it estimates, its gate, its memory, its derivatives.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core_inside.h"
#include "test_finger.h"

namespace {

using test_finger::Finger;

// one joint with Coulomb friction that builds up over a distance
std::string one_joint(const std::string& keys) {
  return R"({"format": "tendonfmu-finger-1", "name": "one", "joints": [{"friction": {"static": 0.02, "coulomb": 0.02,
    "stribeck_velocity": 0.1}}], "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}],
    "contact": {"threshold": [1e6]},
    "extensions": [{"effect": "presliding", "joint": 1, "displacement": 0.001}])" +
         keys + "}";
}

const char* const filter = R"(, "position_filter": {"noise": [0.001], "jerk_density": 2})";

// what the finger says of a sample
struct Said {
  double speed = 0.0, torque = 0.0;
};

tendonfmu_status take(tendonfmu_finger* finger, double time, double angle) {
  const double force = 20.0;
  const tendonfmu_inputs inputs = {&force, nullptr, &angle, nullptr};
  return tendonfmu_is_initialised(finger) ? tendonfmu_step(finger, time, &inputs)
                                          : tendonfmu_initialise(finger, time, &inputs);
}

Said said(tendonfmu_finger* finger) {
  Said found;
  tendonfmu_outputs outputs = {};
  outputs.joint_speed = &found.speed;
  outputs.friction_torque = &found.torque;
  tendonfmu_get_outputs(finger, &outputs);
  return found;
}

class Filtered {
 public:
  explicit Filtered(const std::string& keys = filter) : finger_(test_finger::image(one_joint(keys))) {
    tendonfmu_set_kinematics_source(finger_, TENDONFMU_JOINT_POSITIONS);
  }
  Said step(double time, double angle) {
    EXPECT_EQ(take(finger_, time, angle), TENDONFMU_OK) << tendonfmu_last_error(finger_);
    return said(finger_);
  }
  double row(filter_row_kind kind) { return filter_memory(finger_.handle, finger_.handle->remembered.filter, kind)[0]; }
  Finger& finger() { return finger_; }

 private:
  Finger finger_;
};

TEST(PositionFilter, BeginsAtRestAndFirstDividesByWhatIsKnown) {
  Filtered one;
  EXPECT_EQ(one.step(0.0, 0.3).speed, 0.0);
  // h = 0.1: F P Fᵀ + J·Q with P = diag(noise², 1, 100)
  const double h = 0.1, noise = 1e-6, jerk = 2.0;
  const double p00 = noise + h * h + 25.0 * h * h * h * h + jerk * std::pow(h, 5) / 20.0;
  const double p01 = h + 50.0 * h * h * h + jerk * std::pow(h, 4) / 8.0;
  const double p11 = 1.0 + 100.0 * h * h + jerk * h * h * h / 3.0;
  EXPECT_NEAR(one.step(h, 0.31).speed, p01 / (p00 + noise) * 0.01, 1e-15);
  EXPECT_NEAR(one.row(FILTER_ANGLE), 0.3 + p00 / (p00 + noise) * 0.01, 1e-15);
  EXPECT_NEAR(one.row(FILTER_P00), noise * p00 / (p00 + noise), 1e-19);
  EXPECT_NEAR(one.row(FILTER_P11), p11 - p01 * p01 / (p00 + noise), 1e-12);
}

// without noise in the data a constant acceleration is followed without lag, at any sample times
TEST(PositionFilter, FollowsAConstantAccelerationWithoutLag) {
  Filtered one;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> steps(0.001, 0.009);
  double time = 0.0;
  for (int k = 0; k < 3000; ++k, time += steps(random)) {
    const double speed = one.step(time, 0.2 + 0.1 * time - 0.05 * time * time).speed;
    if (time > 3.0) {
      EXPECT_NEAR(speed, 0.1 - 0.1 * time, 1e-9);
    }
  }
}

// noise at rest: the velocity is far quieter than that of the low-pass, and the held angle hardly travels
TEST(PositionFilter, IsQuietAtRest) {
  Filtered one;
  Filtered plain("");
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.001);
  double quiet = 0.0, loud = 0.0, travel = 0.0, before = 0.0;
  for (int k = 0; k < 20000; ++k) {
    const double angle = 0.2 + noise(random), time = 0.004 * k;
    const double v = one.step(time, angle).speed, w = plain.step(time, angle).speed;
    const double held = one.row(FILTER_HELD_ANGLE);
    if (k > 1000) {
      quiet += v * v;
      loud += w * w;
      travel += std::fabs(held - before);
    }
    before = held;
  }
  EXPECT_LT(std::sqrt(quiet / loud), 0.12);
  EXPECT_LT(travel / 76.0, 0.01);  // rad/s
}

TEST(PositionFilter, HoldsTheAngleWithinTwoStandardDeviations) {
  Filtered one;
  double held = 0.0, time = 0.0;
  int open = 0, inside = 0, pushed = 0;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 0.001);
  for (int k = 0; k < 4000; ++k, time += 0.004) {
    const double speed = one.step(time, 0.1 * std::sin(0.5 * time) * std::sin(0.5 * time) + noise(random)).speed;
    const double x = one.row(FILTER_ANGLE), z = one.row(FILTER_HELD_ANGLE);
    const double width = 2.0 * std::sqrt(one.row(FILTER_P00));
    if (k == 0) {
      EXPECT_EQ(z, x);
    } else if (std::fabs(speed) > 2.0 * std::sqrt(one.row(FILTER_P11))) {
      EXPECT_EQ(z, x);
      EXPECT_EQ(one.row(FILTER_CARRIES), 1.0);
      ++open;
    } else {
      EXPECT_EQ(z, std::fmin(std::fmax(held, x - width), x + width));
      EXPECT_EQ(one.row(FILTER_CARRIES), z == held ? 0.0 : 1.0);
      (z == held ? inside : pushed) += 1;
    }
    held = z;
  }
  EXPECT_GT(open, 500);
  EXPECT_GT(inside, 500);
  EXPECT_GT(pushed, 20);
}

// friction builds up with the held angle: ζ by hand
TEST(PositionFilter, GivesPreslidingItsTravel) {
  Filtered one(std::string(R"(, "bias": {"initial_torque": [0], "noise_std": 1e6, "drift_variance": 0,
    "initial_variance": 0})") +
               filter);
  double share = 0.0, held = 0.0, time = 0.0;
  for (int k = 0; k < 800; ++k, time += k % 3 == 0 ? 0.002 : 0.005) {
    const double torque = one.step(time, 0.05 * std::sin(2.0 * time)).torque, z = one.row(FILTER_HELD_ANGLE);
    const double travel = k ? z - held : 0.0, side = travel < 0.0 ? -1.0 : 1.0;
    share = side - (side - share) * std::exp(-std::fabs(travel) / 0.001);
    EXPECT_NEAR(torque, 0.02 * share, 1e-15);
    held = z;
  }
}

TEST(PositionFilter, LeavesGivenVelocitiesAlone) {
  Finger with(test_finger::image(one_joint(filter))), without(test_finger::image(one_joint("")));
  for (Finger* finger : {&with, &without}) {
    tendonfmu_set_kinematics_source(*finger, TENDONFMU_JOINT_VELOCITIES);
  }
  for (int k = 0; k < 200; ++k) {
    const double force = 20.0, angle = 0.1 * std::sin(0.03 * k), speed = 3.0 * std::cos(0.03 * k);
    const tendonfmu_inputs inputs = {&force, nullptr, &angle, &speed};
    Said found[2];
    for (int f = 0; f < 2; ++f) {
      tendonfmu_finger* finger = f ? without : with;
      const tendonfmu_status status = tendonfmu_is_initialised(finger)
                                          ? tendonfmu_step(finger, 0.01 * k, &inputs)
                                          : tendonfmu_initialise(finger, 0.01 * k, &inputs);
      ASSERT_EQ(status, TENDONFMU_OK);
      found[f] = said(finger);
    }
    EXPECT_EQ(found[0].speed, found[1].speed);
    EXPECT_EQ(found[0].torque, found[1].torque);
  }
}

TEST(PositionFilter, BeginsAnewAfterAGap) {
  Filtered one(std::string(R"(, "bias": {"initial_torque": [0], "noise_std": 1e6, "drift_variance": 0,
    "initial_variance": 0})") +
               filter);
  for (int k = 0; k < 100; ++k) {
    one.step(0.004 * k, 0.001 * k);
  }
  const double held = one.row(FILTER_HELD_ANGLE), share = said(one.finger()).torque / 0.02;
  const Said after = one.step(1.4, 0.095);
  EXPECT_EQ(after.speed, 0.0);
  EXPECT_EQ(one.row(FILTER_ANGLE), 0.095);
  EXPECT_EQ(one.row(FILTER_P11), 1.0);
  EXPECT_NEAR(after.torque, 0.02 * (-1.0 + (1.0 + share) * std::exp((0.095 - held) / 0.001)), 1e-15);
  EXPECT_EQ(one.row(FILTER_CARRIES), 1.0);
}

// no time step and no angle makes it refuse what the core takes, or leaves its variances below 0
TEST(PositionFilter, TakesAnySteps) {
  for (const char* keys : {R"(, "position_filter": {"noise": [1e-6], "jerk_density": 1e-9})",
                           R"(, "position_filter": {"noise": [1e-6], "jerk_density": 1e9})",
                           R"(, "position_filter": {"noise": [1000], "jerk_density": 1e9})"}) {
    SCOPED_TRACE(keys);
    Filtered one(keys);
    std::mt19937 random(11);
    std::uniform_real_distribution<double> exponent(-14.0, 9.0), angle(-1.0, 1.0);
    double time = 0.0;
    for (int k = 0; k < 5000; ++k) {
      time += std::pow(10.0, k % 500 < 250 ? exponent(random) : -3.0);
      const double size = k % 100 == 7 ? 1e12 : 1.0;
      const Said found = one.step(time, size * angle(random));
      EXPECT_TRUE(std::isfinite(found.speed));
      for (const filter_row_kind kind : {FILTER_P00, FILTER_P11, FILTER_P22}) {
        EXPECT_GE(one.row(kind), 0.0);
      }
    }
  }
}

// a sample that is refused is forgotten, and a saved state goes on to the last bit, that of the sample after a gap too
TEST(PositionFilter, IsPartOfTheState) {
  for (const double gap : {0.0, 2.0}) {
    SCOPED_TRACE(gap);
    Filtered one, other;
    const double wrong = std::numeric_limits<double>::quiet_NaN();
    const auto time = [gap](int k) { return 0.004 * k + (k < 59 ? 0.0 : gap); };
    for (int k = 0; k < 60; ++k) {
      one.step(time(k), 0.1 * std::sin(0.1 * k));
    }
    EXPECT_EQ(take(one.finger(), time(60), wrong), TENDONFMU_BAD_SAMPLE);
    const auto state = one.finger().saved();
    ASSERT_EQ(tendonfmu_restore_state(other.finger(), state.data(), state.size()), TENDONFMU_OK);
    for (int k = 60; k < 120; ++k) {
      const Said a = one.step(time(k), 0.1 * std::sin(0.1 * k)), b = other.step(time(k), 0.1 * std::sin(0.1 * k));
      EXPECT_EQ(a.speed, b.speed);
      EXPECT_EQ(a.torque, b.torque);
    }
  }
}

// of the speed by the angle of the same sample: the gain, whatever it is
TEST(PositionFilter, DerivativeIsThatOfTheSample) {
  Filtered one;
  for (int k = 0; k < 90; ++k) {
    const double time = 0.004 * k, angle = 0.1 * std::sin(0.1 * k), step = 1e-7, unit = 1.0, zero = 0.0;
    const auto before = one.finger().saved();
    double difference[2] = {0.0, 0.0};
    for (const double sign : {1.0, -1.0}) {
      tendonfmu_restore_state(one.finger(), before.data(), before.size());
      const Said found = one.step(time, angle + sign * step);
      difference[0] += sign * found.speed / (2.0 * step);
      difference[1] += sign * found.torque / (2.0 * step);
    }
    tendonfmu_restore_state(one.finger(), before.data(), before.size());
    one.step(time, angle);
    double speed = 0.0, torque = 0.0;
    tendonfmu_outputs slopes = {};
    slopes.joint_speed = &speed;
    slopes.friction_torque = &torque;
    const tendonfmu_inputs direction = {&zero, nullptr, &unit, nullptr};
    ASSERT_EQ(tendonfmu_get_directional_derivative(one.finger(), &direction, &slopes), TENDONFMU_OK);
    if (k > 0) {
      EXPECT_NEAR(speed, difference[0], 1e-6 * std::fabs(difference[0]) + 1e-6) << k;
      EXPECT_NEAR(torque, difference[1], 1e-4 * std::fabs(difference[1]) + 1e-5) << k;
    }
  }
}

}  // namespace
