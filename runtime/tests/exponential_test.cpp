// exp(−x) of the kernels: within 1.5 ulp of the true value, and the same bits in all of them. Sine and cosine of the
// core.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core_inside.h"
#include "test_finger.h"

extern "C" {
#include "elementary.h"
#include "exponential_kernels.h"
}

namespace {

// Four arguments or results, aligned as the kernels want them.
struct alignas(32) Four {
  double lane[4];
};

// Arguments over the whole range: uniform, logarithmic, around the ends of the argument reduction.
std::vector<Four> arguments(int count) {
  std::mt19937_64 random(20240607);
  std::vector<double> x;
  for (const double edge : {0.0, -0.0, 5e-324, 1e-308, 1e-17, 1e-16, 1.0, 707.999, 708.0, std::nextafter(708.0, 709.0),
                            709.0, 745.0, 1e300, HUGE_VAL, std::log(2.0), 0.5 * std::log(2.0)}) {
    x.push_back(edge);
  }
  for (int i = 0; i < count; ++i) {
    x.push_back(std::uniform_real_distribution<>(0.0, 2.0)(random));
  }
  for (int i = 0; i < count; ++i) {
    x.push_back(std::uniform_real_distribution<>(0.0, 708.0)(random));
  }
  for (int i = 0; i < count / 2; ++i) {
    x.push_back(std::exp2(std::uniform_real_distribution<>(-60.0, 9.4)(random)));
  }
  for (int k = 0; k < 1021; ++k) {
    for (int i = 0; i < 100; ++i) {
      x.push_back((k + 0.5 + 1e-6 * std::uniform_real_distribution<>(-1.0, 1.0)(random)) * std::log(2.0));
    }
  }
  while (x.size() % 4) {
    x.push_back(1.0);
  }
  std::vector<Four> quads(x.size() / 4);
  std::memcpy(quads.data(), x.data(), x.size() * sizeof(double));
  return quads;
}

std::vector<Four> results(void (*kernel)(const double*, double*, std::size_t), const std::vector<Four>& x) {
  std::vector<Four> y(x.size());
  kernel(x.data()->lane, y.data()->lane, 4 * x.size());
  return y;
}

double ulp(double y) {
  return std::nextafter(y, HUGE_VAL) - y;
}

TEST(Exponential, IsWithinOneAndAHalfUlp) {
  // where long double is no wider, the reference itself may be wrong by half an ulp
  const double limit = std::numeric_limits<long double>::digits > 60 ? 1.5 : 2.0;
  const std::vector<Four> x = arguments(1000000), y = results(exponential_plain, x);
  double worst = 0.0, worst_argument = 0.0;
  for (std::size_t i = 0; i < 4 * x.size(); ++i) {
    const double argument = x[i / 4].lane[i % 4];
    if (argument > 708.0) {
      continue;
    }
    const long double exact = expl(-static_cast<long double>(argument));
    const double error = static_cast<double>(fabsl(y[i / 4].lane[i % 4] - exact)) / ulp(static_cast<double>(exact));
    if (error > worst) {
      worst = error;
      worst_argument = argument;
    }
  }
  std::printf("largest error over %zu arguments: %.3f ulp at %.17g\n", 4 * x.size(), worst, worst_argument);
  RecordProperty("largest_error_ulp", std::to_string(worst));
  EXPECT_LT(worst, limit) << "at x = " << worst_argument;
}

TEST(Exponential, IsOneAtZeroAndNeverSubnormal) {
  EXPECT_EQ(law_exponential(0.0), 1.0);
  EXPECT_EQ(law_exponential(-0.0), 1.0);
  EXPECT_GT(law_exponential(708.0), std::numeric_limits<double>::min());
  for (const double x : {std::nextafter(708.0, 709.0), 745.0, 1e300, HUGE_VAL}) {
    EXPECT_EQ(law_exponential(x), law_exponential(708.0)) << x;
  }
}

TEST(Exponential, OneMinusIsExactForSmallArguments) {
  std::mt19937_64 random(7);
  double worst = 0.0;
  for (int i = 0; i < 200000; ++i) {
    const double x = std::exp2(std::uniform_real_distribution<>(-60.0, 9.0)(random));
    const long double exact = -expm1l(-static_cast<long double>(x));
    worst = std::max(worst, static_cast<double>(fabsl(law_one_minus_exponential(x) - exact) / exact));
  }
  // just above 0.01 the subtraction leaves 1 - exp(-x) an error of an ulp of 1 in a value of 0.01
  EXPECT_LT(worst, 1.5 * std::numeric_limits<double>::epsilon() / 0.01);
  for (const double x : {1e-3, 1e-5, 1e-9, 1e-300}) {
    EXPECT_DOUBLE_EQ(law_one_minus_exponential(x), -std::expm1(-x));
  }
}

TEST(Logarithm, IsWithinAnUlp) {
  std::mt19937_64 random(8);
  double worst = 0.0;
  for (int i = 0; i < 400000; ++i) {
    const double size = std::uniform_real_distribution<>(-40.0, 9.0)(random);
    const double x = i % 2 == 0 ? std::exp2(size) : 1.0 - std::exp2(size - 10.0);
    const long double exact = logl(static_cast<long double>(x));
    worst = std::max(worst, static_cast<double>(fabsl(law_logarithm(x) - exact) / ulp(std::fabs(law_logarithm(x)))));
  }
  EXPECT_LT(worst, std::numeric_limits<long double>::digits > 60 ? 1.0 : 1.5);
  EXPECT_EQ(law_logarithm(1.0), 0.0);
  EXPECT_EQ(law_logarithm(0.5), -std::log(2.0));
  EXPECT_NEAR(law_logarithm(std::numeric_limits<double>::min()), std::log(std::numeric_limits<double>::min()), 1e-12);
}

// --- the same bits in all kernels -----------------------------------------------------------------------------------

TEST(ExponentialKernels, OneLaneIsTheScalarFunction) {
  const std::vector<Four> x = arguments(100000), y = results(exponential_plain, x);
  for (std::size_t i = 0; i < 4 * x.size(); i += 7) {
    ASSERT_EQ(law_exponential(x[i / 4].lane[i % 4]), y[i / 4].lane[i % 4]) << x[i / 4].lane[i % 4];
  }
}

void expect_bits_of_plain(const std::string& name, void (*kernel)(const double*, double*, std::size_t)) {
  const std::vector<const char*> here = test_finger::kernels();
  if (std::find(here.begin(), here.end(), name) == here.end()) {
    GTEST_SKIP() << "this machine has no " << name << " kernel";
  }
  const std::vector<Four> x = arguments(100000), a = results(kernel, x), b = results(exponential_plain, x);
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(Four)), 0);
}

#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__))
TEST(ExponentialKernels, VectorsHaveTheBitsOfPlain) {
#if defined(__x86_64__)
  expect_bits_of_plain("sse2", exponential_vector);
#else
  expect_bits_of_plain("neon", exponential_vector);
#endif
}
#endif

#if defined(__GNUC__) && defined(__x86_64__)
TEST(ExponentialKernels, Avx2HasTheBitsOfPlain) {
  expect_bits_of_plain("avx2", exponential_avx2);
}
#endif

// --- sine and cosine ------------------------------------------------------------------------------------------------

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

}  // namespace
