#include "allocation_count.h"

#if defined(COUNTS_ALLOCATIONS)

namespace {
long allocations = 0;
}

void count_allocations_anew() {
  allocations = 0;
}

long counted_allocations() {
  return allocations;
}

bool allocations_count() {
  count_allocations_anew();
  void* volatile block = malloc(1);
  free(block);
  return allocations == 2;
}

extern "C" {
// NOLINTBEGIN(readability-identifier-naming): names of glibc
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);
// NOLINTEND(readability-identifier-naming)
void* malloc(size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
  ++allocations;
  return __libc_realloc(block, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
void free(void* block) {
  allocations += block != nullptr;
  __libc_free(block);
}
}

#endif
