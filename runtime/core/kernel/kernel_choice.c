#include "kernel_choice.h"

#include <string.h>

#include "step_kernels.h"

#if defined(__x86_64__) || defined(_M_X64)

#if defined(_MSC_VER)
#include <intrin.h>
#else
#include <cpuid.h>
#endif

static void cpuid(unsigned leaf, unsigned subleaf, unsigned registers[4]) {
#if defined(_MSC_VER)
  __cpuidex((int*)registers, (int)leaf, (int)subleaf);
#else
  __cpuid_count(leaf, subleaf, registers[0], registers[1], registers[2], registers[3]);
#endif
}

/* which register files the operating system saves */
static unsigned saved_registers(void) {
#if defined(_MSC_VER)
  return (unsigned)_xgetbv(0);
#else
  unsigned low, high;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return low;
#endif
}

/* own check: the compilers' builtin does not link under zig */
static int has_avx2(void) {
  enum { OSXSAVE = 1 << 27, AVX = 1 << 28, AVX2 = 1 << 5, SSE_AND_AVX_STATE = 6 };
  unsigned r[4];
  cpuid(0, 0, r);
  if (r[0] < 7) {
    return 0;
  }
  cpuid(1, 0, r);
  if (!(r[2] & OSXSAVE) || !(r[2] & AVX) || (saved_registers() & SSE_AND_AVX_STATE) != SSE_AND_AVX_STATE) {
    return 0;
  }
  cpuid(7, 0, r);
  return (r[1] & AVX2) != 0;
}

const step_kernel* kernel_choose(const char* name) {
  const int automatic = strcmp(name, "auto") == 0;
  if ((automatic || strcmp(name, "avx2") == 0) && has_avx2()) {
    return &step_avx2;
  }
  if (automatic || strcmp(name, "sse2") == 0) {
    return &step_sse2;
  }
  return strcmp(name, "plain") == 0 ? &step_plain : NULL;
}

#else

const step_kernel* kernel_choose(const char* name) {
  return strcmp(name, "auto") == 0 || strcmp(name, "plain") == 0 ? &step_plain : NULL;
}

#endif
