// The simulated finger as a whole, through its C interface: order of calls, inputs, saved states, failures.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test_plant.h"

namespace {

using test_plant::Bytes;
using test_plant::Json;
using test_plant::Plant;
using test_plant::same;
using test_plant::Signals;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/* Both integrators, each with and without sensors. */
struct PlantOf : testing::TestWithParam<std::pair<int, int>> {
  void prepare(Plant& plant) {
    tendonfmu_plant_settings settings = plant.settings();
    settings.integrator = GetParam().first;
    settings.sensors = GetParam().second;
    ASSERT_EQ(tendonfmu_plant_set_settings(plant, &settings), TENDONFMU_PLANT_OK);
  }
  void start(Plant& plant) {
    prepare(plant);
    ASSERT_EQ(tendonfmu_plant_initialise(plant), TENDONFMU_PLANT_OK) << plant.error();
  }
};
INSTANTIATE_TEST_SUITE_P(Integrators, PlantOf,
                         testing::Values(std::pair(1, 0), std::pair(1, 1), std::pair(2, 0), std::pair(2, 1)));

void push(const Plant& plant, double force) {
  tendonfmu_plant_inputs inputs = {};
  inputs.push_force[2] = force;
  ASSERT_EQ(tendonfmu_plant_set_inputs(plant, &inputs), TENDONFMU_PLANT_OK);
}

TEST_P(PlantOf, TwoRestoresAreTheSameToTheBit) {
  Plant one;
  start(one);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.1), TENDONFMU_PLANT_OK);
  push(one, 0.8);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.2345), TENDONFMU_PLANT_OK);
  const Bytes saved = one.saved();
  ASSERT_FALSE(saved.empty());
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.4), TENDONFMU_PLANT_OK);

  // straight on, back in the same plant, and in others: one with a past, one that has not been initialised
  Plant past, fresh;
  start(past);
  ASSERT_EQ(tendonfmu_plant_advance(past, 0.31), TENDONFMU_PLANT_OK);
  prepare(fresh);
  Plant again;
  start(again);
  for (Plant* each : {&past, &fresh, &again}) {
    ASSERT_EQ(each->restore(saved), TENDONFMU_PLANT_OK) << each->error();
    EXPECT_EQ(each->time(), 0.2345);
    EXPECT_TRUE(tendonfmu_plant_is_initialised(*each));
    ASSERT_EQ(tendonfmu_plant_advance(*each, 0.4), TENDONFMU_PLANT_OK) << each->error();
  }
  EXPECT_TRUE(same(past, fresh));
  EXPECT_TRUE(same(past, again));
  const std::vector<double> straight = one.state(), restored = past.state();
  for (std::size_t j = 0; j < one.joints(); ++j) {
    EXPECT_NEAR(restored[j], straight[j], 1e-4);
  }
  ASSERT_EQ(one.restore(saved), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.4), TENDONFMU_PLANT_OK);
  EXPECT_TRUE(same(one, past));
}

TEST_P(PlantOf, SavedBytesComeBack) {
  Plant one;
  start(one);
  push(one, 0.5);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.05), TENDONFMU_PLANT_OK);
  const Bytes saved = one.saved();
  Signals before(one), after(one);
  ASSERT_EQ(tendonfmu_plant_get_signals(one, &before.view), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.saved(), saved);  // looking changes nothing
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.08), TENDONFMU_PLANT_OK);
  ASSERT_EQ(one.restore(saved), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_get_signals(one, &after.view), TENDONFMU_PLANT_OK);
  EXPECT_TRUE(before == after);
  EXPECT_EQ(one.saved(), saved);
}

TEST_P(PlantOf, DamagedStatesAreRefusedAndChangeNothing) {
  Plant one;
  start(one);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.02), TENDONFMU_PLANT_OK);
  const Bytes saved = one.saved();
  for (std::size_t k = 0; k < saved.size(); k += 1 + k / 40) {
    for (const unsigned char flip : {1, 128}) {
      Bytes damaged = saved;
      damaged[k] ^= flip;
      ASSERT_EQ(one.restore(damaged), TENDONFMU_PLANT_BAD_STATE) << k;
      ASSERT_EQ(one.error().substr(0, 6), "state:");
    }
  }
  Bytes shorter(saved.begin(), saved.end() - 1), longer = saved;
  longer.push_back(0);
  EXPECT_EQ(one.restore(shorter), TENDONFMU_PLANT_BAD_STATE);
  EXPECT_EQ(one.restore(longer), TENDONFMU_PLANT_BAD_STATE);
  EXPECT_EQ(one.restore(Bytes(saved.size(), 0)), TENDONFMU_PLANT_BAD_STATE);
  EXPECT_EQ(one.saved(), saved);
}

