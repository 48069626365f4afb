// The flat block of numbers: bytes and their hash, round trip, damage, paths and ranges of the numbers.
#include "model_inside.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <string>

namespace {

// --- bytes ----------------------------------------------------------------------------------------------------------

TEST(Bytes, AreLittleEndian) {
  unsigned char block[8];
  store_u32(block, 0x01020304u);
  EXPECT_EQ(std::vector<unsigned char>(block, block + 4), (std::vector<unsigned char>{4, 3, 2, 1}));
  store_u64(block, 0x0102030405060708u);
  EXPECT_EQ(std::vector<unsigned char>(block, block + 8), (std::vector<unsigned char>{8, 7, 6, 5, 4, 3, 2, 1}));
  store_f64(block, 1.0);
  EXPECT_EQ(std::vector<unsigned char>(block, block + 8), (std::vector<unsigned char>{0, 0, 0, 0, 0, 0, 0xf0, 0x3f}));
}

TEST(Bytes, RoundTripAtAnyAlignment) {
  const double numbers[] = {0.0, -0.0, 1.0 / 3.0, -1e300, std::numeric_limits<double>::denorm_min(), HUGE_VAL};
  unsigned char block[8 * 6 + 8];
  for (std::size_t shift = 0; shift < 8; ++shift) {
    double back[6];
    store_doubles(block + shift, numbers, 6);
    load_doubles(back, block + shift, 6);
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_EQ(back[i], numbers[i]);
      EXPECT_EQ(std::signbit(back[i]), std::signbit(numbers[i]));
      EXPECT_EQ(load_f64(block + shift + 8 * i), numbers[i]);
    }
    store_u64(block + shift, 0xfedcba9876543210u);
    EXPECT_EQ(load_u64(block + shift), 0xfedcba9876543210u);
    EXPECT_EQ(load_u32(block + shift), 0x76543210u);
  }
}

// Images and states carry this hash, so a new version of the library must still give it.
TEST(Hash, IsTheSameOnEveryMachine) {
  EXPECT_EQ(hash_bytes("", 0, 0), 0xfdbdf6ac4fc52e7fu);
  EXPECT_EQ(hash_bytes("TendonFMU", 9, 0), 0xda330810bda4f642u);
}

TEST(Hash, SeesEverySingleBitAndEveryLength) {
  std::vector<unsigned char> block(77);
  for (std::size_t i = 0; i < block.size(); ++i) {
    block[i] = static_cast<unsigned char>(37 * i);
  }
  std::set<std::uint64_t> seen = {hash_bytes(block.data(), block.size(), 0)};
  for (std::size_t bit = 0; bit < 8 * block.size(); ++bit) {
    block[bit / 8] = static_cast<unsigned char>(block[bit / 8] ^ (1u << (bit % 8)));
    seen.insert(hash_bytes(block.data(), block.size(), 0));
    block[bit / 8] = static_cast<unsigned char>(block[bit / 8] ^ (1u << (bit % 8)));
  }
  for (std::size_t size = 0; size < block.size(); ++size) {
    seen.insert(hash_bytes(block.data(), size, 0));
  }
  EXPECT_EQ(seen.size(), 1 + 8 * block.size() + block.size());
}

// --- images ---------------------------------------------------------------------------------------------------------

bool is_refused(const std::vector<unsigned char>& image, std::string* reason = nullptr) {
  char message[400] = "";
  const bool refused = tendonfmu_check_image(image.data(), image.size(), message, sizeof message) != TENDONFMU_OK;
  EXPECT_EQ(refused, std::strlen(message) > 0);
  EXPECT_EQ(refused, tendonfmu_memory_size(image.data(), image.size()) == 0);
  if (reason) {
    *reason = message;
  }
  return refused;
}

TEST(ModelImage, WrittenAgainIsTheSameBytes) {
  const std::vector<unsigned char> image = test_finger::image();
  const Model model(image);
  ASSERT_TRUE(model.accepted) << model.message;
  EXPECT_EQ(model.written(), image);
}

