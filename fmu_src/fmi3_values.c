/* FMI 3.0, reading and writing variables. Arrays are read and written whole. */
#include "fmi3Functions.h"
#include "values.h"

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues) {
  return (fmi3Status)values_get(instance, CALL_GET_REAL, VARIABLE_REAL, valueReferences, nValueReferences,
                                VALUES_DOUBLE, values, nValues);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int32 values[], size_t nValues) {
  return (fmi3Status)values_get(instance, CALL_GET_INTEGER, VARIABLE_INTEGER, valueReferences, nValueReferences,
                                VALUES_INT, values, nValues);
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Boolean values[], size_t nValues) {
  return (fmi3Status)values_get(instance, CALL_GET_BOOLEAN, VARIABLE_BOOLEAN, valueReferences, nValueReferences,
                                VALUES_BOOL, values, nValues);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues) {
  return (fmi3Status)values_set(instance, CALL_SET_REAL, VARIABLE_REAL, valueReferences, nValueReferences,
                                VALUES_DOUBLE, values, nValues);
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int32 values[], size_t nValues) {
  return (fmi3Status)values_set(instance, CALL_SET_INTEGER, VARIABLE_INTEGER, valueReferences, nValueReferences,
                                VALUES_INT, values, nValues);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Boolean values[], size_t nValues) {
  return (fmi3Status)values_set(instance, CALL_SET_BOOLEAN, VARIABLE_BOOLEAN, valueReferences, nValueReferences,
                                VALUES_BOOL, values, nValues);
}
