/* How the functions of a kernel are declared. */
#pragma once

/* Four-lane functions must be inlined: a quad passed through memory costs more than most of them do. Where size counts
 * (-Os), the compiler decides. The transitions of fig. 5 are rare and stay out of the way. */
#if defined(__GNUC__) && defined(__OPTIMIZE_SIZE__)
#define HOT_INLINE  static inline
#define COLD_STATIC static __attribute__((noinline))
#elif defined(__GNUC__)
#define HOT_INLINE  static inline __attribute__((always_inline))
#define COLD_STATIC static __attribute__((noinline))
#elif defined(_MSC_VER)
#define HOT_INLINE  static __forceinline
#define COLD_STATIC static __declspec(noinline)
#else
#define HOT_INLINE  static inline
#define COLD_STATIC static
#endif
