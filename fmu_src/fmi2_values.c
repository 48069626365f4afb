/* FMI 2.0, reading and writing variables. */
#include "fmi2Functions.h"
#include "values.h"

/* fmi2Integer and fmi2Boolean are int, and a value reference is one number. */

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  return (fmi2Status)values_get(instance, CALL_GET_REAL, VARIABLE_REAL, vr, nvr, VALUES_DOUBLE, value, nvr);
}

fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
  return (fmi2Status)values_get(instance, CALL_GET_INTEGER, VARIABLE_INTEGER, vr, nvr, VALUES_INT, value, nvr);
}

fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
  return (fmi2Status)values_get(instance, CALL_GET_BOOLEAN, VARIABLE_BOOLEAN, vr, nvr, VALUES_INT, value, nvr);
}

fmi2Status fmi2GetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
  return (fmi2Status)values_refuse(instance, CALL_GET_STRING, "String", vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  return (fmi2Status)values_set(instance, CALL_SET_REAL, VARIABLE_REAL, vr, nvr, VALUES_DOUBLE, value, nvr);
}

fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  return (fmi2Status)values_set(instance, CALL_SET_INTEGER, VARIABLE_INTEGER, vr, nvr, VALUES_INT, value, nvr);
}

fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  return (fmi2Status)values_set(instance, CALL_SET_BOOLEAN, VARIABLE_BOOLEAN, vr, nvr, VALUES_INT, value, nvr);
}

fmi2Status fmi2SetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
  return (fmi2Status)values_refuse(instance, CALL_SET_STRING, "String", vr, nvr, value);
}
