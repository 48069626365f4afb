// The flat block of numbers: round trip, damage, counts.
#include "model_inside.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <string>

namespace {

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

TEST(ModelImage, ItemsFollowEachOtherWithoutGaps) {
  const Model model(test_finger::image());
  std::uint32_t next = 0;
  for (const model_item& item : model.items()) {
    EXPECT_EQ(item.first, next);
    EXPECT_GT(item.count, 0u);
    next += item.count;
  }
  EXPECT_EQ(next, model.shape.parameter_count);
}

TEST(ModelImage, VisitEndsWhereTheVisitorSaysSo) {
  const Model model(test_finger::image());
  int visits = 0;
  const int result = model_visit(
      &model.shape, [](void* count, const model_item*) { return ++*static_cast<int*>(count) == 3 ? 42 : 0; }, &visits);
  EXPECT_EQ(result, 42);
  EXPECT_EQ(visits, 3);
}

TEST(ModelImage, IsReadAtAnyAlignment) {
  const std::vector<unsigned char> image = test_finger::image();
  for (std::size_t shift = 1; shift < 8; ++shift) {
    std::vector<unsigned char> moved(image.size() + shift);
    std::memcpy(moved.data() + shift, image.data(), image.size());
    tendonfmu_finger* finger = tendonfmu_create(moved.data() + shift, image.size(), nullptr, 0);
    ASSERT_NE(finger, nullptr);
    EXPECT_EQ(tendonfmu_joint_count(finger), 2u);
    tendonfmu_destroy(finger);
  }
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

// A wrong number under a right checksum, as of a faulty writer: refused, or a finger within its ranges.
TEST(DamagedImage, ResealedIsRefusedOrASoundFinger) {
  const std::vector<unsigned char> image = test_finger::image();
  std::mt19937_64 random(3);
  int accepted = 0, refused = 0;
  const auto attempt = [&](std::size_t byte, unsigned char value) {
    std::vector<unsigned char> damaged = image;
    damaged[byte] = value;
    seal(damaged);
    char message[400] = "";
    tendonfmu_finger* finger = tendonfmu_create(damaged.data(), damaged.size(), message, sizeof message);
    finger ? ++accepted : ++refused;
    EXPECT_EQ(finger == nullptr, std::strlen(message) > 0);
    for (std::size_t i = 0; i < tendonfmu_parameter_count(finger); ++i) {
      tendonfmu_parameter_info info;
      double value_now = 0.0;
      ASSERT_EQ(tendonfmu_get_parameter_info(finger, i, &info), TENDONFMU_OK);
      ASSERT_EQ(tendonfmu_get_parameters(finger, 1, &i, &value_now), TENDONFMU_OK);
      EXPECT_GE(value_now, info.minimum);
      EXPECT_LE(value_now, info.maximum);
    }
    tendonfmu_destroy(finger);
  };
  for (std::size_t byte = 32; byte < image.size(); ++byte) {
    for (const int value : {0, 1, 2, 3, 4, 127, 128, 255}) {
      attempt(byte, static_cast<unsigned char>(value));
    }
  }
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 100);
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
  EXPECT_NE(reason_with(40, MODEL_OPTION_BITS + 1u).find("option bits 33554432"), std::string::npos);
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

}  // namespace
