#include "variable_access.h"

fmu_status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  log_text text = log_start(call_name(function), "");
  variables_append_name(&text, c->model, found);
  log_append(&text, ": ");
  log_append(&text, reason);
  return component_fail(c, &text);
}

fmu_status fail_of_type(component* c, fmu_function function, unsigned reference, const char* type, variable* found) {
  log_text text = log_start(call_name(function), "");
  const int is_known = variables_find(&c->values, reference, found) == 0;
  if (is_known) {
    variables_append_name(&text, c->model, found);
  } else if (is_time(reference, VARIABLE_REAL)) {
    log_append(&text, "time");
  } else {
    log_append(&text, "no variable has the value reference ");
    log_append_count(&text, reference);
    return component_fail(c, &text);
  }
  log_append(&text, " is of type ");
  log_append(&text, this_fmi.types[is_known ? variable_type_of(found) : VARIABLE_REAL]);
  log_append(&text, ", expected ");
  log_append(&text, type);
  return component_fail(c, &text);
}

int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (count && (!references || !values)) {
    log_text text = log_start(call_name(function), references ? this_fmi.values : this_fmi.references);
    log_append(&text, " is NULL");
    component_fail(c, &text);
    return 0;
  }
  return 1;
}

int check_value_count(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, size_t value_count, const char* argument) {
  variable found = {0};
  size_t expected = this_fmi.arrays ? 0 : count;
  for (size_t i = 0; this_fmi.arrays && i < count; ++i) {
    if (is_time(references[i], type)) {
      ++expected;
    } else if (find_of_type(c, function, type, references[i], &found)) {
      return -1;
    } else {
      expected += variables_extent(&c->values, &found);
    }
  }
  if (expected == value_count) {
    return 0;
  }
  log_text text = log_start(call_name(function), argument);
  log_append(&text, " = ");
  log_append_count(&text, value_count);
  log_append(&text, ": expected ");
  log_append_count(&text, expected);
  log_append(&text, ", the elements of all variables together");
  component_fail(c, &text);
  return -1;
}
