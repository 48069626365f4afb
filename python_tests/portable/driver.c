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
#include "fmi2Functions.h"

#ifdef FMI2_FUNCTION_PREFIX
#define LINKED
#endif
#include "driver.h"

typedef struct numbers {
  fmi2ValueReference references[MOST];
  unsigned count;
} numbers;

static numbers read_references(FILE* file) {
  numbers n;
  n.count = read_count(file);
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
  FILE* file;
  void* library = begin(count, arguments, &file);
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
    read_doubles(file, &time, 1);
    read_doubles(file, values, inputs.count);
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
    print_doubles(values, outputs.count);
    for (unsigned i = 0; i < flags.count; ++i) {
      printf("%d ", states[i]);
    }
    printf("\n");
  }
  fmi2FreeInstance(finger);
  fclose(file);
  return 0;
}
