/* FMI 2.0, reading and writing variables. fmi2Integer and fmi2Boolean are int, and a value reference is one number. */
#include "fmi2Functions.h"
#include "values.h"

#define ACCESS(type, CODE, FORMAT)                                                                                   \
  fmi2Status fmi2Get##type(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2##type value[]) {  \
    return (fmi2Status)values_get(instance, CALL_GET_##CODE, VARIABLE_##CODE, vr, nvr, VALUES_##FORMAT, value, nvr); \
  }                                                                                                                  \
  fmi2Status fmi2Set##type(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,                        \
                           const fmi2##type value[]) {                                                               \
    return (fmi2Status)values_set(instance, CALL_SET_##CODE, VARIABLE_##CODE, vr, nvr, VALUES_##FORMAT, value, nvr); \
  }

ACCESS(Real, REAL, DOUBLE)
ACCESS(Integer, INTEGER, INT)
ACCESS(Boolean, BOOLEAN, INT)

fmi2Status fmi2GetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
  return (fmi2Status)values_refuse(instance, CALL_GET_STRING, "String", vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
  return (fmi2Status)values_refuse(instance, CALL_SET_STRING, "String", vr, nvr, value);
}
