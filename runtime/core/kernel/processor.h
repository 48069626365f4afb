/* What the x86-64 processor and its operating system allow. Own checks: the compilers' __builtin_cpu_supports does not
 * link under zig. */
#pragma once

#if defined(__x86_64__) || defined(_M_X64)

#if defined(_MSC_VER)
#include <intrin.h>
#else
#include <cpuid.h>
#endif

static inline void cpuid(unsigned leaf, unsigned subleaf, unsigned registers[4]) {
#if defined(_MSC_VER)
  __cpuidex((int*)registers, (int)leaf, (int)subleaf);
#else
  __cpuid_count(leaf, subleaf, registers[0], registers[1], registers[2], registers[3]);
#endif
}

/* which register files the operating system saves */
static inline unsigned saved_registers(void) {
#if defined(_MSC_VER)
  return (unsigned)_xgetbv(0);
#else
  unsigned low, high;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return low;
#endif
}

/* Whether the processor has the features of leaf 1 (register ECX) and leaf 7 (EBX), and the system saves the registers.
 */
static inline int processor_has(unsigned leaf1, unsigned leaf7, unsigned registers) {
  enum { OSXSAVE = 1 << 27 };
  unsigned r[4];
  cpuid(0, 0, r);
  if (r[0] < 7) {
    return 0;
  }
  cpuid(1, 0, r);
  if (!(r[2] & OSXSAVE) || (r[2] & leaf1) != leaf1 || (saved_registers() & registers) != registers) {
    return 0;
  }
  cpuid(7, 0, r);
  return (r[1] & leaf7) == leaf7;
}

enum {
  PROCESSOR_AVX = 1 << 28, /* of leaf 1 */
  PROCESSOR_FMA = 1 << 12,
  PROCESSOR_AVX2 = 1 << 5, /* of leaf 7 */
  REGISTERS_AVX = 0x06     /* SSE and AVX */
};

static inline int has_avx2(void) {
  return processor_has(PROCESSOR_AVX, PROCESSOR_AVX2, REGISTERS_AVX);
}

static inline int has_avx2_and_fma(void) {
  return processor_has(PROCESSOR_AVX | PROCESSOR_FMA, PROCESSOR_AVX2, REGISTERS_AVX);
}

#endif
