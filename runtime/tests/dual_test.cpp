// Derivatives that come with the numbers, against those of formulas.
#include "dual.h"

#include <gtest/gtest.h>

namespace {

using namespace tendonfmu::plant;
using Two = dual<2>;

Two along(double value, int direction) {
  Two x(value);
  x.slope[static_cast<std::size_t>(direction)] = 1.0;
  return x;
}

void expect(const Two& found, double value, double by_first, double by_second) {
  EXPECT_DOUBLE_EQ(found.value, value);
  EXPECT_DOUBLE_EQ(found.slope[0], by_first);
  EXPECT_DOUBLE_EQ(found.slope[1], by_second);
}

TEST(Dual, KnowsTheRulesOfDerivatives) {
  const Two x = along(1.5, 0), y = along(-0.7, 1);
  expect(x + y, 0.8, 1.0, 1.0);
  expect(x - y, 2.2, 1.0, -1.0);
  expect(-x, -1.5, -1.0, 0.0);
  expect(x * y, -1.05, -0.7, 1.5);
  expect(2.0 * x, 3.0, 2.0, 0.0);
  expect(x / y, 1.5 / -0.7, 1.0 / -0.7, -1.5 / (0.7 * 0.7));
  expect(square_root(x), std::sqrt(1.5), 0.5 / std::sqrt(1.5), 0.0);
  EXPECT_EQ(value_of(x), 1.5);
}

// f = √(x² + sin(x y))/y against central differences
TEST(Dual, FollowsALongFormula) {
  const auto f = [](auto x, auto y) { return square_root(x * x + sine_cosine(x * y).sine) / y; };
  const double x = 1.3, y = 0.6, h = 1e-6;
  const Two found = f(along(x, 0), along(y, 1));
  EXPECT_DOUBLE_EQ(found.value, f(x, y));
  EXPECT_NEAR(found.slope[0], (f(x + h, y) - f(x - h, y)) / (2 * h), 1e-9);
  EXPECT_NEAR(found.slope[1], (f(x, y + h) - f(x, y - h)) / (2 * h), 1e-9);
}

}  // namespace
