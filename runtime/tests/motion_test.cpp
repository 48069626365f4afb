// What the motors of the simulated finger are told, and the forces that push it.
#include "motion.h"

#include <gtest/gtest.h>

#include "contact_force.h"
#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;

double slope(const knots& knots, double time) {
  const double h = 1e-6;
  return (at_time(knots, time + h) - at_time(knots, time - h)) / (2 * h);
}

TEST(Knots, PassThroughPositionVelocityAndAcceleration) {
  const knots three_knots = {{0.5, 1.0, 3.0}, {0.1, 0.4, -0.2}, {0.3, -0.5, 0.2}, {1.0, -2.0, 0.7}};
  EXPECT_EQ(at_time(three_knots, 0.5), 0.1);
  EXPECT_NEAR(at_time(three_knots, 1.0), 0.4, 1e-15);
  EXPECT_EQ(at_time(three_knots, 3.0), -0.2);
  EXPECT_NEAR(slope(three_knots, 1.0), -0.5, 1e-8);
  const double h = 1e-4;
  for (const int side : {-1, 1}) {  // the acceleration from either side
    const double a = (at_time(three_knots, 1.0 + 2 * side * h) - 2 * at_time(three_knots, 1.0 + side * h) +
                      at_time(three_knots, 1.0)) /
                     (h * h);
    EXPECT_NEAR(a, -2.0, 0.05) << side;
  }
}

TEST(Knots, AreConstantOutside) {
  const knots two = {{1.0, 2.0}, {0.1, 0.4}, {5.0, 5.0}, {0.0, 0.0}}, one = {{0.0}, {7.0}, {0.0}, {0.0}};
  for (const double time : {-HUGE_VAL, -1.0, 0.0, std::nextafter(1.0, 0.0)}) {
    EXPECT_EQ(at_time(two, time), 0.1);
  }
  for (const double time : {std::nextafter(2.0, 3.0), 1e300, HUGE_VAL}) {
    EXPECT_EQ(at_time(two, time), 0.4);
  }
  for (const double time : {-1.0, 0.0, 1.0}) {
    EXPECT_EQ(at_time(one, time), 7.0);
  }
}

TEST(MomentArm, IsTheSlopeOfThePath) {
  const moment_arm arm = {0.01, 2e-3, 1e-3, 0.7};
  const double h = 1e-5;
  EXPECT_EQ(path_of(arm, 0.0), 0.0);
  for (double q = -2.0; q < 2.0; q += 0.25) {
    EXPECT_NEAR(arm_at(arm, q), (path_of(arm, q + h) - path_of(arm, q - h)) / (2 * h), 1e-12);
    EXPECT_NEAR(arm_slope_at(arm, q), (arm_at(arm, q + h) - arm_at(arm, q - h)) / (2 * h), 1e-12);
  }
}

TEST(Elongation, IsTheSpringLawTurnedRound) {
  for (const double hardening : {0.0, 1e3, 1e6, 1e12}) {
    tendon spring;
    spring.stiffness = 5000.0;
    spring.hardening = hardening;
    for (const double force : {0.0, 1e-9, 0.1, 10.0, 1e4}) {
      const double e = elongation_of(spring, force);
      EXPECT_NEAR(e * (spring.stiffness + hardening * e), force, 1e-14 * force + 1e-300);
    }
    EXPECT_LT(elongation_of(spring, -1.0), 0.0);
  }
}

// Before time 0 the finger comes from aside, inside its limits, and rests for the last 40 % of the time to settle.
TEST(DesiredAngles, ComeToTheStartFromAside) {
  const rig small = test_plant::read(test_plant::small());
  double start[max_joints], angle[max_joints];
  desired_angles(small, 0.0, start);
  desired_angles(small, -0.39 * small.settle, angle);
  EXPECT_TRUE(std::equal(start, start + small.joint_count(), angle));
  desired_angles(small, -small.settle, angle);
  for (std::size_t j = 0; j < small.joint_count(); ++j) {
    EXPECT_NEAR(std::fabs(angle[j] - start[j]), 0.15, 1e-12);
    EXPECT_GE(angle[j], small.links[j].lower);
    EXPECT_LE(angle[j], small.links[j].upper);
  }
}

TEST(Obstacle, PushesOutwardsAndNeverPulls) {
  rig plain = test_plant::read(test_plant::changed(
      {{"/physics/obstacle", {{"centre", {0.09, 0, 0}}, {"radius", 0.02}, {"stiffness", 500}, {"damping", 5.0}}}}));
  plain.pushes.clear();
  double q[max_joints] = {}, speed[max_joints] = {};
  for (const double rate : {-50.0, 0.0, 50.0}) {
    speed[2] = rate;
    chain_motion<double> motion;
    move_chain(plain, q, speed, &motion);
    const auto found = penetrate(plain.obstacle, motion);
    ASSERT_GT(found.depth, 0.0);
    const auto contact = contact_torques(plain, motion, 0.0, false, free_push(), true);
    const double pressing = dot(contact.force, found.normal);
    EXPECT_GE(pressing, 0.0);
    EXPECT_NEAR(pressing, std::max(0.0, 500 * found.depth * (1 + 5.0 * found.growth)), 1e-12);
    EXPECT_NEAR(contact.obstacle_loss, (pressing - 500 * found.depth) * found.growth, 1e-12);
  }
}

}  // namespace