TEST(DamagedImage, EveryFlippedBitIsRefusedOrMeansTheSame) {
  const std::vector<unsigned char> image = test_finger::image();
  const Model original(image);
  for (std::size_t bit = 0; bit < 8 * image.size(); ++bit) {
    std::vector<unsigned char> damaged = image;
    damaged[bit / 8] = static_cast<unsigned char>(damaged[bit / 8] ^ (1u << (bit % 8)));
    if (!is_refused(damaged)) {
      const Model model(damaged);
      ASSERT_TRUE(model.accepted);
      EXPECT_EQ(model.written(), image) << "bit " << bit;
    }
  }
}

TEST(DamagedImage, SaysWhatIsWrong) {
  const std::vector<unsigned char> image = test_finger::image();
  const auto reason_with = [&](std::size_t offset, std::uint32_t value) {
    std::vector<unsigned char> damaged = image;
    store_u32(damaged.data() + offset, value);
    seal(damaged);
    std::string reason;
    EXPECT_TRUE(is_refused(damaged, &reason)) << offset;
    return reason;
  };
  EXPECT_NE(reason_with(0, 0).find("not a model image"), std::string::npos);
  EXPECT_NE(reason_with(8, 2).find("version 2, expected 1"), std::string::npos);
  EXPECT_NE(reason_with(16, 64).find("cut off"), std::string::npos);
  EXPECT_NE(reason_with(32, 0).find("joints 0, expected 1 to 16"), std::string::npos);
  EXPECT_NE(reason_with(32, 17).find("joints 17, expected 1 to 16"), std::string::npos);
  EXPECT_NE(reason_with(36, 65).find("tendons 65, expected 1 to 64"), std::string::npos);
  EXPECT_NE(reason_with(40, MODEL_OPTION_BITS + 1u).find("option bits 1024"), std::string::npos);
  EXPECT_NE(reason_with(44, 0xffffffffu).find("do not add up"), std::string::npos);
  EXPECT_NE(reason_with(48, 1025).find("extensions 1025, expected at most 1024"), std::string::npos);
  EXPECT_NE(reason_with(52, 0xffffffffu).find("do not add up"), std::string::npos);
  EXPECT_NE(reason_with(56, 0xffu).find("shape: joints"), std::string::npos);
  const Model model(image);
  EXPECT_NE(reason_with(56 + 4 * model.shape.word_count, 999).find("effect number 999"), std::string::npos);
  EXPECT_NE(reason_with(60 + 4 * model.shape.word_count, 3).find("joint of an extension 3"), std::string::npos);
}

TEST(DamagedImage, NullIsAnArgumentError) {
  const std::vector<unsigned char> image = test_finger::image();
  EXPECT_EQ(tendonfmu_check_image(nullptr, 100, nullptr, 0), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_check_image(image.data(), image.size(), nullptr, 10), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_check_image(image.data(), image.size(), nullptr, 0), TENDONFMU_OK);
  EXPECT_EQ(tendonfmu_memory_size(nullptr, 100), 0u);
  EXPECT_EQ(tendonfmu_create(nullptr, 0, nullptr, 0), nullptr);
}

TEST(ImageGuid, IsOfTheContentAndTheSalt) {
  std::vector<unsigned char> image = test_finger::image();
  char a[39], b[39], c[39], d[39];
  ASSERT_EQ(tendonfmu_image_guid(image.data(), image.size(), 1, a), TENDONFMU_OK);
  ASSERT_EQ(tendonfmu_image_guid(image.data(), image.size(), 1, b), TENDONFMU_OK);
  ASSERT_EQ(tendonfmu_image_guid(image.data(), image.size(), 2, c), TENDONFMU_OK);
  image.back() ^= 1;
  ASSERT_EQ(tendonfmu_image_guid(image.data(), image.size(), 1, d), TENDONFMU_OK);
  EXPECT_STREQ(a, b);
  EXPECT_STRNE(a, c);
  EXPECT_STRNE(a, d);
  EXPECT_EQ(std::strlen(a), 38u);
  EXPECT_EQ(tendonfmu_image_guid(nullptr, 0, 1, a), TENDONFMU_BAD_ARGUMENT);
}

// --- parameters -----------------------------------------------------------------------------------------------------

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

}  // namespace
