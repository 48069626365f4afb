/* Exponential, logarithm, sine and cosine with the same bits on every machine of one architecture: those of the C
 * library depend on what the processor offers (fused multiply-add). Accurate to about one unit in the last place. */
#ifndef TENDONFMU_PLANT_ELEMENTARY_H
#define TENDONFMU_PLANT_ELEMENTARY_H

#include <cmath>
#include <cstdint>
#include <cstring>

namespace tendonfmu::plant {

constexpr double pi = 3.14159265358979323846;

inline double power_of_two(int exponent) {
  const std::uint64_t bits = static_cast<std::uint64_t>(exponent + 1023) << 52;
  double value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/* Nearest integer of |x| < 2^51, exact, without a library call. */
inline double nearest(double x) {
  constexpr double shift = 6755399441055744.0;  // 1.5 · 2^52
  return (x + shift) - shift;
}

/* e^x; 0 below -708 and e^708 above 708. */
inline double exponential(double x) {
  if (x < -708.0) return 0.0;
  if (x > 708.0) x = 708.0;
  constexpr double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;
  const double k = nearest(x * 1.44269504088896338700);
  const double r = (x - k * ln2_high) - k * ln2_low;
  // Taylor's series to degree 13: |r| <= ln2/2 leaves less than 1e-17
  const double r2 = r * r;
  const double even =
      1.0 / 2 + r2 * (1.0 / 24 + r2 * (1.0 / 720 + r2 * (1.0 / 40320 + r2 * (1.0 / 3628800 + r2 / 479001600))));
  const double odd =
      1.0 / 6 + r2 * (1.0 / 120 + r2 * (1.0 / 5040 + r2 * (1.0 / 362880 + r2 * (1.0 / 39916800 + r2 / 6227020800.0))));
  return (1.0 + (r + r2 * (even + r * odd))) * power_of_two(static_cast<int>(k));
}

/* ln x of a normal x > 0: 2 artanh((m − 1)/(m + 1)) of the mantissa. */
inline double logarithm(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  int exponent = static_cast<int>(bits >> 52) - 1023;
  bits = (bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL;
  double mantissa;
  std::memcpy(&mantissa, &bits, sizeof mantissa);
  if (mantissa > 1.4142135623730951) {
    mantissa *= 0.5;
    ++exponent;
  }
  const double s = (mantissa - 1.0) / (mantissa + 1.0), s2 = s * s;
  double series = 0.0;
  for (int k = 23; k >= 3; k -= 2) series = s2 * (1.0 / k + series);
  return exponent * 6.93147180369123816490e-01 + (exponent * 1.90821492927058770002e-10 + 2.0 * (s + s * series));
}

struct sine_and_cosine {
  double sine, cosine;
};

/* Of |x| < 1e5 rad: reduced by multiples of π/2 in three parts, then Taylor's series. */
inline sine_and_cosine sine_cosine(double x) {
  const double k = nearest(x * 0.63661977236758134308);
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
  switch (static_cast<long long>(k) & 3) {
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

}  // namespace tendonfmu::plant

#endif
