/* The library of an FMU in a host in which one allocation after another fails: test_failing_allocations.py.
 *
 *   failing_allocations LIBRARY GUID LOCATION
 *
 * Prints: allocations of an instance's life; how many of them refuse a call when they fail; how many of these with a
 * message about memory; how many leave bytes behind, life after life. */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

static long allocations, failing = -1, messages;

void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* block, size_t size);

void* malloc(size_t size) {
  return allocations++ == failing ? NULL : __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  return allocations++ == failing ? NULL : __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
  return allocations++ == failing ? NULL : __libc_realloc(block, size);
}

static void* function(void* library, const char* name) {
  void* found = dlsym(library, name);
  if (!found) {
    fprintf(stderr, "failing_allocations: %s\n", dlerror());
    exit(1);
  }
  return found;
}

static void must(fmi2Status status, const char* what) {
  if (status != fmi2OK) {
    fprintf(stderr, "failing_allocations: allocation %ld: %s is refused\n", failing, what);
    exit(1);
  }
}

static void log_line(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                     fmi2String message, ...) {
  (void)environment, (void)name, (void)category;
  messages += status == fmi2Error && strstr(message, "memory") != NULL;
}

/* the FMU takes its own memory: it says so in its description */
static void* no_allocation(size_t count, size_t size) {
  (void)count, (void)size;
  return NULL;
}

/* Life of an instance in which allocation number `which` fails: 1 if a call was refused for it. */
static int life(void* library, const char* guid, const char* location, long which, long* left) {
  const fmi2CallbackFunctions callbacks = {log_line, no_allocation, free, NULL, NULL};
  fmi2InstantiateTYPE* instantiate;
  fmi2EnterInitializationModeTYPE* enter;
  fmi2ExitInitializationModeTYPE* leave;
  fmi2DoStepTYPE* step;
  fmi2GetFMUstateTYPE* get_state;
  fmi2FreeFMUstateTYPE* free_state;
  fmi2FreeInstanceTYPE* free_instance;
  *(void**)&instantiate = function(library, "fmi2Instantiate");
  *(void**)&enter = function(library, "fmi2EnterInitializationMode");
  *(void**)&leave = function(library, "fmi2ExitInitializationMode");
  *(void**)&step = function(library, "fmi2DoStep");
  *(void**)&get_state = function(library, "fmi2GetFMUstate");
  *(void**)&free_state = function(library, "fmi2FreeFMUstate");
  *(void**)&free_instance = function(library, "fmi2FreeInstance");

  const size_t before = mallinfo2().uordblks;
  int refused = 1;
  messages = allocations = 0;
  failing = which;
  fmi2Component finger = instantiate("hungry", fmi2CoSimulation, guid, location, &callbacks, fmi2False, fmi2True);
  if (finger) {
    fmi2FMUstate state = NULL;
    must(enter(finger), "fmi2EnterInitializationMode");
    must(leave(finger), "fmi2ExitInitializationMode");
    must(step(finger, 0.001, 0.001, fmi2True), "fmi2DoStep");
    refused = get_state(finger, &state) != fmi2OK;
    if (state) {
      must(free_state(finger, &state), "fmi2FreeFMUstate");
    }
    free_instance(finger);
  }
  failing = -1;
  *left = (long)mallinfo2().uordblks - (long)before;
  return refused;
}

int main(int count, char** words) {
  void* library = count == 4 ? dlopen(words[1], RTLD_NOW | RTLD_LOCAL) : NULL;
  if (!library) {
    fprintf(stderr, "failing_allocations: %s\n", count == 4 ? dlerror() : "expected LIBRARY GUID LOCATION");
    return 1;
  }
  long refused = 0, said = 0, leaks = 0, left = 0;
  life(library, words[2], words[3], -1, &left); /* what the C library keeps for itself */
  life(library, words[2], words[3], -1, &left);
  const long all = allocations;
  for (long which = 0; which < all; ++which) {
    long total = 0;
    for (int again = 0; again < 50; ++again) { /* the allocator keeps what the first ones free for the next */
      const int no = life(library, words[2], words[3], which, &left);
      total += again < 10 ? 0 : left;
      refused += again == 49 && no;
      said += again == 49 && no && messages > 0;
    }
    leaks += total >= 40;
  }
  printf("%ld %ld %ld %ld\n", all, refused, said, leaks);
  return 0;
}
