#include "floating_point.h"

#include "kernel_choice.h"

#include <string.h>

#include "force_propagation.h"
#include "processor.h"

const step_kernel step_plain = STEP_KERNEL("plain");

const step_kernel* kernel_choose(const char* name) {
  const int automatic = strcmp(name, "auto") == 0;
#if defined(__GNUC__) && defined(__x86_64__)
  if ((automatic || strcmp(name, step_avx2.name) == 0) && has_avx2()) {
    return &step_avx2;
  }
#endif
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__aarch64__))
  if (automatic || strcmp(name, step_vector.name) == 0) {
    return &step_vector;
  }
#endif
  return automatic || strcmp(name, step_plain.name) == 0 ? &step_plain : NULL;
}

int kernel_rounds_as_written(void) {
  return rounds_as_written();
}