TEST_P(PlantOf, StatesOfOtherRigsAndSettingsAreRefused) {
  Plant one, other(test_plant::changed({{"/physics/links/0/mass", 0.021}}));
  start(one);
  start(other);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.01), TENDONFMU_PLANT_OK);
  EXPECT_EQ(other.restore(one.saved()), TENDONFMU_PLANT_BAD_STATE);
  EXPECT_EQ(other.error(), "state: of another rig");

  tendonfmu_plant_settings changed[6];
  for (auto& each : changed) {
    each = one.settings();
  }
  changed[0].relative_tolerance *= 2;
  changed[1].step *= 2;
  changed[2].seed += 1;
  changed[3].push_point[1] += 1e-6;
  changed[4].scheduled_pushes = 0;
  changed[5].seed += std::uint64_t{1} << 60;
  for (const auto& settings : changed) {
    Plant third;
    ASSERT_EQ(tendonfmu_plant_set_settings(third, &settings), TENDONFMU_PLANT_OK);
    ASSERT_EQ(tendonfmu_plant_initialise(third), TENDONFMU_PLANT_OK);
    EXPECT_EQ(third.restore(one.saved()), TENDONFMU_PLANT_BAD_STATE) << &settings - changed;
    EXPECT_EQ(third.error(), "state: taken with other settings");
  }
}

