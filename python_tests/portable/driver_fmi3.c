/* Runs the shared library of an FMU of FMI 3.0 over a sequence of samples and prints the outputs as bits of doubles, as
 * driver.c does for FMI 2.0.
 *
 *   driver_fmi3 LIBRARY TOKEN RESOURCES SAMPLES      RESOURCES: path; SAMPLES: text file, numbers in hexadecimal
 *
 * Compiled with FMI3_FUNCTION_PREFIX it is linked with the FMU of that prefix, and LIBRARY is not looked at.
 *
 * The file of samples:
 *
 *   inputs count, for each its value reference and its number of elements; the same of Float64 and of Boolean outputs;
 *   samples count; per sample: time, inputs (bits of doubles) */
#include "fmi3Functions.h"

#ifdef FMI3_FUNCTION_PREFIX
#define LINKED
#endif
#include "driver.h"

typedef struct numbers {
  fmi3ValueReference references[MOST];
  unsigned count, elements;
} numbers;

static numbers read_references(FILE* file) {
  numbers n;
  n.count = read_count(file);
  n.elements = 0;
  for (unsigned i = 0; i < n.count; ++i) {
    n.references[i] = (fmi3ValueReference)read_bits(file);
    n.elements += (unsigned)read_bits(file);
  }
  if (n.elements > MOST) {
    fail("too many elements");
  }
  return n;
}

static void print_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                          fmi3String text) {
  (void)environment;
  fprintf(stderr, "driver: status %d, %s: %s\n", (int)status, category, text);
}

int main(int count, char** arguments) {
  FILE* file;
  void* library = begin(count, arguments, &file);
  FUNCTION(fmi3InstantiateCoSimulation);
  FUNCTION(fmi3EnterInitializationMode);
  FUNCTION(fmi3ExitInitializationMode);
  FUNCTION(fmi3SetFloat64);
  FUNCTION(fmi3GetFloat64);
  FUNCTION(fmi3GetBoolean);
  FUNCTION(fmi3DoStep);
  FUNCTION(fmi3FreeInstance);

  fmi3Instance finger = fmi3InstantiateCoSimulation("finger", arguments[2], arguments[3], fmi3False, fmi3True,
                                                    fmi3False, fmi3False, NULL, 0, NULL, print_message, NULL);
  if (!finger) {
    fail("fmi3InstantiateCoSimulation");
  }
  const numbers inputs = read_references(file), outputs = read_references(file), flags = read_references(file);
  const unsigned samples = (unsigned)read_bits(file);
  double time = 0.0, values[MOST];
  fmi3Boolean states[MOST];
  for (unsigned k = 0; k < samples; ++k) {
    const double before = time;
    read_doubles(file, &time, 1);
    read_doubles(file, values, inputs.elements);
    if (k == 0) { /* initialisation takes the first sample, the step that ends at the second one changes nothing */
      expect(fmi3EnterInitializationMode(finger, fmi3False, 0.0, time, fmi3False, 0.0), "fmi3EnterInitializationMode");
      expect(fmi3SetFloat64(finger, inputs.references, inputs.count, values, inputs.elements), "fmi3SetFloat64");
      expect(fmi3ExitInitializationMode(finger), "fmi3ExitInitializationMode");
    } else {
      fmi3Boolean event, terminate, early;
      double reached;
      expect(fmi3DoStep(finger, before, time - before, fmi3True, &event, &terminate, &early, &reached), "fmi3DoStep");
      if (event || terminate || early || reached != before + (time - before)) {
        fail("fmi3DoStep ended otherwise than it should");
      }
      expect(fmi3SetFloat64(finger, inputs.references, inputs.count, values, inputs.elements), "fmi3SetFloat64");
    }
    expect(fmi3GetFloat64(finger, outputs.references, outputs.count, values, outputs.elements), "fmi3GetFloat64");
    expect(fmi3GetBoolean(finger, flags.references, flags.count, states, flags.elements), "fmi3GetBoolean");
    print_doubles(values, outputs.elements);
    for (unsigned i = 0; i < flags.elements; ++i) {
      printf("%d ", states[i]);
    }
    printf("\n");
  }
  fmi3FreeInstance(finger);
  fclose(file);
  return 0;
}
