/* Exponential, logarithm, sine and cosine with the same bits on every machine of one architecture: those of the C
 * library depend on what the processor offers (fused multiply-add). Accurate to about one unit in the last place. */
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

/* the plant shares nothing with the core, whose floating_point.h refuses the same */
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "TendonFMU cannot be compiled with -ffast-math or a part of it: exponentials would be wrong"
#endif

namespace tendonfmu::plant {

constexpr double pi = 3.14159265358979323846;

/* Two numbers at once, in one register of every 64-bit machine, with the same bits as one at a time. */
using pair = double __attribute__((vector_size(16)));
using pair_bits = std::uint64_t __attribute__((vector_size(16)));
constexpr std::size_t pair_size = 2;

inline std::uint64_t bits_of(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}
inline double from_bits(std::uint64_t bits) {
  double x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}
inline __attribute__((always_inline)) pair_bits bits_of(const pair& x) {
  return (pair_bits)x;
}
inline __attribute__((always_inline)) pair from_bits(const pair_bits& bits) {
  return (pair)bits;
}

/* e^x of |x| <= 708, beyond that e^±708. T: double or pair. */
template <class T>
inline __attribute__((always_inline)) T exponential(const T& argument) {
  constexpr double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;
  constexpr double shift = 6755399441055744.0;  // 1.5 · 2^52: the sum's last bits are the nearest integer
  const T low = T{} - 708.0, high = T{} + 708.0;
  T x = argument < low ? low : argument;
  x = x > high ? high : x;
  const T shifted = x * 1.44269504088896338700 + shift;
  const T k = shifted - shift;
  const T r = (x - k * ln2_high) - k * ln2_low;
  // Taylor's series to degree 13: |r| <= ln2/2 leaves less than 1e-17
  const T r2 = r * r;
  const T even =
      1.0 / 2 + r2 * (1.0 / 24 + r2 * (1.0 / 720 + r2 * (1.0 / 40320 + r2 * (1.0 / 3628800 + r2 * (1.0 / 479001600)))));
  const T odd =
      1.0 / 6 +
      r2 * (1.0 / 120 + r2 * (1.0 / 5040 + r2 * (1.0 / 362880 + r2 * (1.0 / 39916800 + r2 * (1.0 / 6227020800.0)))));
  // 2^k: k stands in the last bits of `shifted`, the rest leaves at the top
  return (1.0 + (r + r2 * (even + r * odd))) * from_bits((bits_of(shifted) + 1023) << 52);
}

/* ln x of a normal x > 0: 2 artanh((m − 1)/(m + 1)) of the mantissa. */
inline double logarithm(double x) {
  int exponent = static_cast<int>(bits_of(x) >> 52) - 1023;
  double mantissa = from_bits((bits_of(x) & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL);
  if (mantissa > 1.4142135623730951) {
    mantissa *= 0.5;
    ++exponent;
  }
  const double s = (mantissa - 1.0) / (mantissa + 1.0), s2 = s * s;
  double series = 0.0;
  for (int k = 23; k >= 3; k -= 2) {
    series = s2 * (1.0 / k + series);
  }
  return exponent * 6.93147180369123816490e-01 + (exponent * 1.90821492927058770002e-10 + 2.0 * (s + s * series));
}

struct sine_and_cosine {
  double sine, cosine;
};

/* Of |x| < 1e5 rad: reduced by multiples of π/2 in three parts, then Taylor's series. */
inline sine_and_cosine sine_cosine(double x) {
  constexpr double shift = 6755399441055744.0;  // as above
  const double shifted = x * 0.63661977236758134308 + shift, k = shifted - shift;
  const double r =
      ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21;
  const double r2 = r * r;
  const double s =
      r + r * r2 *
              (-1.0 / 6 +
               r2 * (1.0 / 120 +
                     r2 * (-1.0 / 5040 + r2 * (1.0 / 362880 + r2 * (-1.0 / 39916800 + r2 * (1.0 / 6227020800.0 -
                                                                                            r2 / 1307674368000.0))))));
  const double c =
      1.0 +
      r2 * (-0.5 +
            r2 * (1.0 / 24 + r2 * (-1.0 / 720 +
                                   r2 * (1.0 / 40320 + r2 * (-1.0 / 3628800 +
                                                             r2 * (1.0 / 479001600 - r2 * (1.0 / 87178291200.0 -
                                                                                           r2 / 20922789888000.0)))))));
  switch (bits_of(shifted) & 3) {
    case 0: return {s, c};
    case 1: return {c, -s};
    case 2: return {-s, -c};
    default: return {-c, s};
  }
}

inline double sine(double x) {
  return sine_cosine(x).sine;
}
inline double cosine(double x) {
  return sine_cosine(x).cosine;
}

/* --- random numbers without a state: a number is a function of seed, channel and sample -------------------------- */

/* Philox4x32-10: J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3",
 * SC 2011. counter [4], key [2]; result in counter. */
inline void philox(std::uint32_t counter[4], const std::uint32_t key[2]) {
  std::uint32_t k0 = key[0], k1 = key[1];
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0], b = std::uint64_t{0xCD9E8D57} * counter[2];
    const std::uint32_t next[4] = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ k0, static_cast<std::uint32_t>(b),
                                   static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ k1,
                                   static_cast<std::uint32_t>(a)};
    for (int i = 0; i < 4; ++i) {
      counter[i] = next[i];
    }
    k0 += 0x9E3779B9;
    k1 += 0xBB67AE85;
  }
}

/* Normal, mean 0, variance 1 (G. E. P. Box, M. E. Muller, 1958). */
inline double normal_number(std::uint64_t seed, std::uint32_t channel, std::uint64_t sample) {
  std::uint32_t counter[4] = {static_cast<std::uint32_t>(sample), static_cast<std::uint32_t>(sample >> 32), channel, 0};
  const std::uint32_t key[2] = {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)};
  philox(counter, key);
  const double scale = 1.0 / 18014398509481984.0;  // 2^-54
  const auto uniform = [&](int i) {
    const std::uint64_t bits = (std::uint64_t{counter[i]} << 32 | counter[i + 1]) >> 11;
    return static_cast<double>(2 * bits + 1) * scale;  // within (0, 1), symmetric
  };
  return std::sqrt(-2.0 * logarithm(uniform(0))) * cosine(2.0 * pi * uniform(2));
}

}  // namespace tendonfmu::plant
