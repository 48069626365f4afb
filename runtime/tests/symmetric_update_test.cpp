// The products of symmetric_update.h against sums in long double, on every implementation that runs here.
#include "symmetric_update.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace {

using tendonfmu::estimation::symmetric_update;

// What nobody may read: it would be seen in every result it reached.
const double untouched = std::nan("");

std::vector<double> numbers(std::size_t count, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> all(count);
  for (double& x : all) {
    x = normal(random);
  }
  return all;
}

/* rows [k × p] with NaN between p and the stride */
std::vector<double> some_rows(std::size_t k, std::size_t p, std::size_t stride, unsigned seed) {
  std::vector<double> rows(k * stride, untouched);
  const std::vector<double> values = numbers(k * p, seed);
  for (std::size_t r = 0; r < k; ++r) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(r * p), p,
                rows.begin() + static_cast<std::ptrdiff_t>(r * stride));
  }
  return rows;
}

/* lower triangle with NaN above the diagonal */
std::vector<double> some_triangle(std::size_t p, unsigned seed) {
  std::vector<double> lower = numbers(p * p, seed);
  for (std::size_t j = 0; j < p; ++j) {
    std::fill_n(lower.begin() + static_cast<std::ptrdiff_t>(j * p), j, untouched);
  }
  return lower;
}

struct Size {
  std::size_t p, k, stride;
};

// below, at and beyond tiles (4, 12), packings (48 columns, 128 steps), and what an estimation has
const Size sizes[] = {{1, 1, 1},       {3, 2, 5},      {4, 4, 4},     {5, 7, 5},     {12, 12, 12},
                      {13, 129, 16},   {47, 3, 50},    {48, 48, 48},  {49, 128, 49}, {97, 130, 100},
                      {145, 257, 145}, {200, 64, 208}, {251, 49, 251}};

class SymmetricUpdateTest : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    kernel_ = tendonfmu::estimation::symmetric_updates() + GetParam();
    if (!kernel_->name) {
      GTEST_SKIP() << "this processor or build has no further implementation";
    }
  }
  const symmetric_update* kernel_ = nullptr;
};

/* Rows of sums over term(row, column, s), s < count, beside what was there; NaN is left as it was. */
template <class Term>
void expect_sums(const std::vector<double>& found, std::size_t stride, const std::vector<double>& before,
                 std::size_t count, Term term) {
  ASSERT_EQ(found.size(), before.size());
  const double allowance =
      1e-15 * static_cast<double>(count + 10);  // each product of size one is rounded once or twice
  for (std::size_t at = 0; at < found.size(); ++at) {
    if (std::isnan(before[at])) {
      ASSERT_TRUE(std::isnan(found[at])) << at;
      continue;
    }
    long double expected = before[at];
    for (std::size_t s = 0; s < count; ++s) {
      expected += term(at / stride, at % stride, s);
    }
    ASSERT_NEAR(found[at], static_cast<double>(expected), allowance) << at / stride << ", " << at % stride;
  }
}

/* what is written, whatever was there */
std::vector<double> zeros(std::size_t k, std::size_t p, std::size_t stride) {
  std::vector<double> rows = some_rows(k, p, stride, 1);
  for (double& x : rows) {
    x = std::isnan(x) ? x : 0.0;
  }
  return rows;
}

TEST_P(SymmetricUpdateTest, AddsOuterProductsToTheLowerTriangleAlone) {
  for (const auto& [p, k, stride] : sizes) {
    const std::vector<double> rows = some_rows(k, p, stride, 1), before = some_triangle(p, 2);
    std::vector<double> after = before;
    kernel_->add_outer_products(after.data(), p, rows.data(), k, stride, -0.75);
    expect_sums(after, p, before, k, [&, stride = stride](std::size_t j, std::size_t i, std::size_t r) {
      return -0.75L * rows[r * stride + i] * rows[r * stride + j];
    });
  }
}

