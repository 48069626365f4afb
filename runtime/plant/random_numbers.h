/* Random numbers without a state: a number is a function of seed, channel and sample. */
#pragma once

#include <cmath>
#include <cstdint>

#include "elementary.h"

namespace tendonfmu::plant {

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
