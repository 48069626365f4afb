/* FMI 3.0, reading and writing variables. Arrays are read and written whole. */
#include "fmi3Functions.h"
#include "refused_call.h"
#include "values.h"

#define ACCESS(type, CODE, FORMAT)                                                                                \
  fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           fmi3##type values[], size_t value_count) {                                             \
    return (fmi3Status)values_get(instance, CALL_GET_##CODE, VARIABLE_##CODE, references, count, VALUES_##FORMAT, \
                                  values, value_count);                                                           \
  }                                                                                                               \
  fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           const fmi3##type values[], size_t value_count) {                                       \
    return (fmi3Status)values_set(instance, CALL_SET_##CODE, VARIABLE_##CODE, references, count, VALUES_##FORMAT, \
                                  values, value_count);                                                           \
  }

ACCESS(Float64, REAL, DOUBLE)
ACCESS(Int32, INTEGER, INT)
ACCESS(Boolean, BOOLEAN, BOOL)

/* --- types that no variable has ----------------------------------------------------------------------------------- */

#define REFUSE_TYPE(CODE, type)                                                                        \
  fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                           fmi3##type values[], size_t value_count) {                                  \
    return (fmi3Status)values_refuse(instance, CALL_GET_##CODE, #type, references, count, values);     \
  }                                                                                                    \
  fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                           const fmi3##type values[], size_t value_count) {                            \
    return (fmi3Status)values_refuse(instance, CALL_SET_##CODE, #type, references, count, values);     \
  }

OTHER_TYPES(REFUSE_TYPE)
REFUSE_TYPE(STRING, String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t value_count) {
  return (fmi3Status)values_refuse(instance, CALL_GET_BINARY, "Binary", references, count, values);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                         const size_t sizes[], const fmi3Binary values[], size_t value_count) {
  return (fmi3Status)values_refuse(instance, CALL_SET_BINARY, "Binary", references, count, values);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        fmi3Clock values[]) {
  return (fmi3Status)values_refuse(instance, CALL_GET_CLOCK, "Clock", references, count, values);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        const fmi3Clock values[]) {
  return (fmi3Status)values_refuse(instance, CALL_SET_CLOCK, "Clock", references, count, values);
}
