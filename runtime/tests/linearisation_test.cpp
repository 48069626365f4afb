// The Jacobian in blocks: against differences of the equations, and its solutions against those of the dense matrix.
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

TEST(Linearisation, SolvesAsTheDenseMatrixDoes) {
  for (const Json& text : rigs()) {
    Case one(text);
    const Eigen::Index size = static_cast<Eigen::Index>(one.state.size());
    linearisation blocks(one.numbers);
    for (int trial = 0; trial < 40; ++trial) {
      one.draw();
      one.evaluate();
      blocks.take(one.equations, one.state.data(), one.inputs);
      Matrix jacobian(size, size);
      blocks.dense(jacobian.data());
      const double gamma = std::pow(10.0, one.between(-7.0, -2.5));
      ASSERT_TRUE(blocks.factor(gamma));
      const Eigen::VectorXd right = Eigen::VectorXd::NullaryExpr(size, [&] { return one.between(-1.0, 1.0); });
      const Matrix newton = Matrix::Identity(size, size) - gamma * jacobian;
      Eigen::VectorXd found = right;
      blocks.solve(found.data());
      // backward error: what is left of the right side, beside what went into it
      const Eigen::VectorXd left = newton * found - right;
      const Eigen::VectorXd weight = newton.cwiseAbs() * found.cwiseAbs() + right.cwiseAbs();
      for (Eigen::Index k = 0; k < size; ++k) {
        EXPECT_LT(std::fabs(left[k]), 1e-10 * weight[k]) << k << " " << gamma;
      }
    }
  }
}

// Column by column against central differences of the equations.
TEST(Linearisation, IsTheSlopeOfTheEquations) {
  for (const Json& text : rigs()) {
    Case one(text);
    const std::size_t size = one.state.size();
    linearisation blocks(one.numbers);
    Matrix jacobian(size, size);
    for (int trial = 0; trial < 12; ++trial) {
      one.draw();
      one.evaluate();
      const contact_modes modes = one.equations.last().modes;
      blocks.take(one.equations, one.state.data(), one.inputs);
      blocks.dense(jacobian.data());
      std::vector<double> low(size), high(size);
      for (std::size_t k = 0; k < size; ++k) {
        const double there = one.state[k], h = 1e-7 * std::max(1e-4, std::fabs(there));
        one.state[k] = there + h;
        one.equations.evaluate(3.0, one.state.data(), &modes, one.inputs, high.data());
        one.state[k] = there - h;
        one.equations.evaluate(3.0, one.state.data(), &modes, one.inputs, low.data());
        one.state[k] = there;
        for (std::size_t i = 0; i < size; ++i) {
          const double slope = (high[i] - low[i]) / (2 * h);
          const double noise = 1e-15 * (std::fabs(high[i]) + std::fabs(low[i])) / h;  // of the difference
          EXPECT_NEAR(jacobian(i, k), slope, 1e-4 * std::fabs(slope) + 20 * noise + 1e-6)
              << "row " << i << ", column " << k << ", trial " << trial;
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
