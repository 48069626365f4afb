// tendonfmu_plant.h with NULL pointers, and at the ends of what it takes: no exception leaves it.
#include <gtest/gtest.h>

#include "test_plant.h"

namespace {

using test_plant::Json;
using test_plant::Plant;
using test_plant::Signals;

TEST(PlantCalls, TakeNoPlant) {
  double number = 0.0;
  tendonfmu_plant_settings settings = {};
  tendonfmu_plant_inputs inputs = {};
  tendonfmu_plant_signals signals = {};
  tendonfmu_plant_statistics work = {};
  std::size_t done = 7;
  tendonfmu_plant_destroy(nullptr);
  EXPECT_EQ(tendonfmu_plant_joint_count(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_tendon_count(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_order(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_state_size(nullptr), 0u);
  EXPECT_EQ(tendonfmu_plant_get_time(nullptr), 0.0);
  EXPECT_EQ(tendonfmu_plant_is_initialised(nullptr), 0);
  EXPECT_STREQ(tendonfmu_plant_last_error(nullptr), "");
  const tendonfmu_plant_status all[] = {
      tendonfmu_plant_get_settings(nullptr, &settings),
      tendonfmu_plant_set_settings(nullptr, &settings),
      tendonfmu_plant_set_inputs(nullptr, &inputs),
      tendonfmu_plant_initialise(nullptr),
      tendonfmu_plant_hold_command(nullptr, &number),
      tendonfmu_plant_advance(nullptr, 0.0),
      tendonfmu_plant_get_signals(nullptr, &signals),
      tendonfmu_plant_run(nullptr, 1, &number, &signals, &done),
      tendonfmu_plant_save_state(nullptr, &number, 8),
      tendonfmu_plant_restore_state(nullptr, &number, 8),
      tendonfmu_plant_reset(nullptr),
      tendonfmu_plant_get_statistics(nullptr, &work),
      tendonfmu_plant_derivative(nullptr, 0.0, &number, &number, nullptr),
      tendonfmu_plant_get_continuous_state(nullptr, &number),
  };
  for (const tendonfmu_plant_status each : all) {
    EXPECT_EQ(each, TENDONFMU_PLANT_BAD_ARGUMENT);
  }
  EXPECT_EQ(done, 0u);
}

TEST(PlantCalls, TakeNoArguments) {
  for (const bool initialised : {false, true}) {
    Plant one(test_plant::plain(1, 2));
    if (initialised) {
      ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
    }
    double number = 0.0;
    tendonfmu_plant_signals signals = {};
    const tendonfmu_plant_status all[] = {
        tendonfmu_plant_get_settings(one, nullptr),
        tendonfmu_plant_set_settings(one, nullptr),
        tendonfmu_plant_set_inputs(one, nullptr),
        tendonfmu_plant_hold_command(one, nullptr),
        tendonfmu_plant_get_signals(one, nullptr),
        tendonfmu_plant_run(one, 1, nullptr, &signals, nullptr),
        tendonfmu_plant_run(one, 1, &number, nullptr, nullptr),
        tendonfmu_plant_save_state(one, nullptr, tendonfmu_plant_state_size(one)),
        tendonfmu_plant_restore_state(one, nullptr, tendonfmu_plant_state_size(one)),
        tendonfmu_plant_get_statistics(one, nullptr),
        tendonfmu_plant_derivative(one, 0.0, nullptr, &number, nullptr),
        tendonfmu_plant_derivative(one, 0.0, &number, nullptr, nullptr),
        tendonfmu_plant_get_continuous_state(one, nullptr),
    };
    for (const tendonfmu_plant_status& each : all) {
      EXPECT_EQ(each, TENDONFMU_PLANT_BAD_ARGUMENT) << &each - all;
    }
    EXPECT_NE(one.error().find("expected a pointer, not NULL"), std::string::npos);
  }
}

TEST(PlantCalls, TakeSignalsThatNobodyWants) {
  Plant one(test_plant::plain(1, 2));
  ASSERT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  const tendonfmu_plant_signals none = {};
  EXPECT_EQ(tendonfmu_plant_get_signals(one, &none), TENDONFMU_PLANT_OK);
  const double time[] = {0.01, 0.02};
  EXPECT_EQ(tendonfmu_plant_run(one, 2, time, &none, nullptr), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.time(), 0.02);
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

TEST(PlantCalls, LastErrorIsThatOfTheLastFailure) {
  Plant one(test_plant::plain(1, 2));
  EXPECT_EQ(one.error(), "");
  EXPECT_EQ(tendonfmu_plant_advance(one, 0.0), TENDONFMU_PLANT_WRONG_ORDER);
  const std::string line = one.error();
  EXPECT_NE(line, "");
  EXPECT_EQ(tendonfmu_plant_initialise(one), TENDONFMU_PLANT_OK);
  EXPECT_EQ(one.error(), line);
}

// All fixed arrays full, with every kind of effect: for the address sanitizer.
TEST(PlantCalls, TakeTheLargestFinger) {
  Json rig = test_plant::plain(16, 64);
  const Json law = {{"static", 0.003}, {"coulomb", 0.002}, {"stribeck_velocity", 0.005}};
  const Json weak = {{"static", 1e-4}, {"coulomb", 1e-4}, {"stribeck_velocity", 0.1}};
  for (Json& tendon : rig["finger"]["tendons"]) {
    for (int j = 0; j < 16; ++j) {
      tendon["edge_friction"].push_back(law);
      if (j < 15) {
        tendon["pulley_friction"].push_back(law);
      }
    }
  }
  for (Json& joint : rig["finger"]["joints"]) {
    joint = {{"friction", weak}, {"load_friction", {{"static", 1e-6}, {"coulomb", 1e-6}, {"stribeck_velocity", 0.1}}}};
  }
  rig["physics"]["wrist"] = {
      {"amplitude", 0.1}, {"period", 5}, {"arms", std::vector<double>(64, 0.001)}, {"friction", law}};
  rig["physics"]["friction"] = {
      {"heat", {{"coefficient", 0.01}}},
      {"edges", {{{"tendon", 64}, {"joint", 16}, {"shape", "sine"}, {"rest", 0.5}, {"coefficient", 0.01}}}}};
  rig["physics"]["obstacle"] = {{"centre", {0.64, 0, 0}}, {"radius", 0.01}, {"stiffness", 100}};
  rig["physics"]["joint_coupling"] = std::vector<double>(15, 0.01);
  Plant one(rig);
  EXPECT_EQ(tendonfmu_plant_order(one), 2u * 16 + 2u * 64 + 64u * 32 + 32 + 5);
  for (const int integrator : {1, 2}) {
    ASSERT_EQ(tendonfmu_plant_reset(one), TENDONFMU_PLANT_OK);
    tendonfmu_plant_settings settings = one.settings();
    settings.integrator = integrator;
    settings.push_link = 16;
    ASSERT_EQ(tendonfmu_plant_set_settings(one, &settings), TENDONFMU_PLANT_OK);
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
  std::vector<double> state = one.state(), derivative(state.size()), jacobian(state.size() * state.size());
  EXPECT_EQ(tendonfmu_plant_derivative(one, 0.0, state.data(), derivative.data(), jacobian.data()), TENDONFMU_PLANT_OK);
}

}  // namespace
