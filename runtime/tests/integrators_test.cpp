// CVODE and the fixed steps: roots, times next to each other, convergence, and what they say when they give up.
#include <gtest/gtest.h>

#include "cvode_integrator.h"
#include "fixed_step_integrator.h"
#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;
using test_plant::Json;

/* A rig with its equations, at rest in its first posture at time 0. */
struct Case {
  rig numbers;
  dynamics equations{numbers};
  commands inputs;
  moment now;

  explicit Case(const Json& text) : numbers(test_plant::read(text)) {
    now.state.assign(numbers.order(), 0.0);
    for (std::size_t j = 0; j < numbers.joint_count(); ++j) {
      now.state[j] = numbers.motion[j].position.front();
    }
    equations.command_motors(0.0, inputs, now.state.data() + equations.layout().motor());
    now.modes = equations.modes_at(now.state.data());
  }
  std::unique_ptr<integrator> cvode(double tolerance = 1e-8) { return make_cvode_integrator(&equations, tolerance); }
};

double largest_difference(const std::vector<double>& a, const std::vector<double>& b, std::size_t count) {
  double most = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    most = std::max(most, std::fabs(a[k] - b[k]));
  }
  return most;
}

/* One hanging link that gravity or a push drives into its lower stop, held by two slack-going tendons. */
Json one_link(double start, double lower) {
  Json rig = test_plant::plain(1, 2);
  rig["physics"]["links"][0]["limits"] = {{"lower", lower}, {"upper", 1.0}, {"stiffness", 5.0}, {"damping", 0.0}};
  rig["motion"]["joints"][0]["position"] = {start};
  rig["settle"] = 0.0;
  return rig;
}

TEST(Cvode, SwitchesStopsAtTheirRoots) {
  Case one(one_link(0.0, -0.01));
  one.inputs.push.force = {0, 0, 50.0};  // turns about y: downwards in angle
  one.inputs.push.point = {0.04, 0, 0};
  const auto with = one.cvode();
  with->advance(one.inputs, 0.2, &one.now);
  EXPECT_LT(one.now.state[0], -0.01);
  EXPECT_TRUE(one.now.modes.below[0]);
  EXPECT_GE(with->work().roots, 1u);
  EXPECT_GE(with->work().restarts, with->work().roots);
}

// A start exactly on a stop: CVODE leaves out functions that are 0 at its start.
TEST(Cvode, SeesAStopThatItStartsOn) {
  Case one(one_link(-0.01, -0.01)), aside(one_link(-0.01 + 1e-9, -0.01));
  for (Case* each : {&one, &aside}) {
    each->inputs.push.force = {0, 0, 5.0};
    each->inputs.push.point = {0.04, 0, 0};
    EXPECT_FALSE(each->now.modes.below[0]);
    each->cvode()->advance(each->inputs, 0.05, &each->now);
    EXPECT_LT(each->now.state[0], -0.01);
    EXPECT_TRUE(each->now.modes.below[0]);
  }
  EXPECT_NEAR(one.now.state[0], aside.now.state[0], 1e-6);
}

// The same for a tendon that is just taut: it must not push afterwards.
TEST(Cvode, SeesATendonThatStartsWithoutTension) {
  Case one(one_link(0.0, -1.0));
  const std::size_t motor = one.equations.layout().motor();
  one.inputs.scheduled_motion = false;
  one.inputs.given = true;
  for (std::size_t i = 0; i < 2; ++i) {
    one.now.state[motor + i] = one.inputs.command[i] = 0.0;  // elongation 0, both
  }
  one.now.modes = {};  // taut, by its sign
  one.inputs.push.force = {0, 0, 1.0};
  one.inputs.push.point = {0.04, 0, 0};
  one.cvode()->advance(one.inputs, 0.01, &one.now);
  one.equations.evaluate(0.01, one.now.state.data(), &one.now.modes, one.inputs,
                         std::vector<double>(one.numbers.order()).data());
  const evaluation& e = one.equations.last();
  EXPECT_NE(e.elongation[0] > 0.0, e.elongation[1] > 0.0);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_GE(e.force[i], 0.0);
    EXPECT_EQ(one.now.modes.slack[i], !(e.elongation[i] > 0.0)) << e.elongation[i];
  }
}

TEST(Cvode, FindsTheObstacle) {
  Json text = one_link(0.0, -2.0);
  text["physics"]["obstacle"] = {{"centre", {0.04, 0, 0.03}}, {"radius", 0.02}, {"stiffness", 1000}};
  Case one(text);
  EXPECT_FALSE(one.now.modes.touching);
  one.inputs.push.force = {0, 0, 20.0};
  one.inputs.push.point = {0.04, 0, 0};
  const auto with = one.cvode();
  bool touched = false;
  for (int k = 1; k <= 100; ++k) {
    with->advance(one.inputs, 0.002 * k, &one.now);
    touched = touched || one.now.modes.touching;
    const contact_modes own = one.equations.modes_at(one.now.state.data());
    EXPECT_EQ(one.now.modes.touching, own.touching) << k;
    EXPECT_TRUE(std::equal(own.slack, own.slack + 2, one.now.modes.slack)) << k;
  }
  EXPECT_TRUE(touched);
}

TEST(Cvode, GivesUpInOneLineAndLeavesTheMomentAlone) {
  Case one(test_plant::small());
  const auto with = one.cvode();
  with->advance(one.inputs, 0.01, &one.now);
  const moment before = one.now;
  // a push beyond all bounds
  one.inputs.push = {{1e300, 0, 1e300}, {0.02, 0, 0}, 2};
  with->forget();
  try {
    with->advance(one.inputs, 0.5, &one.now);
    FAIL() << "expected a solver_error";
  } catch (const solver_error& failed) {
    const std::string line = failed.what();
    EXPECT_NE(line.find(" at t = 0.0"), std::string::npos) << line;
    EXPECT_NE(line.find("CVODE flag -"), std::string::npos) << line;
    EXPECT_NE(line.find(": "), std::string::npos) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  EXPECT_EQ(one.now.time, before.time);
  EXPECT_EQ(one.now.state, before.state);
  // and goes on afterwards
  one.inputs.push.force = {};
  with->advance(one.inputs, 0.02, &one.now);
  EXPECT_EQ(one.now.time, 0.02);
}

TEST(FixedSteps, AgreeWithCvodeTheBetterTheSmaller) {
  Case one(test_plant::small());
  one.cvode(1e-9)->advance(one.inputs, 0.3, &one.now);
  double error[2];
  for (const int fine : {0, 1}) {
    Case other(test_plant::small());
    fixed_step_integrator(&other.equations, fine ? 2.5e-5 : 2e-4).advance(other.inputs, 0.3, &other.now);
    error[fine] = largest_difference(one.now.state, other.now.state, 3);
  }
  EXPECT_LT(error[0], 3e-3);
  EXPECT_LT(error[1], 0.25 * error[0]);
}

// Heat that is gone within a step must not swing up.
TEST(FixedSteps, StayStableHoweverFastHeatFades) {
  for (const double time : {1e-12, 1e-6, 1e-3}) {
    Case one(test_plant::changed({{"/physics/friction/heat/time_constant", time}}));
    one.now.state[one.equations.layout().heat()] = 1.0;
    fixed_step_integrator with(&one.equations, 1e-3);
    with.advance(one.inputs, 0.2, &one.now);
    EXPECT_LT(std::fabs(one.now.state[one.equations.layout().heat()]), 1.0 + 1e-3);
  }
}

}  // namespace
