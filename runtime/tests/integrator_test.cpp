// CVODE: roots, jumps of the inputs, and what it says when it gives up.
#include <gtest/gtest.h>

#include "integrator.h"
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
  integrator cvode{&equations, 1e-8};

  void advance(double until) { cvode.advance(inputs, until, until, &now); }
};

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
  one.advance(0.2);
  EXPECT_LT(one.now.state[0], -0.01);
  EXPECT_TRUE(one.now.modes.below[0]);
  EXPECT_GE(one.cvode.work().roots, 1u);
  EXPECT_GE(one.cvode.work().restarts, one.cvode.work().roots);
}

// A start exactly on a stop: CVODE leaves out functions that are 0 at its start.
TEST(Cvode, SeesAStopThatItStartsOn) {
  Case one(one_link(-0.01, -0.01)), aside(one_link(-0.01 + 1e-9, -0.01));
  for (Case* each : {&one, &aside}) {
    each->inputs.push.force = {0, 0, 5.0};
    each->inputs.push.point = {0.04, 0, 0};
    EXPECT_FALSE(each->now.modes.below[0]);
    each->advance(0.05);
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
  one.advance(0.01);
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
  bool touched = false;
  for (int k = 1; k <= 100; ++k) {
    one.advance(0.002 * k);
    touched = touched || one.now.modes.touching;
    const contact_modes own = one.equations.modes_at(one.now.state.data());
    EXPECT_EQ(one.now.modes.touching, own.touching) << k;
    EXPECT_TRUE(std::equal(own.slack, own.slack + 2, one.now.modes.slack)) << k;
  }
  EXPECT_TRUE(touched);
}

TEST(Cvode, GivesUpInOneLineAndLeavesTheMomentAlone) {
  Case one(test_plant::small());
  one.advance(0.01);
  const moment before = one.now;
  // a push beyond all bounds
  one.inputs.push = {{1e300, 0, 1e300}, {0.02, 0, 0}, 2};
  one.cvode.forget();
  try {
    one.advance(0.5);
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
  one.inputs.push.force.setZero();
  one.advance(0.02);
  EXPECT_EQ(one.now.time, 0.02);
}

}  // namespace
