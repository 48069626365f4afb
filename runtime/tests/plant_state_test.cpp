// Saved states of the simulated finger: whatever numbers stand in them, and what a restored finger does.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test_plant.h"

namespace {

using test_plant::Bytes;
using test_plant::Plant;
using test_plant::same;
using test_plant::Signals;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr std::size_t header_bytes = 40, digest_at = 32;  // of a state of the plant; numbers follow

std::size_t number_count(const Bytes& state) {
  return (state.size() - header_bytes) / sizeof(double);
}

/* The state with another number, and the digest that belongs to it. */
Bytes with_number(Bytes state, std::size_t index, double value) {
  std::memcpy(&state[header_bytes + index * sizeof value], &value, sizeof value);
  std::uint64_t digest = 0xcbf29ce484222325;
  for (std::size_t k = 0; k < number_count(state); ++k) {
    std::uint64_t bits;
    std::memcpy(&bits, &state[header_bytes + k * sizeof bits], sizeof bits);
    digest = (digest ^ bits) * 0x100000001b3;
    digest ^= digest >> 29;
  }
  std::memcpy(&state[digest_at], &digest, sizeof digest);
  return state;
}

/* The small rig with a delay and a play. */
const test_plant::Json rig =
    test_plant::changed({{"/sensors/tendon_position/delay", 0.0035}, {"/sensors/tendon_position/backlash", 1e-4}});

void start(Plant& plant, int integrator, int sensors) {
  tendonfmu_plant_settings settings = plant.settings();
  settings.integrator = integrator;
  settings.sensors = sensors;
  ASSERT_EQ(tendonfmu_plant_set_settings(plant, &settings), TENDONFMU_PLANT_OK);
  ASSERT_EQ(tendonfmu_plant_initialise(plant), TENDONFMU_PLANT_OK) << plant.error();
}

/* Integrator, and whether there are sensors. */
struct PlantStateOf : testing::TestWithParam<std::pair<int, int>> {};
INSTANTIATE_TEST_SUITE_P(Integrators, PlantStateOf,
                         testing::Values(std::pair(1, 0), std::pair(1, 1), std::pair(2, 0), std::pair(2, 1)));

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
TEST_P(PlantStateOf, WhateverNumbersStandInIt) {
  Plant one(rig), unspoiled(rig);
  start(one, GetParam().first, GetParam().second);
  start(unspoiled, GetParam().first, GetParam().second);
  ASSERT_EQ(tendonfmu_plant_advance(one, 0.02), TENDONFMU_PLANT_OK);
  const Bytes good = one.saved();
  ASSERT_EQ(with_number(good, 0, 0.02), good);
  std::size_t taken = 0, refused = 0;
  for (std::size_t index = 0; index < number_count(good); ++index) {
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
  EXPECT_GT(taken, number_count(good));
  EXPECT_GT(refused, 3 * number_count(good));
  // and none of it left a trace
  for (Plant* each : {&one, &unspoiled}) {
    ASSERT_EQ(each->restore(good), TENDONFMU_PLANT_OK);
    ASSERT_EQ(tendonfmu_plant_advance(*each, 0.05), TENDONFMU_PLANT_OK);
  }
  EXPECT_TRUE(same(one, unspoiled));
}

TEST(PlantState, WithFixedStepsItGoesOnToTheBit) {
  for (const int sensors : {0, 1}) {
    Plant straight(rig), restored(rig);
    start(straight, TENDONFMU_PLANT_FIXED_STEP, sensors);
    start(restored, TENDONFMU_PLANT_FIXED_STEP, sensors);
    for (int k = 1; k <= 400; ++k) {
      ASSERT_EQ(tendonfmu_plant_advance(straight, 0.001 * k), TENDONFMU_PLANT_OK);
      if (k % 37 == 0) {
        ASSERT_EQ(restored.restore(straight.saved()), TENDONFMU_PLANT_OK);
      } else {
        ASSERT_EQ(tendonfmu_plant_advance(restored, 0.001 * k), TENDONFMU_PLANT_OK);
      }
      ASSERT_TRUE(same(straight, restored)) << k;
      ASSERT_EQ(straight.saved(), restored.saved()) << k;
    }
  }
}

}  // namespace
