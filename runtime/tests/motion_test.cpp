// What the motors of the simulated finger are told, and the forces that push it.
#include "motion.h"

#include <gtest/gtest.h>

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

}  // namespace
