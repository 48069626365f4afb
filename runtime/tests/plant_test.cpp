// The simulated finger as a whole, through its C interface: saved states, failures, refusals, and the ends of what it
// takes.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "bytes.h"
#include "test_plant.h"

namespace {

using test_plant::Bytes;
using test_plant::Json;
using test_plant::Plant;
using test_plant::same;
using test_plant::Signals;

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();

void set(const Plant& plant, const std::function<void(tendonfmu_plant_settings*)>& change) {
  tendonfmu_plant_settings settings = plant.settings();
  change(&settings);
  ASSERT_EQ(tendonfmu_plant_set_settings(plant, &settings), TENDONFMU_PLANT_OK) << plant.error();
}

void initialise(const Plant& plant) {
  ASSERT_EQ(tendonfmu_plant_initialise(plant), TENDONFMU_PLANT_OK) << plant.error();
}

void advance(const Plant& plant, double time) {
  ASSERT_EQ(tendonfmu_plant_advance(plant, time), TENDONFMU_PLANT_OK) << time << ": " << plant.error();
}

void push(const Plant& plant, double force) {
  tendonfmu_plant_inputs inputs = {};
  inputs.push_force[2] = force;
  ASSERT_EQ(tendonfmu_plant_set_inputs(plant, &inputs), TENDONFMU_PLANT_OK);
}

/* so that the solver gives up */
void push_absurdly(const Plant& plant) {
  tendonfmu_plant_inputs absurd = {};
  absurd.push_force[0] = absurd.push_force[2] = 1e6;
  ASSERT_EQ(tendonfmu_plant_set_inputs(plant, &absurd), TENDONFMU_PLANT_OK);
}

/* A tight and a rough tolerance, each with and without sensors. */
struct PlantOf : testing::TestWithParam<std::pair<double, int>> {
  void prepare(Plant& plant) {
    set(plant, [](auto* settings) { std::tie(settings->relative_tolerance, settings->sensors) = GetParam(); });
  }
  void start(Plant& plant) {
    prepare(plant);
    initialise(plant);
  }
};
INSTANTIATE_TEST_SUITE_P(Tolerances, PlantOf,
                         testing::Values(std::pair(1e-6, 0), std::pair(1e-6, 1), std::pair(1e-4, 0),
                                         std::pair(1e-4, 1)));

// --- saved states ---------------------------------------------------------------------------------------------------

TEST_P(PlantOf, TwoRestoresAreTheSameToTheBit) {
  Plant one;
  start(one);
  advance(one, 0.1);
  push(one, 0.8);
  advance(one, 0.2345);
  const Bytes saved = one.saved();
  ASSERT_FALSE(saved.empty());
  Signals before(one), after(one);
  ASSERT_EQ(tendonfmu_plant_get_signals(one, &before.view), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.saved(), saved);  // looking changes nothing
  advance(one, 0.4);

  // straight on, back in the same plant, and in others: one with a past, one that has not been initialised
  Plant past, fresh;
  start(past);
  advance(past, 0.31);
  prepare(fresh);
  Plant again;
  start(again);
  for (Plant* each : {&past, &fresh, &again}) {
    ASSERT_EQ(each->restore(saved), TENDONFMU_PLANT_OK) << each->error();
    EXPECT_EQ(each->time(), 0.2345);
    EXPECT_TRUE(tendonfmu_plant_is_initialised(*each));
    advance(*each, 0.4);
  }
  EXPECT_TRUE(same(past, fresh));
  EXPECT_TRUE(same(past, again));
  const std::vector<double> straight = one.state(), restored = past.state();
  for (std::size_t j = 0; j < one.joints(); ++j) {
    EXPECT_NEAR(restored[j], straight[j], 1e-4);
  }
  ASSERT_EQ(one.restore(saved), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_get_signals(one, &after.view), TENDONFMU_PLANT_OK);
  EXPECT_TRUE(before == after);
  EXPECT_EQ(one.saved(), saved);
  advance(one, 0.4);
  EXPECT_TRUE(same(one, past));
}

TEST_P(PlantOf, DamagedStatesAreRefusedAndChangeNothing) {
  Plant one;
  start(one);
  advance(one, 0.02);
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
  advance(one, 0.01);
  EXPECT_EQ(other.restore(one.saved()), TENDONFMU_PLANT_BAD_STATE);
  EXPECT_EQ(other.error(), "state: of another rig");

  // a seed may be any number of 64 bits, also where a double has no room for it
  const std::function<void(tendonfmu_plant_settings*)> changes[] = {
      [](auto* s) { s->relative_tolerance *= 2; }, [](auto* s) { s->seed += 1; },
      [](auto* s) { s->seed += std::uint64_t{1} << 60; }, [](auto* s) { s->push_point[1] += 1e-6; },
      [](auto* s) { s->scheduled_pushes = 0; }};
  for (const auto& change : changes) {
    Plant third;
    prepare(third);
    set(third, change);
    initialise(third);
    EXPECT_EQ(third.restore(one.saved()), TENDONFMU_PLANT_BAD_STATE) << &change - changes;
    EXPECT_EQ(third.error(), "state: taken with other settings");
  }
}

constexpr std::size_t header_bytes = 40, digest_at = 32;  // of a state of the plant; numbers follow

std::size_t number_count(const Bytes& state) {
  return (state.size() - header_bytes) / sizeof(double);
}

/* The state with another number, and the digest that belongs to it. */
Bytes with_number(Bytes state, std::size_t index, double value) {
  std::memcpy(&state[header_bytes + index * sizeof value], &value, sizeof value);
  const std::uint64_t digest = hash_bytes(&state[header_bytes], number_count(state) * sizeof value, 0);
  std::memcpy(&state[digest_at], &digest, sizeof digest);
  return state;
}

/* The small rig with a delay and a play. */
const Json delayed_rig =
    test_plant::changed({{"/sensors/tendon_position/delay", 0.0035}, {"/sensors/tendon_position/backlash", 1e-4}});

bool shows_finite_numbers(const Plant& plant) {
  Signals signals(plant);
  bool finite = tendonfmu_plant_get_signals(plant, &signals.view) == TENDONFMU_PLANT_OK;
  for (const std::vector<double>& one : signals.real) {
    for (const double x : one) {
      finite = finite && std::isfinite(x);
    }
  }
  return finite;
}

// Refused by name, or the finger goes on: steps are taken with finite outputs, or refused by name, in bounded work.
TEST_P(PlantOf, GoesOnFromAStateWhateverNumbersStandInIt) {
  Plant one(delayed_rig), unspoiled(delayed_rig);
  start(one);
  start(unspoiled);
  advance(one, 0.02);
  const Bytes good = one.saved();
  ASSERT_EQ(with_number(good, 0, 0.02), good);
  std::size_t taken = 0, refused = 0, tried = 0;
  const std::size_t stride = GetParam().first < 1e-5 ? 7 : 1;  // a tight tolerance takes its time
  for (std::size_t index = 0; index < number_count(good); index += stride) {
    ++tried;
    for (const double value : {std::nan(""), inf, -inf, -1.0, 1e300, -1e6, 0.5, 9007199254740992.0}) {
      SCOPED_TRACE("number " + std::to_string(index) + " = " + std::to_string(value));
      const tendonfmu_plant_status status = one.restore(with_number(good, index, value));
      if (status != TENDONFMU_PLANT_OK) {
        ASSERT_EQ(status, TENDONFMU_PLANT_BAD_STATE);
        ASSERT_EQ(one.error(), "state: a number is out of its range");
        ++refused;
        continue;
      }
      ++taken;
      ASSERT_TRUE(shows_finite_numbers(one));
      tendonfmu_plant_statistics before, after;
      ASSERT_EQ(tendonfmu_plant_get_statistics(one, &before), TENDONFMU_PLANT_OK);
      for (const double time : {0.021, 0.022}) {
        if (tendonfmu_plant_advance(one, time) != TENDONFMU_PLANT_OK) {
          ASSERT_NE(one.error(), "");
        }
        ASSERT_TRUE(shows_finite_numbers(one));
      }
      ASSERT_EQ(tendonfmu_plant_get_statistics(one, &after), TENDONFMU_PLANT_OK);
      ASSERT_LT(after.steps - before.steps, 200000u);
      ASSERT_EQ(one.restore(good), TENDONFMU_PLANT_OK);
    }
  }
  EXPECT_GT(taken, tried);
  EXPECT_GT(refused, 3 * tried);
  // and none of it left a trace
  for (Plant* each : {&one, &unspoiled}) {
    ASSERT_EQ(each->restore(good), TENDONFMU_PLANT_OK);
    advance(*each, 0.05);
  }
  EXPECT_TRUE(same(one, unspoiled));
}

// --- failures, runs, resets -----------------------------------------------------------------------------------------

// An advance that fails leaves time, state, sensors and signals as they were, and the plant goes on from there as if
// nothing had been tried.
TEST_P(PlantOf, FailedAdvanceLeavesEverythingAsItWas) {
  Plant one, untouched;
  for (Plant* each : {&one, &untouched}) {
    start(*each);
    advance(*each, 0.0205);
  }
  push_absurdly(one);
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
    advance(*each, 0.05);
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
    advance(other, time[k]);
    ASSERT_EQ(tendonfmu_plant_get_signals(other, &row.view), TENDONFMU_PLANT_OK);
    for (std::size_t a = 0; a < row.real.size(); ++a) {
      EXPECT_TRUE(std::equal(row.real[a].begin(), row.real[a].end(), &table.real[a][k * row.real[a].size()])) << a;
    }
    EXPECT_EQ(table.contact[k], row.contact[0]);
  }
  // stops at the first failure
  const double back[] = {0.03, 0.02, 0.04};
  ASSERT_EQ(tendonfmu_plant_run(one, 3, back, &table.view, &done), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(done, 1u);
  EXPECT_EQ(one.time(), 0.03);
}

TEST_P(PlantOf, TimesNextToEachOtherAreTimes) {
  Plant one;
  start(one);
  for (const double next : {5e-324, 1e-310, 1e-12, 0.001, 0.0011, 0.1}) {
    const double later = std::nextafter(next, 1.0), last = std::nextafter(later, 1.0);
    advance(one, next);
    advance(one, later);
    push(one, 0.001 * (1 + next));  // begins anew
    advance(one, last);
    EXPECT_EQ(one.time(), last);
    const std::vector<double> state = one.state();
    ASSERT_TRUE(std::all_of(state.begin(), state.end(), [](double x) { return std::isfinite(x); })) << next;
  }
}

// after an initialisation that failed, and after a motion
TEST_P(PlantOf, BeginsAgain) {
  Plant one, fresh;
  prepare(one);
  push_absurdly(one);
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_SOLVER);
  EXPECT_FALSE(tendonfmu_plant_is_initialised(one));
  push(one, 0.0);
  initialise(one);
  start(fresh);
  EXPECT_TRUE(same(one, fresh));
  push(one, 0.4);
  advance(one, 0.1);
  ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
  EXPECT_FALSE(tendonfmu_plant_is_initialised(one));
  EXPECT_EQ(one.time(), 0.0);
  initialise(one);
  for (const Plant* each : {&one, &fresh}) {
    advance(*each, 0.05);
  }
  EXPECT_TRUE(same(one, fresh));
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
  set(one, [](auto* settings) { settings->sensors = 0; });
  initialise(one);
  EXPECT_EQ(tendonfmu_plant_advance(one, 4500.0), TENDONFMU_PLANT_OK) << one.error();
  tendonfmu_plant_statistics work;
  ASSERT_EQ(tendonfmu_plant_get_statistics(one, &work), TENDONFMU_PLANT_OK);
  EXPECT_GT(work.steps, 200000u);
}

