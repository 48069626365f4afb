#include "variable_access.h"

fmi2Status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  log_text text = log_start(call_name(function), "");
  variables_append_name(&text, c->model, found);
  log_append(&text, ": ");
  log_append(&text, reason);
  return component_fail(c, &text);
}

int find_of_type(component* c, fmu_function function, variable_type type, fmi2ValueReference reference,
                 variable* found) {
  if (variables_find(&c->values, reference, found)) {
    log_text text = log_start(call_name(function), "no variable has the value reference ");
    log_append_count(&text, reference);
    component_fail(c, &text);
    return -1;
  }
  if (variable_type_of(found) == type) {
    return 0;
  }
  log_text text = log_start(call_name(function), "");
  variables_append_name(&text, c->model, found);
  log_append(&text, " is of type ");
  log_append(&text, variable_type_name(variable_type_of(found)));
  log_append(&text, ", expected ");
  log_append(&text, variable_type_name(type));
  component_fail(c, &text);
  return -1;
}

int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (count && (!references || !values)) {
    component_fail_because(c, call_name(function), references ? "value is NULL" : "vr is NULL");
    return 0;
  }
  return 1;
}
