// Counts what a program allocates, where malloc can be replaced: with glibc and without a sanitizer.
#pragma once

#include <stdlib.h>

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define UNDER_SANITIZER 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define UNDER_SANITIZER 1
#endif

#if defined(__GLIBC__) && !defined(UNDER_SANITIZER)
#define COUNTS_ALLOCATIONS 1
// Functions, not a variable: the compiler takes malloc to change no variable of the program.
void count_allocations_anew();
// calls of malloc, calloc, realloc, aligned_alloc and free (of a block) since then
long counted_allocations();
// whether one of malloc and one of free are counted
bool allocations_count();
#endif
