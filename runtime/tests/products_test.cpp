// The products of products.h against sums in long double, on every implementation that runs here.
#include "products.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "allocation_count.h"

namespace {

using tendonfmu::estimation::products;

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

// below, at and beyond the parts that are multiplied at once (48, 96), and what an estimation has
const Size sizes[] = {{1, 1, 1},       {3, 2, 5},      {4, 4, 4},     {5, 7, 5},     {12, 12, 12},
                      {13, 129, 16},   {47, 3, 50},    {48, 48, 48},  {49, 128, 49}, {97, 130, 100},
                      {145, 257, 145}, {200, 64, 208}, {251, 49, 251}};

/* on every implementation that this processor and build have */
class ProductsTest : public testing::TestWithParam<const products*> {
 protected:
  const products* use_ = GetParam();
};

std::vector<const products*> implementations() {
  std::vector<const products*> all{&tendonfmu::estimation::baseline_products};
  if (&tendonfmu::estimation::best_products() != all[0]) {
    all.push_back(&tendonfmu::estimation::best_products());
  }
  return all;
}

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

TEST_P(ProductsTest, AddsOuterProductsToTheLowerTriangleAlone) {
  for (const auto& [p, k, stride] : sizes) {
    const std::vector<double> rows = some_rows(k, p, stride, 1), before = some_triangle(p, 2);
    std::vector<double> after = before;
    use_->add_outer_products(after.data(), p, rows.data(), k, stride, -0.75);
    expect_sums(after, p, before, k, [&, stride = stride](std::size_t j, std::size_t i, std::size_t r) {
      return -0.75L * rows[r * stride + i] * rows[r * stride + j];
    });
  }
}

TEST_P(ProductsTest, MultipliesByTheWholeSymmetricMatrix) {
  for (const auto& [p, k, stride] : sizes) {
    std::vector<double> rows = some_rows(k, p, stride, 3), product(k * (p + 2), untouched);
    for (std::size_t at = 0; at < rows.size(); ++at) {  // columns of zeros, as of parameters that do not matter
      rows[at] = at % stride % 3 || std::isnan(rows[at]) ? rows[at] : 0.0;
    }
    const std::vector<double> lower = some_triangle(p, 4);
    use_->multiply_symmetric(product.data(), p + 2, lower.data(), p, rows.data(), k, stride);
    expect_sums(product, p + 2, zeros(k, p, p + 2), p,
                [&, p = p, stride = stride](std::size_t r, std::size_t i, std::size_t c) {
                  return static_cast<long double>(rows[r * stride + c]) * lower[std::min(i, c) * p + std::max(i, c)];
                });
  }
}

TEST_P(ProductsTest, SolvesWithALowerTriangle) {
  for (const auto& [p, k, stride] : sizes) {
    std::vector<double> factor(k * (k + 1), untouched);
    const std::vector<double> some = numbers(k * k, 9);
    for (std::size_t r = 0; r < k; ++r) {
      for (std::size_t c = 0; c <= r; ++c) {
        factor[r * (k + 1) + c] = c < r ? 0.3 * some[r * k + c] / std::sqrt(static_cast<double>(k)) : 2.0;
      }
    }
    const std::vector<double> before = some_rows(k, p, stride, 10);
    std::vector<double> after = before;
    use_->solve_lower(factor.data(), k + 1, after.data(), k, stride, p);
    for (std::size_t at = 0; at < before.size(); ++at) {
      const std::size_t row = at / stride, i = at % stride;
      long double product = 0.0L;
      for (std::size_t c = 0; c <= row && i < p; ++c) {
        product += static_cast<long double>(factor[row * (k + 1) + c]) * after[c * stride + i];
      }
      ASSERT_EQ(std::isnan(after[at]), i >= p);
      ASSERT_TRUE(i >= p || std::fabs(static_cast<double>(product) - before[at]) < 1e-14 * (10.0 + k)) << row << i;
    }
  }
}

TEST_P(ProductsTest, MultipliesRowsByRows) {
  for (const auto& [p, k, stride] : sizes) {
    const std::size_t a = std::min<std::size_t>(k, 61);
    std::vector<double> left = some_rows(a, p, stride, 12), product(a * (k + 1), untouched);
    for (std::size_t r = 0; r < a; ++r) {
      left[r * stride + p / 2] = 0.0;
    }
    const std::vector<double> right = some_rows(k, p, p, 13);
    use_->multiply_transposed(product.data(), k + 1, left.data(), a, stride, right.data(), k, p, p);
    expect_sums(product, k + 1, zeros(a, k, k + 1), p,
                [&, p = p, stride = stride](std::size_t r, std::size_t s, std::size_t i) {
                  return static_cast<long double>(left[r * stride + i]) * right[s * p + i];
                });
  }
}

// of a size that fills all that is multiplied at once
TEST_P(ProductsTest, AllocatesNothing) {
#if defined(COUNTS_ALLOCATIONS)
  ASSERT_TRUE(allocations_count());
  const std::size_t p = 480, k = 260;
  std::vector<double> rows = some_rows(k, p, p, 1), lower = some_triangle(p, 2), product(k * p), inner(k * k);
  count_allocations_anew();
  use_->add_outer_products(lower.data(), p, rows.data(), k, p, 1e-3);
  use_->multiply_symmetric(product.data(), p, lower.data(), p, rows.data(), k, p);
  use_->multiply_transposed(inner.data(), k, rows.data(), k, p, product.data(), k, p, p);
  use_->solve_lower(inner.data(), k, rows.data(), k, p, p);
  const long counted = counted_allocations();
  EXPECT_EQ(counted, 0);
#else
  GTEST_SKIP() << "allocations are counted with glibc, without sanitizers";
#endif
}

INSTANTIATE_TEST_SUITE_P(Processors, ProductsTest, testing::ValuesIn(implementations()),
                         [](const auto& each) { return std::string(each.param->name); });

TEST(Products, TakesTheFastest) {
#if defined(TENDONFMU_ESTIMATION_AVX2)
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  EXPECT_STREQ(tendonfmu::estimation::best_products().name, avx2 ? "avx2" : "baseline");
#else
  EXPECT_STREQ(tendonfmu::estimation::best_products().name, "baseline");
#endif
}

}  // namespace
