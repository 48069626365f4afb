/* Runs an FMU's shared library over a sequence of samples and prints the outputs as bits of doubles. Compiled for the
 * same platform as the library, and run there or in an emulator: test_portable_binaries.py compares the platforms.
 *
 *   driver LIBRARY GUID RESOURCES SAMPLES      RESOURCES: file URI; SAMPLES: text file, numbers in hexadecimal
 *
 * Compiled with FMI2_FUNCTION_PREFIX it is linked with the FMU of that prefix, and LIBRARY is not looked at.
 *
 * The file of samples:
 *
 *   inputs count, value references; real outputs count, value references; Boolean outputs count, value references;
 *   samples count; per sample: time, inputs (bits of doubles) */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#ifdef FMI2_FUNCTION_PREFIX
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

enum { MOST = 256 };

typedef struct numbers {
  fmi2ValueReference references[MOST];
  unsigned count;
} numbers;

static void fail(const char* what) {
  fprintf(stderr, "driver: %s\n", what);
  exit(1);
}

static void expect(fmi2Status status, const char* call) {
  if (status != fmi2OK) {
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

static double read_double(FILE* file) {
  const unsigned long long bits = read_bits(file);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

static numbers read_references(FILE* file) {
  numbers n;
  n.count = (unsigned)read_bits(file);
  if (n.count > MOST) {
    fail("too many variables");
  }
  for (unsigned i = 0; i < n.count; ++i) {
    n.references[i] = (fmi2ValueReference)read_bits(file);
  }
  return n;
}

static void print_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                          fmi2String text, ...) {
  (void)environment;
  (void)name;
  fprintf(stderr, "driver: status %d, %s: %s\n", (int)status, category, text);
}

int main(int count, char** arguments) {
  if (count != 5) {
    fail("usage: driver LIBRARY GUID RESOURCES SAMPLES");
  }
  void* library = open_library(arguments[1]);
  FILE* file = fopen(arguments[4], "r");
  if (!library || !file) {
    fail(library ? "the file of samples cannot be opened" : "the library cannot be loaded");
  }
  FUNCTION(fmi2Instantiate);
  FUNCTION(fmi2SetupExperiment);
  FUNCTION(fmi2EnterInitializationMode);
  FUNCTION(fmi2ExitInitializationMode);
  FUNCTION(fmi2SetReal);
  FUNCTION(fmi2GetReal);
  FUNCTION(fmi2GetBoolean);
  FUNCTION(fmi2DoStep);
  FUNCTION(fmi2FreeInstance);

  const fmi2CallbackFunctions callbacks = {print_message, NULL, NULL, NULL, NULL};
  fmi2Component finger =
      fmi2Instantiate("finger", fmi2CoSimulation, arguments[2], arguments[3], &callbacks, fmi2False, fmi2True);
  if (!finger) {
    fail("fmi2Instantiate");
  }
  const numbers inputs = read_references(file), outputs = read_references(file), flags = read_references(file);
  const unsigned samples = (unsigned)read_bits(file);
  double time = 0.0, values[MOST];
  int states[MOST];
  for (unsigned k = 0; k < samples; ++k) {
    const double before = time;
    time = read_double(file);
    for (unsigned i = 0; i < inputs.count; ++i) {
      values[i] = read_double(file);
    }
    if (k == 0) { /* initialisation takes the first sample, the step that ends at the second one changes nothing */
      expect(fmi2SetupExperiment(finger, fmi2False, 0.0, time, fmi2False, 0.0), "fmi2SetupExperiment");
      expect(fmi2EnterInitializationMode(finger), "fmi2EnterInitializationMode");
      expect(fmi2SetReal(finger, inputs.references, inputs.count, values), "fmi2SetReal");
      expect(fmi2ExitInitializationMode(finger), "fmi2ExitInitializationMode");
    } else {
      expect(fmi2DoStep(finger, before, time - before, fmi2True), "fmi2DoStep");
      expect(fmi2SetReal(finger, inputs.references, inputs.count, values), "fmi2SetReal");
    }
    expect(fmi2GetReal(finger, outputs.references, outputs.count, values), "fmi2GetReal");
    expect(fmi2GetBoolean(finger, flags.references, flags.count, states), "fmi2GetBoolean");
    for (unsigned i = 0; i < outputs.count; ++i) {
      unsigned long long bits;
      memcpy(&bits, &values[i], sizeof bits);
      printf("%016llx ", bits);
    }
    for (unsigned i = 0; i < flags.count; ++i) {
      printf("%d ", states[i]);
    }
    printf("\n");
  }
  fmi2FreeInstance(finger);
  fclose(file);
  return 0;
}
