/* Reading and writing variables: what fmi2GetReal, fmi3SetFloat64 and their like do.
 *
 * The values of all variables stand one after another in `values` [value_count], the elements of an array in the order
 * of their index. A call that fails has written nothing; what it has read so far may stand in `values`. */
#pragma once

#include "component.h"

/* C type of the elements of `values`. */
typedef enum value_format { VALUES_DOUBLE, VALUES_INT, VALUES_BOOL } value_format;

fmu_status values_get(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, void* values, size_t value_count);
fmu_status values_set(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, const void* values, size_t value_count);

/* The same for a type that no variable has: says what the first one is. */
fmu_status values_refuse(component* c, fmu_function function, const char* type, const unsigned references[],
                         size_t count, const void* values);
