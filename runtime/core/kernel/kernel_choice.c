#include "floating_point.h"

#include "kernel_choice.h"

#include <string.h>

#include "exponential.h"
#include "processor.h"
#include "step_kernels.h"

int kernel_rounds_as_written(void) {
  return rounds_as_written();
}

#if defined(__x86_64__) || defined(_M_X64)

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
