// The Jacobian in blocks: what it solves, against differences of the equations.
#include "linearisation.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using test_plant::Json;

/* A rig at random states: in sliding and presliding, taut and slack, in stops and in the obstacle. */
struct Case {
  rig numbers;
  dynamics equations{numbers};
  commands inputs;
  std::mt19937 random{17};
  std::vector<double> state, derivative;
  contact_modes modes;

  explicit Case(const Json& text) : numbers(test_plant::read(text)) {
    state.resize(numbers.order());
    derivative.resize(numbers.order());
    inputs.push.force = {0.3, -0.2, 0.5};
    inputs.push.point = numbers.tip;
    inputs.push.link = numbers.joint_count() - 1;
  }

  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

  void draw() {
    const state_layout& at = equations.layout();
    const double pace = std::pow(10.0, between(-5.0, 0.5));
    for (std::size_t j = 0; j < at.joints; ++j) {
      state[at.angle() + j] = between(-0.6, 1.4);
      state[at.speed() + j] = pace * between(-1.0, 1.0);
    }
    scheduled_motors();
    for (std::size_t i = 0; i < at.tendons; ++i) {
      state[at.motor_speed() + i] = 0.02 * between(-1.0, 1.0);
    }
    for (std::size_t s = 0; s < at.bristles; ++s) {
      state[at.bristle() + s] = between(-0.9, 0.9);
    }
    state[at.heat()] = between(0.0, 2.0);
    for (std::size_t k = at.motor_work(); k < at.size(); ++k) {
      state[k] = between(-1.0, 1.0);
    }
  }

  /* Motors where the tendons pull with -2..20 N, none on the kink at 0. */
  void scheduled_motors() {
    const state_layout& at = equations.layout();
    double root[max_roots];
    equations.roots(state.data(), root);
    for (std::size_t i = 0; i < at.tendons; ++i) {
      double force = between(-2.0, 20.0);
      if (std::fabs(force) < 0.2) {
        force = 1.0;
      }
      state[at.motor() + i] += force / numbers.tendons[i].stiffness - root[i];
    }
  }

  void evaluate(double time = 3.0) {
    equations.want_slopes(true);
    equations.evaluate(time, state.data(), nullptr, inputs, derivative.data());
  }

  void linearise(linearisation* blocks) {
    evaluate();
    modes = equations.last().modes;
    blocks->take(equations, state.data(), inputs);
  }

  /* Central differences by number k, and what rounding makes of them. */
  void difference(std::size_t k, std::vector<double>* slope, std::vector<double>* noise) {
    std::vector<double> low(state.size()), high(state.size());
    const double there = state[k], h = 1e-7 * std::max(1e-4, std::fabs(there));
    state[k] = there + h;
    equations.evaluate(3.0, state.data(), &modes, inputs, high.data());
    state[k] = there - h;
    equations.evaluate(3.0, state.data(), &modes, inputs, low.data());
    state[k] = there;
    for (std::size_t i = 0; i < state.size(); ++i) {
      (*slope)[i] = (high[i] - low[i]) / (2 * h);
      (*noise)[i] = 1e-15 * (std::fabs(high[i]) + std::fabs(low[i])) / h;
    }
  }
};

std::vector<Json> rigs() {
  Json without = test_plant::plain(1, 2);
  return {test_plant::small(),
          test_plant::changed({{"/physics/friction/tension_loss", "capstan"},
                               {"/physics/friction/pulley_torque", "at_joint"},
                               {"/physics/friction/stribeck_exponent", 2},
                               {"/physics/friction/joint_load", "passing"}}),
          without};
}

// (1 − γ J) times what the blocks give for a unit vector is that vector, J the central differences of the equations.
// With a γ this small every number of J shows up by itself.
TEST(Linearisation, HoldsTheSlopesOfTheEquations) {
  for (const Json& text : rigs()) {
    Case one(text);
    const std::size_t size = one.state.size();
    linearisation blocks(one.numbers);
    for (int trial = 0; trial < 12; ++trial) {
      one.draw();
      one.linearise(&blocks);
      const double gamma = 1e-7;
      ASSERT_TRUE(blocks.factor(gamma));
      std::vector<double> slope(size), noise(size);
      for (std::size_t k = 0; k < size; ++k) {
        one.difference(k, &slope, &noise);
        std::vector<double> found(size);
        for (std::size_t i = 0; i < size; ++i) {
          found[i] = (i == k ? 1.0 : 0.0) - gamma * slope[i];
        }
        blocks.solve(found.data());
        for (std::size_t i = 0; i < size; ++i) {
          EXPECT_NEAR((found[i] - (i == k ? 1.0 : 0.0)) / gamma, 0.0,
                      1e-4 * std::fabs(slope[i]) + 100 * noise[i] + 1e-6)
              << "row " << i << ", column " << k << ", trial " << trial << ", slope " << slope[i];
        }
      }
    }
  }
}

// All of γ that an integrator takes: against the matrix of differences, by its backward error.
TEST(Linearisation, SolvesTheWholeSystem) {
  for (const Json& text : rigs()) {
    Case one(text);
    const std::size_t size = one.state.size();
    linearisation blocks(one.numbers);
    for (int trial = 0; trial < 12; ++trial) {
      one.draw();
      one.linearise(&blocks);
      Matrix jacobian(size, size), rounding(size, size);
      std::vector<double> slope(size), noise(size);
      for (std::size_t k = 0; k < size; ++k) {
        one.difference(k, &slope, &noise);
        jacobian.col(k) = Eigen::Map<Eigen::VectorXd>(slope.data(), size);
        rounding.col(k) = Eigen::Map<Eigen::VectorXd>(noise.data(), size);
      }
      for (const double exponent : {-7.0, -5.5, -4.0, -2.5}) {
        const double gamma = std::pow(10.0, exponent);
        ASSERT_TRUE(blocks.factor(gamma));
        const Eigen::VectorXd right = Eigen::VectorXd::NullaryExpr(size, [&] { return one.between(-1.0, 1.0); });
        const Matrix newton = Matrix::Identity(size, size) - gamma * jacobian;
        Eigen::VectorXd found = right;
        blocks.solve(found.data());
        const Eigen::VectorXd left = newton * found - right;
        const Eigen::VectorXd weight = newton.cwiseAbs() * found.cwiseAbs() + right.cwiseAbs();
        const Eigen::VectorXd lost = gamma * (rounding * found.cwiseAbs());
        for (std::size_t k = 0; k < size; ++k) {
          EXPECT_LT(std::fabs(left[k]), 1e-5 * weight[k] + 20 * lost[k]) << k << " " << gamma;
        }
      }
    }
  }
}

TEST(Linearisation, RefusesWhatIsNotFinite) {
  Case one(test_plant::small());
  one.draw();
  one.state[0] = std::numeric_limits<double>::quiet_NaN();
  one.evaluate();
  linearisation blocks(one.numbers);
  blocks.take(one.equations, one.state.data(), one.inputs);
  EXPECT_FALSE(blocks.factor(1e-4));
}

}  // namespace
