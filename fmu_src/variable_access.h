/* What all calls that read, write or derive variables have in common: finding them, and saying what is wrong with one.
 */
#ifndef TENDONFMU_VARIABLE_ACCESS_H
#define TENDONFMU_VARIABLE_ACCESS_H

#include "component.h"

/* 1 when the call is allowed and has its pointers; otherwise logs and fails. */
int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values);

/* 0 for a variable of the type; otherwise says what it is, or that there is none, and fails. */
int find_of_type(component* c, fmu_function function, variable_type type, fmi2ValueReference reference,
                 variable* found);

/* Fails with "<function>: <variable>: <reason>". */
fmi2Status fail_at(component* c, fmu_function function, const variable* found, const char* reason);

#endif
