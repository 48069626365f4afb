// What is stiff in the Jacobian: what it solves, against differences of the equations.
#include "linearisation.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
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
    blocks->take(equations.last(), state.data());
  }

  /* The derivative, with the torques on the joints but those of the rigid bodies in place of the accelerations. */
  std::vector<double> torques() {
    equations.evaluate(3.0, state.data(), &modes, inputs, derivative.data());
    std::vector<double> found = derivative;
    const evaluation& e = equations.last();
    const std::size_t n = numbers.joint_count();
    for (std::size_t j = 0; j < n; ++j) {
      found[n + j] = e.rigid_torque[j];
      for (std::size_t k = 0; k < n; ++k) {
        found[n + j] += e.mass[j * n + k] * e.acceleration[k];
      }
    }
    return found;
  }

  /* Central differences of a function of the state by its number k, and what rounding makes of them. */
  template <class Function>
  Vector difference(std::size_t k, Function function, Vector* noise) {
    const double there = state[k], h = 1e-6 * std::max(1e-3, std::fabs(there));
    state[k] = there + h;
    const std::vector<double> high = function();
    state[k] = there - h;
    const std::vector<double> low = function();
    state[k] = there;
    const Eigen::Map<const Vector> above(high.data(), high.size()), below(low.data(), low.size());
    *noise = 1e-15 * (above.cwiseAbs() + below.cwiseAbs()) / h;
    return (above - below) / (2 * h);
  }

  /* (I − γ J)⁻¹ of the blocks, column by column. */
  Matrix inverse(linearisation* blocks, double gamma) {
    EXPECT_TRUE(blocks->factor(gamma));
    Matrix found = Matrix::Identity(state.size(), state.size());
    for (auto column : found.colwise()) {
      Vector x = column;
      blocks->solve(x.data());
      column = x;
    }
    return found;
  }
};

/* A rig whose arms and friction laws are the same at every posture and speed, and whose friction has no level above
 * sliding: all that acts on it beside its bodies is in the blocks. */
Json steady() {
  Json rig = test_plant::changed({{"/physics/tendons/0/moment_arm_slope", {0, 0, 0}},
                                  {"/physics/tendons/0/eccentricity", {0, 0, 0}},
                                  {"/physics/friction/edges", Json::array()},
                                  {"/physics/friction/heat/coefficient", 0}});
  rig["physics"].erase("obstacle");
  const auto flatten = [](Json& law) { law["static"] = law["coulomb"]; };
  for (Json& tendon : rig["finger"]["tendons"]) {
    for (const char* kind : {"edge_friction", "pulley_friction"}) {
      for (Json& law : tendon.contains(kind) ? tendon[kind] : tendon["none"]) {
        if (law.contains("laws")) {
          law = Json(law["laws"][0]);
        }
        if (!law.is_null()) {
          flatten(law);
        }
      }
    }
    tendon.erase("none");
  }
  for (Json& joint : rig["finger"]["joints"]) {
    for (const char* kind : {"friction", "load_friction"}) {
      if (joint.contains(kind) && joint[kind].contains("positive")) {
        flatten(joint[kind]["positive"]);
        flatten(joint[kind]["negative"]);
      } else if (joint.contains(kind)) {
        flatten(joint[kind]);
      }
    }
  }
  flatten(rig["physics"]["wrist"]["friction"]);
  return rig;
}

