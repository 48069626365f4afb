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

/* --- what derivatives need, too ----------------------------------------------------------------------------------- */

/* 1 when the call is allowed and has its pointers; otherwise logs and fails. */
int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values);

/* Fails with what the variable is instead of the type, or that there is none. */
fmu_status fail_of_type(component* c, fmu_function function, unsigned reference, const char* type, variable* found);

/* A variable of the type; otherwise says what it is, or that there is none, and fails. */
static inline fmu_status find_of_type(component* c, fmu_function function, variable_type type, unsigned reference,
                                      variable* found) {
  return variables_find(&c->values, reference, found) == 0 && variable_type_of(found) == type
             ? FMU_OK
             : fail_of_type(c, function, reference, this_fmi.types[type], found);
}

/* Whether the variables of a type have value_count elements together; otherwise says how many `argument` should have,
 * or what is wrong with a variable, and fails. */
fmu_status check_value_count(component* c, fmu_function function, variable_type type, const unsigned references[],
                             size_t count, size_t value_count, const char* argument);

/* Fails with "<function>: <variable>: <reason>". */
fmu_status fail_at(component* c, fmu_function function, const variable* found, const char* reason);
