// Numbers as bytes: the same on every machine, at any alignment.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "core_inside.h"

namespace {

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

}  // namespace
