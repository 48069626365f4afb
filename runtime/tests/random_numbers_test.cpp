// The sensors' noise: Philox against the vectors its authors published, and the moments of what is made of it.
#include "random_numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace {

using namespace tendonfmu::plant;

struct Known {
  std::uint32_t counter[4], key[2], answer[4];
};

// Random123 1.09, examples/kat_vectors: philox4x32 10
TEST(Philox, GivesThePublishedAnswers) {
  const Known all[] = {
      {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
      {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
       {0xffffffff, 0xffffffff},
       {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
      {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
       {0xa4093822, 0x299f31d0},
       {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
  };
  for (const Known& one : all) {
    std::uint32_t counter[4];
    std::copy(one.counter, one.counter + 4, counter);
    philox(counter, one.key);
    EXPECT_TRUE(std::equal(counter, counter + 4, one.answer)) << std::hex << counter[0];
  }
}

TEST(NormalNumber, HasTheMomentsOfTheNormalDistribution) {
  const std::size_t count = 400000;
  double sum[5] = {};
  std::size_t beyond_two = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = normal_number(11, 3, k);
    ASSERT_TRUE(std::isfinite(x));
    beyond_two += std::fabs(x) > 2.0;
    double power = 1.0;
    for (double& each : sum) {
      each += power;
      power *= x;
    }
  }
  const double n = static_cast<double>(count), one_sigma = 1.0 / std::sqrt(n);
  EXPECT_NEAR(sum[1] / n, 0.0, 4 * one_sigma);
  EXPECT_NEAR(sum[2] / n, 1.0, 4 * std::sqrt(2.0) * one_sigma);
  EXPECT_NEAR(sum[3] / n, 0.0, 4 * std::sqrt(15.0) * one_sigma);
  EXPECT_NEAR(sum[4] / n, 3.0, 4 * std::sqrt(96.0) * one_sigma);
  EXPECT_NEAR(static_cast<double>(beyond_two) / n, 0.0455003, 4 * std::sqrt(0.0455 * 0.9545) * one_sigma);
}

TEST(NormalNumber, DiffersInSeedChannelAndSample) {
  const double x = normal_number(1, 2, 3);
  EXPECT_EQ(normal_number(1, 2, 3), x);
  for (const double other : {normal_number(2, 2, 3), normal_number(1, 3, 3), normal_number(1, 2, 4),
                             normal_number(1 + (1ULL << 32), 2, 3), normal_number(1, 2, 3 + (1ULL << 32))}) {
    EXPECT_NE(other, x);
  }
}

}  // namespace