/* Slopes that the blocks hold in the columns of angles .. bristles, against differences of the torques and rates. */
void expect_slopes(Case* one, linearisation* blocks, double share) {
  const state_layout& at = one->equations.layout();
  const std::size_t n = at.joints, size = at.heat();
  const double gamma = 1e-7;  // so small that every number of J shows up by itself
  one->linearise(blocks);
  const Matrix mass = Eigen::Map<const Matrix>(one->equations.last().mass, n, n);
  const Matrix inverse = one->inverse(blocks, gamma);
  for (std::size_t k = 0; k < size; ++k) {
    // J ≈ ((I − γ J)⁻¹ − I)/γ (I − γ J): one more product, since γ J is not small for bristles
    Vector held = inverse.col(k);
    held[k] -= 1.0;
    held /= gamma;
    Vector noise, expected = one->difference(
                      k, [&] { return one->torques(); }, &noise);
    expected.segment(n, n) = mass.lu().solve(expected.segment(n, n));
    noise.segment(n, n) = mass.inverse().cwiseAbs() * noise.segment(n, n);
    expected = inverse * expected;
    noise = inverse.cwiseAbs() * noise;
    for (std::size_t i = 0; i < size; ++i) {
      EXPECT_NEAR(held[i], expected[i], share * std::fabs(expected[i]) + 20 * noise[i] + 1e-6)
          << "row " << i << ", column " << k;
    }
  }
}

TEST(Linearisation, HoldsTheSlopesOfWhatIsStiff) {
  for (const char* loss : {"linear", "capstan"}) {
    for (const char* torque : {"beyond_joint", "at_joint"}) {
      Json text = steady();
      text["physics"]["friction"]["tension_loss"] = loss;
      text["physics"]["friction"]["pulley_torque"] = torque;
      Case one(text);
      one.inputs.push.force.setZero();
      linearisation blocks(one.numbers);
      for (int trial = 0; trial < 6; ++trial) {
        one.draw();
        expect_slopes(&one, &blocks, 1e-4);
      }
    }
  }
}

// At the surface, where its force does not turn with the finger yet.
TEST(Linearisation, HoldsTheSlopesOfAnObstacle) {
  Json text = test_plant::plain(2, 4);
  text["physics"]["obstacle"] = {{"centre", {0.08, 0, -0.02}}, {"radius", 0.02}, {"stiffness", 1e5}, {"damping", 0.5}};
  Case one(text);
  linearisation blocks(one.numbers);
  one.inputs.push.force.setZero();
  std::fill(one.state.begin(), one.state.end(), 0.0);
  one.scheduled_motors();
  one.state[1] = 1e-5;  // turns about y: the tip goes down
  expect_slopes(&one, &blocks, 1e-2);
  EXPECT_TRUE(one.modes.touching);
}

// What is left out of J: Newton's iteration must converge without, at all γ that an integrator takes.
TEST(Linearisation, IsCloseEnoughForNewton) {
  for (const Json& text : {test_plant::small(),
                           test_plant::changed({{"/physics/friction/tension_loss", "capstan"},
                                                {"/physics/friction/pulley_torque", "at_joint"},
                                                {"/physics/friction/stribeck_exponent", 2},
                                                {"/physics/friction/joint_load", "passing"}}),
                           test_plant::plain(1, 2)}) {
    Case one(text);
    linearisation blocks(one.numbers);
    const auto size = static_cast<Eigen::Index>(one.state.size());
    for (int trial = 0; trial < 12; ++trial) {
      one.draw();
      one.linearise(&blocks);
      Matrix jacobian(size, size);
      Vector noise;
      for (Eigen::Index k = 0; k < size; ++k) {
        jacobian.col(k) = one.difference(
            static_cast<std::size_t>(k),
            [&] {
              one.equations.evaluate(3.0, one.state.data(), &one.modes, one.inputs, one.derivative.data());
              return one.derivative;
            },
            &noise);
      }
      for (const double exponent : {-7.0, -5.5, -4.0, -3.0, -2.5}) {
        const double gamma = std::pow(10.0, exponent);
        const Matrix identity = Matrix::Identity(size, size);
        const Matrix left = identity - one.inverse(&blocks, gamma) * (identity - gamma * jacobian);
        EXPECT_LT(left.eigenvalues().cwiseAbs().maxCoeff(), 0.2) << gamma;
      }
    }
  }
}

TEST(Linearisation, RefusesWhatIsNotFinite) {
  Case one(test_plant::small());
  one.draw();
  one.state[0] = std::numeric_limits<double>::quiet_NaN();
  linearisation blocks(one.numbers);
  one.linearise(&blocks);
  EXPECT_FALSE(blocks.factor(1e-4));
}

}  // namespace