// --- refusals -------------------------------------------------------------------------------------------------------

TEST(Plant, RefusesWhatIsNoTimeNoInputAndNoState) {
  Plant one;
  EXPECT_EQ(tendonfmu_plant_advance(one, 0.1), TENDONFMU_PLANT_WRONG_ORDER);
  initialise(one);
  const Bytes before = one.saved();
  const std::vector<double> state = one.state();
  std::vector<double> derivative(state.size());
  for (const double bad : {nan, inf, -inf, 1e9}) {
    EXPECT_EQ(tendonfmu_plant_advance(one, bad), TENDONFMU_PLANT_BAD_ARGUMENT) << bad;
    std::vector<double> command(one.tendons(), 0.0);
    command.back() = bad;
    tendonfmu_plant_inputs inputs[3] = {};
    inputs[0].tendon_position_command = command.data();
    inputs[1].pretension = bad;
    inputs[2].push_force[1] = bad;
    for (const auto& each : inputs) {
      EXPECT_EQ(tendonfmu_plant_set_inputs(one, &each), TENDONFMU_PLANT_BAD_ARGUMENT) << bad;
    }
    for (std::size_t k = 0; k < state.size() && !std::isfinite(bad); k += 5) {
      std::vector<double> wrong = state;
      wrong[k] = bad;
      EXPECT_EQ(tendonfmu_plant_derivative(one, 0.0, wrong.data(), derivative.data()), TENDONFMU_PLANT_BAD_ARGUMENT);
    }
  }
  EXPECT_EQ(tendonfmu_plant_derivative(one, nan, state.data(), derivative.data()), TENDONFMU_PLANT_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_plant_derivative(one, 0.0, state.data(), derivative.data()), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_advance(one, -1e-9), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_plant_advance(one, -0.0), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.saved(), before);
}

