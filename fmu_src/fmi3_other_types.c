/* FMI 3.0, types that no variable has. */
#include "fmi3Functions.h"
#include "values.h"

fmi3Status fmi3GetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float32 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_FLOAT32, "Float32", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                       fmi3Int8 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_INT8, "Int8", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3UInt8 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_UINT8, "UInt8", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int16 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_INT16, "Int16", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt16 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_UINT16, "UInt16", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt32 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_UINT32, "UInt32", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int64 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_INT64, "Int64", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt64 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_UINT64, "UInt64", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3String values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_STRING, "String", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues) {
  (void)valueSizes, (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_GET_BINARY, "Binary", valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[]) {
  return (fmi3Status)values_refuse(instance, CALL_GET_CLOCK, "Clock", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float32 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_FLOAT32, "Float32", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                       const fmi3Int8 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_INT8, "Int8", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3UInt8 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_UINT8, "UInt8", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int16 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_INT16, "Int16", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const fmi3UInt16 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_UINT16, "UInt16", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const fmi3UInt32 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_UINT32, "UInt32", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int64 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_INT64, "Int64", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const fmi3UInt64 values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_UINT64, "UInt64", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const fmi3String values[], size_t nValues) {
  (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_STRING, "String", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues) {
  (void)valueSizes, (void)nValues;
  return (fmi3Status)values_refuse(instance, CALL_SET_BINARY, "Binary", valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[]) {
  return (fmi3Status)values_refuse(instance, CALL_SET_CLOCK, "Clock", valueReferences, nValueReferences, values);
}
