/* Doubles side by side, as many as the source asks for by TENDONFMU_QUAD_LANES (TENDONFMU_QUAD_AVX2: by its
 * instructions): vector types of GCC and Clang, with C's operators lane by lane. Without it, and with other compilers,
 * a quad is one double, whose bits all others give. Masks are joined by & | ^; a mask after ~ is good for & alone. */
#pragma once

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Where size counts (-Os) the compiler decides what it inlines. */
#if defined(__GNUC__) && !defined(__OPTIMIZE_SIZE__)
#define HOT_INLINE static inline __attribute__((always_inline))
#else
#define HOT_INLINE static inline
#endif

HOT_INLINE uint64_t bits_of(double x) {
  uint64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}

HOT_INLINE double double_of(uint64_t bits) {
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

#if defined(TENDONFMU_QUAD_LANES)

enum { QUAD_LANES = TENDONFMU_QUAD_LANES };
typedef double quad __attribute__((vector_size(8 * TENDONFMU_QUAD_LANES), may_alias));
typedef int64_t quad_mask __attribute__((vector_size(8 * TENDONFMU_QUAD_LANES))); /* 0 or −1 */

#if defined(__clang__)
#define QUAD_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define QUAD_SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (quad_mask){__VA_ARGS__})
#endif

#if defined(TENDONFMU_QUAD_AVX2)
#define QUAD_X86(name) __builtin_ia32_##name##pd256
#elif defined(__x86_64__) && TENDONFMU_QUAD_LANES == 2
#define QUAD_X86(name) __builtin_ia32_##name##pd
#endif

HOT_INLINE quad quad_keep(quad_mask m, quad a) {
  return (quad)((quad_mask)a & m);
}
HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
#if defined(TENDONFMU_QUAD_AVX2)
  return QUAD_X86(blendv)(b, a, (quad)m);
#endif
  return (quad)(((quad_mask)a & m) | ((quad_mask)b & ~m));
}
HOT_INLINE quad quad_abs(quad a) {
  return (quad)((quad_mask)a & INT64_MAX);
}
HOT_INLINE quad quad_with_sign(quad a, quad sign) {
  return (quad)((quad_mask)a ^ ((quad_mask)sign & INT64_MIN));
}
HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return (quad)((quad_mask)a + ((quad_mask)shifted << 52));
}
HOT_INLINE int quad_bits(quad_mask m) {
#if defined(QUAD_X86)
  return QUAD_X86(movmsk)((quad)m);
#endif
  int bits = 0;
  for (int lane = 0; lane < QUAD_LANES; ++lane) {
    bits |= (int)m[lane] & 1 << lane;
  }
  return bits;
}

#else

enum { QUAD_LANES = 1 };
typedef double quad;
typedef int quad_mask; /* 0 or 1 */

/* a where the mask is set, +0 elsewhere */
HOT_INLINE quad quad_keep(quad_mask m, quad a) {
  return m ? a : 0.0;
}
HOT_INLINE quad quad_select(quad_mask m, quad a, quad b) {
  return m ? a : b;
}
HOT_INLINE quad quad_abs(quad a) {
  return fabs(a);
}
/* a, or −a where the sign bit of `sign` is set */
HOT_INLINE quad quad_with_sign(quad a, quad sign) {
  return double_of(bits_of(a) ^ (bits_of(sign) & 0x8000000000000000u));
}
/* a·2^k, where the low bits of `shifted` hold the integer k (exponential.h) */
HOT_INLINE quad quad_scale(quad a, quad shifted) {
  return double_of(bits_of(a) + (bits_of(shifted) << 52));
}
/* one bit a lane */
HOT_INLINE int quad_bits(quad_mask m) {
  return m;
}

#endif

enum { QUAD_ALL = (1 << QUAD_LANES) - 1 };

/* aligned to the size of a quad */
HOT_INLINE quad quad_load(const double* from) {
  return *(const quad*)from;
}
HOT_INLINE void quad_store(double* to, quad a) {
  *(quad*)to = a;
}
HOT_INLINE quad quad_set(double x) {
  const quad zero = {0.0};
  return x - zero;
}
HOT_INLINE quad_mask quad_greater(quad a, quad b) {
  return (quad_mask)(a > b);
}
/* b where one is NaN */
HOT_INLINE quad quad_min(quad a, quad b) {
#if defined(QUAD_X86)
  return QUAD_X86(min)(a, b);
#endif
  return quad_select(quad_greater(b, a), a, b);
}
HOT_INLINE quad quad_max(quad a, quad b) {
#if defined(QUAD_X86)
  return QUAD_X86(max)(a, b);
#endif
  return quad_select(quad_greater(a, b), a, b);
}

/* Sums over a row: four side by side, each over every fourth lane, so that the order is the same however many lanes a
 * quad has. */
typedef struct quad_sums {
  quad of[4 / QUAD_LANES];
} quad_sums;

/* the lanes of a row from lane i on */
HOT_INLINE void quad_sums_add(quad_sums* sums, size_t i, quad a) {
  sums->of[i / QUAD_LANES % (4 / QUAD_LANES)] += a;
}
/* lane k: the sum of row k, (s0 + s2) + (s1 + s3) */
HOT_INLINE quad quad_sum_rows(const quad_sums row[QUAD_LANES]) {
#if defined(TENDONFMU_QUAD_LANES) && TENDONFMU_QUAD_LANES == 4
  const quad even[2] = {QUAD_SHUFFLE(row[0].of[0], row[1].of[0], 0, 4, 2, 6),
                        QUAD_SHUFFLE(row[2].of[0], row[3].of[0], 0, 4, 2, 6)};
  const quad odd[2] = {QUAD_SHUFFLE(row[0].of[0], row[1].of[0], 1, 5, 3, 7),
                       QUAD_SHUFFLE(row[2].of[0], row[3].of[0], 1, 5, 3, 7)};
  return (QUAD_SHUFFLE(even[0], even[1], 0, 1, 4, 5) + QUAD_SHUFFLE(even[0], even[1], 2, 3, 6, 7)) +
         (QUAD_SHUFFLE(odd[0], odd[1], 0, 1, 4, 5) + QUAD_SHUFFLE(odd[0], odd[1], 2, 3, 6, 7));
#elif defined(TENDONFMU_QUAD_LANES)
  const quad first = row[0].of[0] + row[0].of[1], second = row[1].of[0] + row[1].of[1];
  return QUAD_SHUFFLE(first, second, 0, 2) + QUAD_SHUFFLE(first, second, 1, 3);
#else
  return (row->of[0] + row->of[2]) + (row->of[1] + row->of[3]);
#endif
}
