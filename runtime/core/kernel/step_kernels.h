#pragma once

#include "kernel_choice.h"

extern const step_kernel step_plain;
#if defined(__x86_64__) || defined(_M_X64)
extern const step_kernel step_sse2;
extern const step_kernel step_avx2;
#endif
