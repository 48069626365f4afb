#include "variable_access.h"

fmu_status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  return component_fail(c, call_name(function), "%s: %s", variables_name(c->model, found).bytes, reason);
}

fmu_status fail_of_type(component* c, fmu_function function, unsigned reference, const char* type, variable* found) {
  log_text name = log_line("time");
  variable_type of_name = VARIABLE_REAL;
  if (variables_find(&c->values, reference, found) == 0) {
    name = variables_name(c->model, found);
    of_name = variable_type_of(found);
  } else if (!is_time(reference, VARIABLE_REAL)) {
    return component_fail(c, call_name(function), "no variable has the value reference %zu", (size_t)reference);
  }
  return component_fail(c, call_name(function), "%s is of type %s, expected %s", name.bytes, this_fmi.types[of_name],
                        type);
}

int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (count && (!references || !values)) {
    component_fail(c, call_name(function), "%s is NULL", references ? this_fmi.values : this_fmi.references);
    return 0;
  }
  return 1;
}

fmu_status check_value_count(component* c, fmu_function function, variable_type type, const unsigned references[],
                             size_t count, size_t value_count, const char* argument) {
  variable found = {0};
  size_t expected = this_fmi.arrays ? 0 : count;
  for (size_t i = 0; this_fmi.arrays && i < count; ++i) {
    if (is_time(references[i], type)) {
      ++expected;
    } else if (find_of_type(c, function, type, references[i], &found)) {
      return FMU_ERROR;
    } else {
      expected += variables_extent(&c->values, &found);
    }
  }
  return expected == value_count
             ? FMU_OK
             : component_fail(c, call_name(function), "%s = %zu: expected %zu, the elements of all variables together",
                              argument, value_count, expected);
}