TEST_P(SymmetricUpdateTest, MultipliesByTheWholeSymmetricMatrix) {
  for (const auto& [p, k, stride] : sizes) {
    std::vector<double> rows = some_rows(k, p, stride, 3), product(k * (p + 2), untouched);
    for (std::size_t at = 0; at < rows.size(); ++at) {  // columns of zeros, as of parameters that do not matter
      rows[at] = at % stride % 3 || std::isnan(rows[at]) ? rows[at] : 0.0;
    }
    const std::vector<double> lower = some_triangle(p, 4);
    kernel_->multiply_symmetric(product.data(), p + 2, lower.data(), p, rows.data(), k, stride);
    expect_sums(product, p + 2, zeros(k, p, p + 2), p,
                [&, p = p, stride = stride](std::size_t r, std::size_t i, std::size_t c) {
                  return static_cast<long double>(rows[r * stride + c]) * lower[std::min(i, c) * p + std::max(i, c)];
                });
  }
}

TEST_P(SymmetricUpdateTest, AddsWeightedRows) {
  for (const auto& [p, k, stride] : sizes) {
    for (const std::size_t a : {1, 7, 50}) {
      const std::vector<double> rows = some_rows(k, p, stride, 9), weights = some_rows(a, k, k + 1, 10);
      const std::vector<double> before = some_rows(a, p, p + 3, 11);
      std::vector<double> after = before;
      kernel_->add_weighted_rows(after.data(), p + 3, a, weights.data(), k + 1, rows.data(), k, stride, p, -2.0);
      expect_sums(after, p + 3, before, k, [&, k = k, stride = stride](std::size_t r, std::size_t i, std::size_t s) {
        return -2.0L * weights[r * (k + 1) + s] * rows[s * stride + i];
      });
    }
  }
}

TEST_P(SymmetricUpdateTest, MultipliesRowsByRows) {
  for (const auto& [p, k, stride] : sizes) {
    const std::size_t a = std::min<std::size_t>(k, 61);
    std::vector<double> left = some_rows(a, p, stride, 12), product(a * (k + 1), untouched);
    for (std::size_t r = 0; r < a; ++r) {
      left[r * stride + p / 2] = 0.0;
    }
    const std::vector<double> right = some_rows(k, p, p, 13);
    kernel_->multiply_transposed(product.data(), k + 1, left.data(), a, stride, right.data(), k, p, p);
    expect_sums(product, k + 1, zeros(a, k, k + 1), p,
                [&, p = p, stride = stride](std::size_t r, std::size_t s, std::size_t i) {
                  return static_cast<long double>(left[r * stride + i]) * right[s * p + i];
                });
  }
}

TEST_P(SymmetricUpdateTest, GivesTheSameBitsForAPartAsForTheWhole) {
  // an element's sum does not depend on the tile it falls into: unknowns that are left out change no other number
  const std::size_t p = 61, k = 37;
  const std::vector<double> rows = some_rows(k, p, p, 5);
  std::vector<double> whole(p * p, 1.0);
  kernel_->add_outer_products(whole.data(), p, rows.data(), k, p, 2.0);
  for (std::size_t first = 1; first < 14; ++first) {
    const std::size_t q = p - first;
    std::vector<double> part(q * q, 1.0);
    kernel_->add_outer_products(part.data(), q, rows.data() + first, k, p, 2.0);
    for (std::size_t j = 0; j < q; ++j) {
      const double* expected = whole.data() + (j + first) * p + j + first;
      ASSERT_EQ(std::memcmp(part.data() + j * q + j, expected, (q - j) * sizeof(double)), 0) << first << " " << j;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, SymmetricUpdateTest, testing::Values(0, 1));

TEST(SymmetricUpdate, TakesTheFastestFirstAndEndsWithThePortable) {
  const symmetric_update* list = tendonfmu::estimation::symmetric_updates();
  std::size_t last = 0;
  while (list[last + 1].name) {
    ++last;
  }
  EXPECT_STREQ(list[last].name, "portable");
#if defined(TENDONFMU_ESTIMATION_AVX2)
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  EXPECT_STREQ(list[0].name, avx2 ? "avx2" : "portable");
#endif
}

}  // namespace
