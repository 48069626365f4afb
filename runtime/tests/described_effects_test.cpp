// Extensions in a description, and the sine and cosine that their torques use.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "described_finger.h"
#include "model_inside.h"
#include "sine_cosine.h"

namespace {

// --- sine and cosine -------------------------------------------------------------------------------------------------

TEST(SineCosine, WithinTwoUnitsInTheLastPlaceOfOne) {
  double worst = 0.0;
  for (int k = -400000; k <= 400000; ++k) {
    const double angle = k * 1.7e-5 + 1e-9 * (k % 7);
    const sine_cosine found = sine_cosine_of(angle);
    worst = std::fmax(worst, std::fabs(found.sine - std::sin(angle)));
    worst = std::fmax(worst, std::fabs(found.cosine - std::cos(angle)));
  }
  EXPECT_LT(worst, 2.3e-16);
  for (const double angle : {99999.9, -54321.123, 1e4 / 3.0}) {
    EXPECT_NEAR(sine_cosine_of(angle).sine, std::sin(angle), 2.3e-16);
    EXPECT_NEAR(sine_cosine_of(angle).cosine, std::cos(angle), 2.3e-16);
  }
}

TEST(SineCosine, AtTheAxesAndBeyond) {
  EXPECT_EQ(sine_cosine_of(0.0).sine, 0.0);
  EXPECT_EQ(sine_cosine_of(0.0).cosine, 1.0);
  EXPECT_EQ(sine_cosine_of(-0.7).sine, -sine_cosine_of(0.7).sine);
  EXPECT_EQ(sine_cosine_of(1e300).sine, sine_cosine_of(1e5).sine);
  EXPECT_EQ(sine_cosine_of(-1e300).cosine, sine_cosine_of(-1e5).cosine);
}

// --- in a description ------------------------------------------------------------------------------------------------

// All eighteen, as the rows of a model image: id, joint, tendon.
TEST(Described, EachEffectIsARowOfTheImage) {
  nlohmann::json finger = small_finger();
  finger["extensions"] = nlohmann::json::parse(R"([
    {"effect": "cover_hardening", "joint": 2, "stiffness": 0.3},
    {"effect": "gravity", "joint": 2, "cosine": 0.01},
    {"effect": "inertia", "joint": 1, "inertia": 1e-5},
    {"effect": "inertia_variation", "joint": 1, "cosine": 2e-5},
    {"effect": "joint_coupling", "joint": 1, "stiffness": 0.01},
    {"effect": "preload_friction", "tendon": 2, "coulomb": 0.1},
    {"effect": "preload_friction", "joint": 2, "tendon": 1, "coulomb": 0.1},
    {"effect": "load_friction", "joint": 2, "tendon": 1, "coulomb": 1e-4},
    {"effect": "force_gain", "tendon": 2, "correction": -0.1},
    {"effect": "force_offset", "tendon": 1, "correction": 0.2},
    {"effect": "moment_arm", "joint": 1, "tendon": 2, "correction": 1e-4},
    {"effect": "moment_arm_variation", "joint": 2, "tendon": 2, "slope": 1e-4},
    {"effect": "pulley_eccentricity", "joint": 2, "tendon": 1},
    {"effect": "presliding", "joint": 1, "displacement": 0.01},
    {"effect": "presliding", "joint": null, "tendon": 1, "displacement": 1e-4},
    {"effect": "presliding", "displacement": 0.02},
    {"effect": "friction_drift", "amplitude": 0.2, "time_constant": 60},
    {"effect": "friction_drift", "tendon": 2, "amplitude": 0.2, "time_constant": 60},
    {"effect": "friction_drift", "tendon": 2, "amplitude": 0.2, "time_constant": 60},
    {"effect": "tendon_nonlinearity", "tendon": 2, "hardening": 1e5},
    {"effect": "backlash", "tendon": 2, "width": 1e-4},
    {"effect": "backlash", "joint": 2, "width": 1e-3},
    {"effect": "stribeck", "tendon": 2, "amplitude": -0.5, "stribeck_velocity": 0.01},
    {"effect": "time_delay", "delay": -0.001}])");
  const Reading reading = read(finger);
  ASSERT_EQ(reading.message, "");
  const Model model(reading.image);
  ASSERT_TRUE(model.accepted) << model.message;
  const std::vector<std::array<std::uint32_t, 3>> expected = {
      {1, 2, 0},  {2, 2, 0},  {3, 1, 0},  {12, 1, 0}, {4, 1, 0},  {5, 0, 2},  {5, 2, 1},  {6, 2, 1},
      {7, 0, 2},  {8, 0, 1},  {9, 1, 2},  {10, 2, 2}, {11, 2, 1}, {20, 1, 0}, {20, 0, 1}, {20, 0, 0},
      {21, 0, 0}, {21, 0, 2}, {21, 0, 2}, {22, 0, 2}, {23, 0, 2}, {23, 2, 0}, {25, 0, 2}, {24, 0, 0}};
  ASSERT_EQ(model.shape.extension_count, expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const std::uint32_t* row = model.shape.extensions + k * MODEL_EXTENSION_WORDS;
    EXPECT_EQ((std::array<std::uint32_t, 3>{row[0], row[1], row[2]}), expected[k]) << "extension " << k + 1;
    EXPECT_EQ(row[3], 0u);
  }
  // what is left out
  const std::size_t last = model.values.size();
  const std::vector<double> numbers(model.values.end() - 35, model.values.end());
  EXPECT_EQ(numbers.front(), 0.3);
  EXPECT_EQ(numbers[1], 0.0);   // gravity's sine
  EXPECT_EQ(numbers[2], 0.01);  // its cosine
  EXPECT_EQ(numbers[7], 1.0);   // joint_coupling's reaction
  EXPECT_EQ(numbers[9], 1.0);   // preload_friction's beyond
  EXPECT_EQ(model.values[last - 1], -0.001);
}

TEST(Described, PreslidingEverywhereMultipliesThresholds) {
  for (const char* key : {"tendon", "joint"}) {
    nlohmann::json finger = small_finger();
    finger["extensions"] = nlohmann::json::parse(R"([{"effect": "presliding", "joint": 1, "displacement": 0.01}])");
    finger["velocity_threshold"][key] = 0;
    EXPECT_EQ(read(finger).message, "");
    finger["extensions"].push_back({{"effect", "presliding"}, {"displacement", 0.02}});
    const std::string unit = std::string(key) == "tendon" ? "m/s" : "rad/s";
    EXPECT_EQ(read(finger).message, std::string("velocity_threshold.") + key + " = 0: expected above 0 " + unit +
                                        ", since extensions[2], presliding without joint or tendon, multiplies it");
  }
}

TEST(Described, HasRoomForAThousandExtensions) {
  nlohmann::json finger = small_finger();
  const nlohmann::json one = finger["extensions"][0];
  finger["extensions"] = nlohmann::json::array();
  for (int k = 0; k < 1024; ++k) {
    finger["extensions"].push_back(one);
  }
  EXPECT_EQ(read(finger).message, "");
  finger["extensions"].push_back(one);
  EXPECT_EQ(read(finger).message, "extensions has 1025 elements: expected a list of at most 1024 extensions");
}

}  // namespace
