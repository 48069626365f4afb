/* Runs the shared library of an FMU over a sequence of samples and prints the outputs as bits of doubles. Compiled for
 * the platform of the library, by -DFMI=2 or -DFMI=3 for the version, and run there or in an emulator: c_driver.py.
 *
 *   driver LIBRARY IDENTIFIER RESOURCES SAMPLES      SAMPLES: text file, numbers in hexadecimal
 *
 * Compiled with FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX it is linked with the FMU of that prefix, and LIBRARY is
 * not looked at. The file of samples:
 *
 *   inputs count, for each its value reference and number of elements; the same of outputs that are numbers and of
 * flags; samples count; per sample: time, inputs (bits of doubles)
 *
 * A step that is discarded is repeated with the inputs of the last good one: what a master should do that cannot leave
 * a sample out. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
#else
#include "fmi3Functions.h"
#endif

#if defined(FMI2_FUNCTION_PREFIX) || defined(FMI3_FUNCTION_PREFIX)
#define FUNCTION(name)
#define OPEN(path) (void*)(uintptr_t)(path)
#elif defined(_WIN32)
#include <windows.h>
#define OPEN(path)     (void*)LoadLibraryA(path)
#define FUNCTION(name) name##TYPE* name = (name##TYPE*)(uintptr_t)GetProcAddress((HMODULE)library, #name)
#else
#include <dlfcn.h>
#define OPEN(path)     dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FUNCTION(name) name##TYPE* name = (name##TYPE*)(uintptr_t)dlsym(library, #name)
#endif

enum { MOST = 256 }; /* variables of a kind, and their elements together */

typedef struct numbers {
  unsigned references[MOST], count, elements;
} numbers;

static void expect(int good, const char* call) {
  if (!good) {
    fprintf(stderr, "driver: %s\n", call);
    exit(1);
  }
}

static unsigned long long read_bits(FILE* file) {
  unsigned long long bits = 0;
  expect(fscanf(file, "%llx", &bits) == 1, "the file of samples ends early");
  return bits;
}

static numbers read_references(FILE* file) {
  numbers n = {.count = (unsigned)read_bits(file)};
  for (unsigned i = 0; i < n.count && i < MOST; ++i) {
    n.references[i] = (unsigned)read_bits(file);
    n.elements += (unsigned)read_bits(file);
  }
  expect(n.count <= MOST && n.elements <= MOST, "too many variables");
  return n;
}

static void read_doubles(FILE* file, double* values, unsigned count) {
  for (unsigned i = 0; i < count; ++i) {
    const unsigned long long bits = read_bits(file);
    memcpy(&values[i], &bits, sizeof bits);
  }
}

static void print_doubles(const double* values, unsigned count) {
  for (unsigned i = 0; i < count; ++i) {
    unsigned long long bits;
    memcpy(&bits, &values[i], sizeof bits);
    printf("%016llx ", bits);
  }
}

/* What differs between the versions: a name for each call, with arguments that both know. */
#if FMI == 2
typedef fmi2Boolean flag;
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String text, ...) {
  (void)environment, (void)name;
  fprintf(stderr, "driver: status %d, %s: %s\n", (int)status, category, text);
}
static const fmi2CallbackFunctions callbacks = {log_message, NULL, NULL, NULL, NULL};
#define FUNCTIONS                        \
  FUNCTION(fmi2Instantiate);             \
  FUNCTION(fmi2SetupExperiment);         \
  FUNCTION(fmi2EnterInitializationMode); \
  FUNCTION(fmi2ExitInitializationMode);  \
  FUNCTION(fmi2SetReal);                 \
  FUNCTION(fmi2GetReal);                 \
  FUNCTION(fmi2GetBoolean);              \
  FUNCTION(fmi2DoStep);                  \
  FUNCTION(fmi2GetStatus);               \
  FUNCTION(fmi2GetRealStatus);           \
  FUNCTION(fmi2GetBooleanStatus);        \
  FUNCTION(fmi2FreeInstance)
