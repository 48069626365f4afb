// Paths, units, ranges and relations of the parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "model_inside.h"

namespace {

const Model& model() {
  static const Model m(test_finger::image());
  return m;
}

std::string path_of(std::uint32_t index) {
  char path[PARAMETER_PATH_BYTES];
  const model_item item = parameter_item(&model().shape, index);
  parameter_path(&item, index, path);
  return path;
}

double value_at(const std::string& path) {
  const std::uint32_t index = parameter_find(&model().shape, path.c_str());
  return index < model().shape.parameter_count ? model().values[index] : NAN;
}

TEST(ParameterPaths, OfThingsThatAreNotThereAreNotFound) {
  for (const char* path : {"", "joints[2].cover.stiffness", "joints[0].friction.static", "tendons[1].edge_friction[1]",
                           "tendons[1].edge_friction[2].laws[4].static", "joints[2].friction.static", "bias.noise_time",
                           "tendons[4].stiffness", "velocity_threshold", "joints[1].friction.static "}) {
    EXPECT_EQ(parameter_find(&model().shape, path), model().shape.parameter_count) << path;
  }
}

TEST(ParameterPaths, OfTheLargestFingerFitTheirRoom) {
  model_item item{};
  item.kind = ITEM_EDGE_FRICTION;
  item.law = LAW_ASYMMETRIC;
  item.has_angles = 1;
  item.tendon = MODEL_MAX_TENDONS - 1;
  item.joint = MODEL_MAX_JOINTS - 1;
  item.point = MODEL_MAX_POINTS - 1;
  char path[PARAMETER_PATH_BYTES];
  parameter_path(&item, 6, path);
  EXPECT_STREQ(path, "tendons[64].edge_friction[16].laws[256].negative.stribeck_velocity");
}

TEST(ParameterRanges, HoldEveryValueAndRefuseWhatIsNotFinite) {
  for (std::uint32_t i = 0; i < model().shape.parameter_count; ++i) {
    const model_item item = parameter_item(&model().shape, i);
    char text[300] = "";
    const message_line line = {text, sizeof text};
    EXPECT_EQ(parameter_check_value(&item, i, model().values[i], line), 0) << text;
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), HUGE_VAL, -HUGE_VAL}) {
      EXPECT_EQ(parameter_check_value(&item, i, bad, line), -1) << path_of(i);
      EXPECT_EQ(std::string(text).find(path_of(i) + " = "), 0u) << text;
    }
  }
}

TEST(ParameterRanges, AreOfTheUnitOfTheirQuantity) {
  const auto unit = [](const char* path) {
    const std::uint32_t index = parameter_find(&model().shape, path);
    const model_item item = parameter_item(&model().shape, index);
    return std::string(parameter_range_of(&item, index).unit);
  };
  EXPECT_EQ(unit("joints[1].cover.stiffness"), "N.m/rad");
  EXPECT_EQ(unit("joints[1].friction.static"), "N.m");
  EXPECT_EQ(unit("joints[1].friction.viscous"), "N.m.s/rad");
  EXPECT_EQ(unit("joints[1].load_friction.coulomb"), "m");
  EXPECT_EQ(unit("joints[1].load_friction.viscous"), "m.s/rad");
  EXPECT_EQ(unit("tendons[1].pulley_friction[1].static"), "1");
  EXPECT_EQ(unit("tendons[1].pulley_friction[1].viscous"), "s/m");
  EXPECT_EQ(unit("tendons[1].edge_friction[2].laws[1].stribeck_velocity"), "m/s");
  EXPECT_EQ(unit("joints[1].friction.stribeck_velocity"), "rad/s");
  EXPECT_EQ(unit("extensions[1].stiffness"), "N.m/rad3");
}

TEST(ParameterRanges, StructureIsFixedAndTheRestTunable) {
  for (std::uint32_t i = 0; i < model().shape.parameter_count; ++i) {
    const model_item item = parameter_item(&model().shape, i);
    const std::string path = path_of(i);
    const bool fixed = path.find("moment_arms") != std::string::npos || path.find("angles[") != std::string::npos ||
                       (path.find("tendons") == 0 && path.find("].stiffness") != std::string::npos);
    EXPECT_EQ(parameter_range_of(&item, i).tunable, fixed ? 0 : 1) << path;
  }
}

TEST(ParameterRelations, StaticMustNotBeBelowCoulomb) {
  std::vector<double> values = model().values;
  values[parameter_find(&model().shape, "tendons[1].edge_friction[2].laws[3].static")] = 0.01;
  char text[300];
  EXPECT_EQ(parameter_check_relations(&model().shape, values.data(), {text, sizeof text}), -1);
  EXPECT_STREQ(text, "tendons[1].edge_friction[2].laws[3].static = 0.01: expected at least coulomb = 0.03");
}

TEST(ParameterRelations, AnglesMustIncreaseStrictly) {
  std::vector<double> values = model().values;
  values[parameter_find(&model().shape, "tendons[1].edge_friction[2].angles[3]")] = 0.1;
  char text[300];
  EXPECT_EQ(parameter_check_relations(&model().shape, values.data(), {text, sizeof text}), -1);
  EXPECT_STREQ(text, "tendons[1].edge_friction[2].angles[3] = 0.1: expected above the angle before it, 0.1 rad");
}

TEST(ParameterRelations, MomentArmsMustFixTheJointAngles) {
  std::vector<double> values = model().values;
  for (const char* path : {"tendons[1].moment_arms[2]", "tendons[2].moment_arms[2]", "tendons[3].moment_arms[2]"}) {
    values[parameter_find(&model().shape, path)] = 0.0;
  }
  char text[300];
  EXPECT_EQ(parameter_check_routing(&model().shape, values.data(), {text, sizeof text}), -1);
  EXPECT_NE(std::string(text).find("full column rank"), std::string::npos) << text;
  EXPECT_EQ(parameter_check_routing(&model().shape, model().values.data(), {text, sizeof text}), 0);
}

}  // namespace
