/* What both drivers have: they open an FMU's shared library, read numbers in hexadecimal and print bits of doubles.
 * With LINKED defined before, functions are those that the driver is linked with, and no library is opened. */
#ifndef DRIVER_H
#define DRIVER_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef LINKED
#define FUNCTION(name) (void)library
static void* open_library(const char* path) {
  return (void*)(uintptr_t)path;
}
#elif defined(_WIN32)
#define FUNCTION(name) name##TYPE* name = (name##TYPE*)(uintptr_t)find(library, #name)
#include <windows.h>
static void* open_library(const char* path) {
  return (void*)LoadLibraryA(path);
}
static void* find(void* library, const char* name) {
  return (void*)(uintptr_t)GetProcAddress((HMODULE)library, name);
}
#else
#define FUNCTION(name) name##TYPE* name = (name##TYPE*)(uintptr_t)find(library, #name)
#include <dlfcn.h>
static void* open_library(const char* path) {
  return dlopen(path, RTLD_NOW | RTLD_LOCAL);
}
static void* find(void* library, const char* name) {
  return dlsym(library, name);
}
#endif

enum { MOST = 256 }; /* variables of a kind, and their elements together */

static void fail(const char* what) {
  fprintf(stderr, "driver: %s\n", what);
  exit(1);
}

/* status: 0 is OK in both versions of FMI */
static void expect(int status, const char* call) {
  if (status != 0) {
    fail(call);
  }
}

static unsigned long long read_bits(FILE* file) {
  unsigned long long bits;
  if (fscanf(file, "%llx", &bits) != 1) {
    fail("the file of samples ends early");
  }
  return bits;
}

static void read_doubles(FILE* file, double* values, unsigned count) {
  for (unsigned i = 0; i < count; ++i) {
    const unsigned long long bits = read_bits(file);
    memcpy(&values[i], &bits, sizeof bits);
  }
}

static unsigned read_count(FILE* file) {
  const unsigned long long count = read_bits(file);
  if (count > MOST) {
    fail("too many variables");
  }
  return (unsigned)count;
}

static void print_doubles(const double* values, unsigned count) {
  for (unsigned i = 0; i < count; ++i) {
    unsigned long long bits;
    memcpy(&bits, &values[i], sizeof bits);
    printf("%016llx ", bits);
  }
}

/* arguments: program LIBRARY IDENTIFIER RESOURCES SAMPLES; returns the library */
static void* begin(int count, char** arguments, FILE** file) {
  if (count != 5) {
    fail("expected LIBRARY, GUID or token, RESOURCES and SAMPLES");
  }
  void* library = open_library(arguments[1]);
  *file = fopen(arguments[4], "r");
  if (!library || !*file) {
    fail(library ? "the file of samples cannot be opened" : "the library cannot be loaded");
  }
  return library;
}

#endif
