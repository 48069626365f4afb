// Lines of text without the heap.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

#include "comma_locales.h"
#include "core_inside.h"

namespace {

std::string number(double value) {
  char text[64];
  const message_line line = {text, sizeof text};
  message_write(line, "%g", value);
  return text;
}

TEST(Message, IsPutTogetherFromTextsAndNumbers) {
  char text[100] = "old";
  const message_line line = {text, sizeof text};
  EXPECT_EQ(message_write(line, "%s[%zu] = %g", "tendon_force", std::size_t{3}, -1.5), -1);
  EXPECT_EQ(message_add(line, ", row %zu", std::size_t{18446744073709551615u}), -1);
  EXPECT_STREQ(text, "tendon_force[3] = -1.5, row 18446744073709551615");
}

TEST(Message, IsCutAtTheEndOfItsRoom) {
  char text[8] = {1, 1, 1, 1, 1, 1, 1, 42};
  const message_line line = {text, 7};
  message_write(line, "abc");
  message_add(line, "%s", "defghij");
  message_add(line, "k");
  EXPECT_STREQ(text, "abcdef");
  EXPECT_EQ(text[7], 42);
}

TEST(Message, StaysOnOneLineWhateverItIsGiven) {
  char text[40] = "";
  const message_line line = {text, sizeof text};
  message_write(line, "a\nb\tc%s", "\x7f\x01");
  message_add(line, "%s", "\r\nd\u00fc");
  EXPECT_STREQ(text, "a?b?c????d\u00fc");
}

// The C library's %g, at the first of 6, 15 and 17 digits that reads back.
TEST(MessageNumber, IsWhatPrintfMakesOfIt) {
  std::mt19937_64 random(3);
  for (int k = 0; k < 20000; ++k) {
    const std::uint64_t bits = random();
    double value = static_cast<double>(static_cast<std::int64_t>(bits) >> 40) * 1e-3;
    if (k % 2) {
      std::memcpy(&value, &bits, sizeof value);
    }
    if (k % 16 == 1) {
      value = std::ldexp(1.0, static_cast<int>(bits % 2098) - 1074); /* powers of two: uneven neighbours */
    }
    if (!std::isfinite(value)) {
      continue;
    }
    char expected[40];
    for (const int digits : {6, 15, 17}) {
      std::snprintf(expected, sizeof expected, "%.*g", digits, value);
      if (std::strtod(expected, nullptr) == value) {
        break;
      }
    }
    ASSERT_EQ(number(value), expected);
  }
}

TEST(MessageNumber, HasADecimalPointInEveryLocale) {
  const std::string third = number(1.0 / 3.0);
  in_comma_locales([&] {
    EXPECT_EQ(number(0.125), "0.125");
    EXPECT_EQ(number(1.0 / 3.0), third);
  });
}

}  // namespace
