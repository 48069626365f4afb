/* Included first by every source that computes: no contraction of a*b + c into one rounding, whatever flags an importer
 * compiles with, so that all machines give the same bits. */
#ifndef TENDONFMU_FLOATING_POINT_H
#define TENDONFMU_FLOATING_POINT_H

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* Four-lane functions must be inlined: a quad passed through memory costs more than most of them do. The transitions of
 * fig. 5 are rare and stay out of the way. */
#if defined(__GNUC__)
#define HOT_INLINE  static inline __attribute__((always_inline))
#define COLD_STATIC static __attribute__((noinline))
#elif defined(_MSC_VER)
#define HOT_INLINE  static __forceinline
#define COLD_STATIC static __declspec(noinline)
#else
#define HOT_INLINE  static inline
#define COLD_STATIC static
#endif

#endif