#define INSTANTIATE(id, folder) fmi2Instantiate("finger", fmi2CoSimulation, id, folder, &callbacks, 0, 1)
#define ENTER(start)            (fmi2SetupExperiment(finger, 0, 0.0, start, 0, 0.0) || fmi2EnterInitializationMode(finger))
#define EXIT()                  fmi2ExitInitializationMode(finger)
#define SET(n, values)          fmi2SetReal(finger, (n).references, (n).count, values)
#define GET(n, values)          fmi2GetReal(finger, (n).references, (n).count, values)
#define GET_FLAGS(n, values)    fmi2GetBoolean(finger, (n).references, (n).count, values)
#define STEP(from, length)      fmi2DoStep(finger, from, length, 1)
#define REACHED(time, discarded)                                                                                   \
  (fmi2GetStatus(finger, fmi2DoStepStatus, &answer) == fmi2OK && answer == ((discarded) ? fmi2Discard : fmi2OK) && \
   fmi2GetRealStatus(finger, fmi2LastSuccessfulTime, &reached) == fmi2OK && reached == (time) &&                   \
   fmi2GetBooleanStatus(finger, fmi2Terminated, &terminate) == fmi2OK && !terminate)
#define FREE() fmi2FreeInstance(finger)
static fmi2Status answer;
static fmi2Boolean terminate;
static double reached;
#else
typedef fmi3Boolean flag;
static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text) {
  (void)environment;
  fprintf(stderr, "driver: status %d, %s: %s\n", (int)status, category, text);
}
static fmi3Boolean event, terminate, early;
static double reached;
#define FUNCTIONS                        \
  FUNCTION(fmi3InstantiateCoSimulation); \
  FUNCTION(fmi3EnterInitializationMode); \
  FUNCTION(fmi3ExitInitializationMode);  \
  FUNCTION(fmi3SetFloat64);              \
  FUNCTION(fmi3GetFloat64);              \
  FUNCTION(fmi3GetBoolean);              \
  FUNCTION(fmi3DoStep);                  \
  FUNCTION(fmi3FreeInstance)
#define INSTANTIATE(id, folder) \
  fmi3InstantiateCoSimulation("finger", id, folder, 0, 1, 0, 0, NULL, 0, NULL, log_message, NULL)
#define ENTER(start)             fmi3EnterInitializationMode(finger, 0, 0.0, start, 0, 0.0)
#define EXIT()                   fmi3ExitInitializationMode(finger)
#define SET(n, values)           fmi3SetFloat64(finger, (n).references, (n).count, values, (n).elements)
#define GET(n, values)           fmi3GetFloat64(finger, (n).references, (n).count, values, (n).elements)
#define GET_FLAGS(n, values)     fmi3GetBoolean(finger, (n).references, (n).count, values, (n).elements)
#define STEP(from, length)       fmi3DoStep(finger, from, length, 1, &event, &terminate, &early, &reached)
#define REACHED(time, discarded) (reached == (time) && !event && !terminate && !early)
#define FREE()                   fmi3FreeInstance(finger)
#endif

int main(int count, char** arguments) {
  expect(count == 5, "expected LIBRARY, IDENTIFIER, RESOURCES and SAMPLES");
  void* library = OPEN(arguments[1]);
  FILE* file = fopen(arguments[4], "r");
  expect(library && file, "the library or the file of samples cannot be opened");
  FUNCTIONS;

  void* finger = INSTANTIATE(arguments[2], arguments[3]);
  expect(finger != NULL, "instantiation");
  const numbers inputs = read_references(file), outputs = read_references(file), flags = read_references(file);
  const unsigned samples = (unsigned)read_bits(file);
  double time = 0.0, values[MOST], held[MOST], sound[MOST];
  flag states[MOST];
  for (unsigned k = 0; k < samples; ++k) {
    const double before = time;
    read_doubles(file, &time, 1);
    read_doubles(file, values, inputs.elements);
    if (k == 0) { /* initialisation takes the first sample, the step that ends at the second one changes nothing */
      expect(!ENTER(time) && !SET(inputs, values) && !EXIT(), "initialisation");
      memcpy(sound, values, sizeof sound);
    } else {
      int status = STEP(before, time - before);
      if (status == 2) {
        expect(REACHED(before, 1) && !SET(inputs, sound), "a discarded step");
        status = STEP(before, time - before);
      } else {
        memcpy(sound, held, sizeof sound);
      }
      expect(!status && REACHED(before + (time - before), 0) && !SET(inputs, values), "step");
    }
    memcpy(held, values, sizeof held);
    expect(!GET(outputs, values) && !GET_FLAGS(flags, states), "outputs");
    print_doubles(values, outputs.elements);
    for (unsigned i = 0; i < flags.elements; ++i) {
      printf("%d ", (int)states[i]);
    }
    printf("\n");
  }
  FREE();
  fclose(file);
  return 0;
}