// A seed may be any number of 64 bits, also where a double has no room for it.
TEST(Plant, StatesOfNeighbouringLargeSeedsAreTold) {
  Plant one, other;
  tendonfmu_plant_settings settings = one.settings();
  settings.seed = (std::uint64_t{1} << 60) + 1;
  ASSERT_EQ(tendonfmu_plant_set_settings(one, &settings), TENDONFMU_PLANT_OK);
  settings.seed += 1;
  ASSERT_EQ(tendonfmu_plant_set_settings(other, &settings), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(other.restore(one.saved()), TENDONFMU_PLANT_BAD_STATE);
}

// An advance that fails leaves time, state, sensors and signals as they were, and the plant goes on from there as if
// nothing had been tried.
TEST_P(PlantOf, FailedAdvanceLeavesEverythingAsItWas) {
  Plant one, untouched;
  for (Plant* each : {&one, &untouched}) {
    start(*each);
    ASSERT_EQ(tendonfmu_plant_advance(*each, 0.0205), TENDONFMU_PLANT_OK);
  }
  tendonfmu_plant_inputs absurd = {};
  absurd.push_force[0] = absurd.push_force[2] = 1e6;
  ASSERT_EQ(tendonfmu_plant_set_inputs(one, &absurd), TENDONFMU_PLANT_OK);
  const Bytes pushed = one.saved();
  ASSERT_EQ(tendonfmu_plant_advance(one, 5.0), TENDONFMU_PLANT_SOLVER);
  EXPECT_NE(one.error().find(" s"), std::string::npos) << one.error();
  EXPECT_EQ(one.error().find('\n'), std::string::npos) << one.error();
  EXPECT_EQ(one.time(), 0.0205);
  EXPECT_EQ(one.saved(), pushed);
  push(one, 0.0);
  push(untouched, 0.1);  // begins anew as well
  push(untouched, 0.0);
  EXPECT_EQ(one.saved(), untouched.saved());
  for (Plant* each : {&one, &untouched}) {
    ASSERT_EQ(tendonfmu_plant_advance(*each, 0.05), TENDONFMU_PLANT_OK);
  }
  EXPECT_TRUE(same(one, untouched));
}

TEST_P(PlantOf, RunIsAdvanceAndGetSignals) {
  Plant one, other;
  start(one);
  start(other);
  const std::vector<double> time = {0.0, 0.001, 0.0015, 0.01, 0.01, 0.0205};
  Signals table(one, time.size());
  std::size_t done = 99;
  ASSERT_EQ(tendonfmu_plant_run(one, time.size(), time.data(), &table.view, &done), TENDONFMU_PLANT_OK);
  EXPECT_EQ(done, time.size());
  for (std::size_t k = 0; k < time.size(); ++k) {
    Signals row(other);
    ASSERT_EQ(tendonfmu_plant_advance(other, time[k]), TENDONFMU_PLANT_OK);
    ASSERT_EQ(tendonfmu_plant_get_signals(other, &row.view), TENDONFMU_PLANT_OK);
    for (std::size_t a = 0; a < row.real.size(); ++a) {
      const std::size_t size = row.real[a].size();
      for (std::size_t i = 0; i < size; ++i) {
        EXPECT_EQ(table.real[a][k * size + i], row.real[a][i]) << a;
      }
    }
    EXPECT_EQ(table.contact[k], row.contact[0]);
  }
  // stops at the first failure
  const double back[] = {0.03, 0.02, 0.04};
  ASSERT_EQ(tendonfmu_plant_run(one, 3, back, &table.view, &done), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(done, 1u);
  EXPECT_EQ(one.time(), 0.03);
  ASSERT_EQ(tendonfmu_plant_run(one, 0, back, &table.view, &done), TENDONFMU_PLANT_OK);
  EXPECT_EQ(done, 0u);
}

TEST_P(PlantOf, InputsAreHeld) {
  Plant one, other;
  start(one);
  start(other);
  push(one, 0.7);
  push(other, 0.7);
  for (const double time : {0.01, 0.02}) {
    ASSERT_EQ(tendonfmu_plant_advance(one, time), TENDONFMU_PLANT_OK);
    ASSERT_EQ(tendonfmu_plant_advance(other, time), TENDONFMU_PLANT_OK);
    push(other, 0.7);  // the same again: no change
    EXPECT_TRUE(same(one, other)) << time;
  }
  // NULL leaves the command as it is
  const std::vector<double> command(one.tendons(), 1e-4);
  tendonfmu_plant_inputs inputs = {};
  inputs.tendon_position_command = command.data();
  ASSERT_EQ(tendonfmu_plant_set_inputs(one, &inputs), TENDONFMU_PLANT_OK);
  const Bytes given = one.saved();
  inputs.tendon_position_command = nullptr;
  ASSERT_EQ(tendonfmu_plant_set_inputs(one, &inputs), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.saved(), given);
}

TEST_P(PlantOf, TimesNextToEachOtherAreTimes) {
  Plant one;
  start(one);
  double time = 0.0;
  for (const double next : {5e-324, 1e-310, 1e-12, 0.001, 0.0011, 0.1}) {
    ASSERT_EQ(tendonfmu_plant_advance(one, next), TENDONFMU_PLANT_OK) << next << ": " << one.error();
    time = std::nextafter(next, 1.0);
    ASSERT_EQ(tendonfmu_plant_advance(one, time), TENDONFMU_PLANT_OK) << next << ": " << one.error();
    push(one, 0.001 * (1 + next));  // begins anew
    time = std::nextafter(time, 1.0);
    ASSERT_EQ(tendonfmu_plant_advance(one, time), TENDONFMU_PLANT_OK) << next << ": " << one.error();
    EXPECT_EQ(one.time(), time);
    for (const double x : one.state()) {
      ASSERT_TRUE(std::isfinite(x)) << next;
    }
  }
}

TEST(Plant, RefusesTimesThatAreNone) {
  Plant one;
  EXPECT_EQ(tendonfmu_plant_advance(one, 0.1), TENDONFMU_PLANT_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  for (const double time : {nan, HUGE_VAL, -HUGE_VAL, 1e9, 1e300}) {
    EXPECT_EQ(tendonfmu_plant_advance(one, time), TENDONFMU_PLANT_BAD_ARGUMENT) << time;
  }
  EXPECT_EQ(tendonfmu_plant_advance(one, -1e-9), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_plant_advance(one, -0.0), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.time(), 0.0);
}

TEST(Plant, RefusesInputsThatAreNotFinite) {
  Plant one;
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  const Bytes before = one.saved();
  for (const double bad : {nan, HUGE_VAL, -HUGE_VAL, 1e7}) {
    std::vector<double> command(one.tendons(), 0.0);
    command.back() = bad;
    tendonfmu_plant_inputs inputs = {};
    inputs.tendon_position_command = command.data();
    EXPECT_EQ(tendonfmu_plant_set_inputs(one, &inputs), TENDONFMU_PLANT_BAD_ARGUMENT);
    inputs.tendon_position_command = nullptr;
    inputs.pretension = bad;
    EXPECT_EQ(tendonfmu_plant_set_inputs(one, &inputs), TENDONFMU_PLANT_BAD_ARGUMENT);
    inputs.pretension = 1.0;
    inputs.push_force[1] = bad;
    EXPECT_EQ(tendonfmu_plant_set_inputs(one, &inputs), TENDONFMU_PLANT_BAD_ARGUMENT);
  }
  EXPECT_EQ(one.saved(), before);
}

TEST(Plant, SettingsAreSetBeforeTheInitialisationOnly) {
  Plant one;
  const tendonfmu_plant_settings good = one.settings();
  std::vector<tendonfmu_plant_settings> bad(14, good);
  bad[0].integrator = 0;
  bad[1].integrator = 3;
  bad[2].relative_tolerance = 1e-11;
  bad[3].relative_tolerance = nan;
  bad[4].relative_tolerance = 0.1;
  bad[5].step = 0.0;
  bad[6].step = -1e-3;
  bad[7].step = nan;
  bad[8].step = HUGE_VAL;
  bad[9].push_link = 0;
  bad[10].push_link = 4;
  bad[11].push_link = std::numeric_limits<int>::min();
  bad[12].push_point[0] = nan;
  bad[13].push_point[2] = 11.0;
  for (const auto& each : bad) {
    EXPECT_EQ(tendonfmu_plant_set_settings(one, &each), TENDONFMU_PLANT_BAD_ARGUMENT) << &each - bad.data();
    EXPECT_EQ(one.settings().push_link, good.push_link);
    EXPECT_EQ(one.settings().step, good.step);
  }
  ASSERT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_OK);
}

TEST(Plant, NothingIsToldBeforeTheInitialisation) {
  Plant one;
  Signals signals(one);
  EXPECT_FALSE(tendonfmu_plant_is_initialised(one));
  EXPECT_EQ(tendonfmu_plant_get_signals(one, &signals.view), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(one.error(), "expected after the initialisation only");
  Bytes bytes(tendonfmu_plant_state_size(one));
  EXPECT_EQ(tendonfmu_plant_save_state(one, bytes.data(), bytes.size()), TENDONFMU_PLANT_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_state_size(one), bytes.size());
  EXPECT_EQ(tendonfmu_plant_save_state(one, bytes.data(), bytes.size() - 1), TENDONFMU_PLANT_BAD_ARGUMENT);
}

TEST_P(PlantOf, ResetBeginsAgain) {
  Plant one, fresh;
  start(one);
  push(one, 0.4);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.1), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
  EXPECT_FALSE(tendonfmu_plant_is_initialised(one));
  EXPECT_EQ(one.time(), 0.0);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  start(fresh);
  for (Plant* each : {&one, &fresh}) {
    ASSERT_EQ(tendonfmu_plant_advance(*each, 0.05), TENDONFMU_PLANT_OK);
  }
  EXPECT_TRUE(same(one, fresh));
}

// A rig whose first motion fails stays uninitialised, and can be tried again.
TEST_P(PlantOf, FailedInitialisationCanBeRepeated) {
  Plant one, fresh;
  prepare(one);
  tendonfmu_plant_inputs absurd = {};
  absurd.push_force[0] = absurd.push_force[2] = 1e6;
  ASSERT_EQ(tendonfmu_plant_set_inputs(one, &absurd), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_SOLVER);
  EXPECT_FALSE(tendonfmu_plant_is_initialised(one));
  push(one, 0.0);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK) << one.error();
  start(fresh);
  EXPECT_TRUE(same(one, fresh));
}

TEST(Plant, DerivativeWantsFiniteTimeAndState) {
  Plant one;
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  const std::size_t order = tendonfmu_plant_order(one);
  std::vector<double> derivative(order), jacobian(order * order);
  const std::vector<double> state = one.state();
  ASSERT_EQ(tendonfmu_plant_derivative(one, 0.0, state.data(), derivative.data(), jacobian.data()), TENDONFMU_PLANT_OK);
  for (const double x : derivative) {
    EXPECT_TRUE(std::isfinite(x));
  }
  for (const double x : jacobian) {
    EXPECT_TRUE(std::isfinite(x));
  }
  for (const double bad : {nan, HUGE_VAL, -HUGE_VAL}) {
    EXPECT_EQ(tendonfmu_plant_derivative(one, bad, state.data(), derivative.data(), nullptr),
              TENDONFMU_PLANT_BAD_ARGUMENT);
    for (std::size_t k = 0; k < order; k += 5) {
      std::vector<double> wrong = state;
      wrong[k] = bad;
      EXPECT_EQ(tendonfmu_plant_derivative(one, 0.0, wrong.data(), derivative.data(), nullptr),
                TENDONFMU_PLANT_BAD_ARGUMENT);
    }
  }
}

// An advance of many seconds without sensors is one call of CVODE with very many steps.
TEST(Plant, LongAdvancesHaveStepsEnough) {
  Json rig = test_plant::plain(1, 2);
  rig["motion"]["joints"][0] = {{"time", Json::array()},
                                {"position", Json::array()},
                                {"velocity", Json::array()},
                                {"acceleration", Json::array()}};
  for (int k = 0; k <= 5000; ++k) {
    Json& knots = rig["motion"]["joints"][0];
    knots["time"].push_back(k);
    knots["position"].push_back(k % 2 ? 0.3 : -0.3);
    knots["velocity"].push_back(0);
    knots["acceleration"].push_back(0);
  }
  Plant one(rig);
  tendonfmu_plant_settings settings = one.settings();
  settings.sensors = 0;
  ASSERT_EQ(tendonfmu_plant_set_settings(one, &settings), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_advance(one, 4500.0), TENDONFMU_PLANT_OK) << one.error();
  tendonfmu_plant_statistics work;
  ASSERT_EQ(tendonfmu_plant_get_statistics(one, &work), TENDONFMU_PLANT_OK);
  EXPECT_GT(work.steps, 200000u);
}

}  // namespace