TEST(Plant, SettingsAreSetBeforeTheInitialisationOnly) {
  Plant one;
  const tendonfmu_plant_settings good = one.settings();
  std::vector<tendonfmu_plant_settings> bad;
  const auto refuse = [&](auto tendonfmu_plant_settings::*member, auto... values) {
    for (const auto value : {values...}) {
      bad.push_back(good);
      bad.back().*member = value;
    }
  };
  refuse(&tendonfmu_plant_settings::relative_tolerance, 1e-11, nan, 0.1);
  refuse(&tendonfmu_plant_settings::push_link, 0, 4, std::numeric_limits<int>::min());
  bad.resize(bad.size() + 2, good);
  bad[bad.size() - 2].push_point[0] = nan;
  bad[bad.size() - 1].push_point[2] = 11.0;
  for (const auto& each : bad) {
    EXPECT_EQ(tendonfmu_plant_set_settings(one, &each), TENDONFMU_PLANT_BAD_ARGUMENT) << &each - bad.data();
    EXPECT_EQ(one.settings().push_link, good.push_link);
    EXPECT_EQ(one.settings().relative_tolerance, good.relative_tolerance);
  }
  EXPECT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_OK);
  Signals signals(one);
  EXPECT_EQ(tendonfmu_plant_get_signals(one, &signals.view), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(one.error(), "expected after the initialisation only");
  Bytes bytes(tendonfmu_plant_state_size(one));
  EXPECT_EQ(tendonfmu_plant_save_state(one, bytes.data(), bytes.size()), TENDONFMU_PLANT_WRONG_ORDER);
  initialise(one);
  EXPECT_EQ(tendonfmu_plant_save_state(one, bytes.data(), bytes.size() - 1), TENDONFMU_PLANT_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(tendonfmu_plant_set_settings(one, &good), TENDONFMU_PLANT_OK);
}

/* Every call, with NULL for the plant or for what it reads and writes. */
std::vector<tendonfmu_plant_status> calls_without(tendonfmu_plant* plant, bool arguments) {
  static double number = 0.0;
  static tendonfmu_plant_settings settings = {};
  static tendonfmu_plant_signals signals = {};
  static tendonfmu_plant_statistics work = {};
  static const tendonfmu_plant_inputs inputs = {};
  double* x = arguments ? &number : nullptr;
  const std::size_t size = tendonfmu_plant_state_size(plant);
  return {tendonfmu_plant_get_settings(plant, arguments ? &settings : nullptr),
          tendonfmu_plant_set_settings(plant, arguments ? &settings : nullptr),
          tendonfmu_plant_set_inputs(plant, arguments ? &inputs : nullptr),
          tendonfmu_plant_hold_command(plant, x),
          tendonfmu_plant_get_signals(plant, arguments ? &signals : nullptr),
          tendonfmu_plant_run(plant, 1, &number, arguments ? &signals : nullptr, nullptr),
          tendonfmu_plant_run(plant, 1, x, &signals, nullptr),
          tendonfmu_plant_save_state(plant, x, size),
          tendonfmu_plant_restore_state(plant, x, size),
          tendonfmu_plant_get_statistics(plant, arguments ? &work : nullptr),
          tendonfmu_plant_derivative(plant, 0.0, x, &number),
          tendonfmu_plant_derivative(plant, 0.0, &number, x),
          tendonfmu_plant_get_continuous_state(plant, x)};
}

TEST(PlantCalls, TakeNoPlantAndNoArguments) {
  tendonfmu_plant_destroy(nullptr);
  EXPECT_EQ(tendonfmu_plant_joint_count(nullptr) + tendonfmu_plant_tendon_count(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_order(nullptr) + tendonfmu_plant_state_size(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_get_time(nullptr), 0.0);
  EXPECT_EQ(tendonfmu_plant_is_initialised(nullptr), 0);
  EXPECT_STREQ(tendonfmu_plant_last_error(nullptr), "");
  EXPECT_EQ(tendonfmu_plant_initialise(nullptr), TENDONFMU_PLANT_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_plant_advance(nullptr, 0.0), TENDONFMU_PLANT_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_plant_reset(nullptr), TENDONFMU_PLANT_BAD_ARGUMENT);
  Plant fresh(test_plant::plain(1, 2)), running(test_plant::plain(1, 2));
  initialise(running);
  for (const auto& answers :
       {calls_without(nullptr, true), calls_without(fresh, false), calls_without(running, false)}) {
    for (const tendonfmu_plant_status& answer : answers) {
      EXPECT_EQ(answer, TENDONFMU_PLANT_BAD_ARGUMENT) << &answer - answers.data();
    }
  }
  EXPECT_NE(running.error().find("expected a pointer, not NULL"), std::string::npos);
  // signals that nobody wants
  const tendonfmu_plant_signals none = {};
  const double time[] = {0.01, 0.02};
  EXPECT_EQ(tendonfmu_plant_run(running, 2, time, &none, nullptr), TENDONFMU_PLANT_OK);
  EXPECT_EQ(running.time(), 0.02);
}

TEST(PlantCalls, CreateSaysWhyInTheRoomThereIs) {
  char message[20] = "unchanged";
  EXPECT_EQ(tendonfmu_plant_create(nullptr, 0, message, sizeof message), nullptr);
  EXPECT_EQ(std::string(message), "rig: expected a tex");
  EXPECT_EQ(tendonfmu_plant_create("{}", 2, message, 0), nullptr);
  EXPECT_EQ(tendonfmu_plant_create("{}", 2, nullptr, 0), nullptr);
  EXPECT_EQ(tendonfmu_plant_create("{}", 2, nullptr, 100), nullptr);
  char one[1] = {'x'};
  EXPECT_EQ(tendonfmu_plant_create("{}", 2, one, 1), nullptr);
  EXPECT_EQ(one[0], '\0');
}

// All fixed arrays full, with every kind of effect: for the address sanitizer.
TEST(PlantCalls, TakeTheLargestFinger) {
  Plant one(test_plant::largest());
  EXPECT_EQ(tendonfmu_plant_order(one), 2u * 16 + 2u * 64 + 64u * 32 + 32 + 5);
  for (const double tolerance : {1e-6, 1e-4}) {
    ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
    set(one, [&](auto* settings) {
      settings->relative_tolerance = tolerance;
      settings->push_link = 16;
    });
    // what matters is that nothing is written beside its place: this many links need not come to rest
    const tendonfmu_plant_status started = tendonfmu_plant_initialise(one);
    ASSERT_TRUE(started == TENDONFMU_PLANT_OK || started == TENDONFMU_PLANT_SOLVER);
    if (started != TENDONFMU_PLANT_OK) {
      continue;
    }
    EXPECT_EQ(tendonfmu_plant_advance(one, 0.002), TENDONFMU_PLANT_OK) << one.error();
    Signals signals(one);
    EXPECT_EQ(tendonfmu_plant_get_signals(one, &signals.view), TENDONFMU_PLANT_OK);
    EXPECT_EQ(one.restore(one.saved()), TENDONFMU_PLANT_OK);
  }
  std::vector<double> state = one.state(), derivative(state.size());
  EXPECT_EQ(tendonfmu_plant_derivative(one, 0.0, state.data(), derivative.data()), TENDONFMU_PLANT_OK);
}

}  // namespace
