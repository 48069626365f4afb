// Links of the simulated finger: mass matrix and inverse dynamics against energies and differences.
#include "rigid_body.h"

#include <gtest/gtest.h>

#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;

struct RigidBody : testing::Test {
  const rig small = test_plant::read(test_plant::small());
  const std::size_t n = small.joint_count();
  std::mt19937 random{3};
  double q[max_joints] = {}, speed[max_joints] = {};

  void draw() {
    std::uniform_real_distribution<double> angle(-1.5, 1.5), rate(-5.0, 5.0);
    for (std::size_t j = 0; j < n; ++j) {
      q[j] = angle(random);
      speed[j] = rate(random);
    }
  }
  chain_motion moved() const {
    chain_motion motion;
    move_chain(small, q, speed, &motion);
    return motion;
  }
  /* Kinetic and potential energy `t` seconds on, at constant acceleration. */
  double energy_after(double t, const double* acceleration) const {
    double angle[max_joints], rate[max_joints];
    for (std::size_t j = 0; j < n; ++j) {
      angle[j] = q[j] + t * (speed[j] + 0.5 * t * acceleration[j]);
      rate[j] = speed[j] + t * acceleration[j];
    }
    chain_motion motion;
    move_chain(small, angle, rate, &motion);
    return kinetic_energy(small, motion) + gravity_energy(small, motion);
  }
};

TEST_F(RigidBody, KineticEnergyIsHalfOfSpeedMassSpeed) {
  for (int trial = 0; trial < 50; ++trial) {
    draw();
    const chain_motion motion = moved();
    double mass[max_joints * max_joints], energy = 0.0;
    mass_matrix(small, motion, mass);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        energy += 0.5 * speed[i] * mass[i * n + j] * speed[j];
        EXPECT_EQ(mass[i * n + j], mass[j * n + i]);
      }
    }
    EXPECT_NEAR(energy, kinetic_energy(small, motion), 1e-13 * energy);
  }
}

// dT/dt + dV/dt = torque · q̇ for any acceleration: holds for velocity terms and gravity together.
TEST_F(RigidBody, PowerOfTheTorquesIsTheGrowthOfEnergy) {
  std::uniform_real_distribution<double> any(-50.0, 50.0);
  for (int trial = 0; trial < 50; ++trial) {
    draw();
    double acceleration[max_joints], torque[max_joints], power = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      acceleration[j] = any(random);
    }
    inverse_dynamics(small, moved(), speed, acceleration, torque);
    for (std::size_t j = 0; j < n; ++j) {
      power += torque[j] * speed[j];
    }
    const double h = 1e-5;
    const double growth = (energy_after(h, acceleration) - energy_after(-h, acceleration)) / (2 * h);
    EXPECT_NEAR(power, growth, 1e-6 * (1.0 + std::fabs(power)));
  }
}

}  // namespace
