/* A host in which one allocation after another fails, linked with the library of an FMU: test_library.py.
 *
 *   failing_allocations GUID LOCATION
 *
 * Prints: allocations of an instance's life; how many of them refuse a call when they fail; how many of these with a
 * message about memory; how many leave bytes behind, life after life. */
#define _GNU_SOURCE

#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

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
static int life(const char* guid, const char* location, long which, long* left) {
  const fmi2CallbackFunctions callbacks = {log_line, no_allocation, free, NULL, NULL};
  const size_t before = mallinfo2().uordblks;
  int refused = 1;
  messages = allocations = 0;
  failing = which;
  fmi2Component finger = fmi2Instantiate("hungry", fmi2CoSimulation, guid, location, &callbacks, fmi2False, fmi2True);
  if (finger) {
    fmi2FMUstate state = NULL;
    must(fmi2EnterInitializationMode(finger), "fmi2EnterInitializationMode");
    must(fmi2ExitInitializationMode(finger), "fmi2ExitInitializationMode");
    must(fmi2DoStep(finger, 0.001, 0.001, fmi2True), "fmi2DoStep");
    refused = fmi2GetFMUstate(finger, &state) != fmi2OK;
    if (state) {
      must(fmi2FreeFMUstate(finger, &state), "fmi2FreeFMUstate");
    }
    fmi2FreeInstance(finger);
  }
  failing = -1;
  *left = (long)mallinfo2().uordblks - (long)before;
  return refused;
}

int main(int count, char** words) {
  long refused = 0, reported = 0, leaks = 0, left = 0;
  if (count != 3) {
    return 2;
  }
  life(words[1], words[2], -1, &left); /* what the C library keeps for itself */
  life(words[1], words[2], -1, &left);
  const long all = allocations;
  for (long which = 0; which < all; ++which) {
    long total = 0;
    for (int again = 0; again < 50; ++again) { /* the allocator keeps what the first ones free for the next */
      const int no = life(words[1], words[2], which, &left);
      total += again < 10 ? 0 : left;
      refused += again == 49 && no;
      reported += again == 49 && no && messages > 0;
    }
    leaks += total >= 40;
  }
  printf("%ld %ld %ld %ld\n", all, refused, reported, leaks);
  return 0;
}
