#include "values.h"

#include "variable_access.h"

/* --- elements of arrays of the importer --------------------------------------------------------------------------- */

static double element(const void* values, value_format format, size_t at) {
  switch (format) {
    case VALUES_INT: return ((const int*)values)[at];
    case VALUES_BOOL: return ((const _Bool*)values)[at];
    default: return ((const double*)values)[at];
  }
}

static void put_element(void* values, value_format format, size_t at, double value) {
  switch (format) {
    case VALUES_INT: ((int*)values)[at] = (int)value; break;
    case VALUES_BOOL: ((_Bool*)values)[at] = value != 0.0; break;
    default: ((double*)values)[at] = value; break;
  }
}

/* the same as a value of a variable: every number but 0 is true */
static double given_value(const void* values, value_format format, size_t at, variable_type type) {
  const double value = element(values, format, at);
  return type == VARIABLE_BOOLEAN ? value != 0.0 : value;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* In initialisation mode outputs follow the inputs; before it there are none. */
static int update_outputs(component* c, fmu_function function, const variable* found) {
  if (variable_causality_of(found) != CAUSALITY_OUTPUT) {
    return 0;
  }
  if (!c->failed && c->phase == PHASE_INSTANTIATED) {
    fail_at(c, function, found, "an output has no value before the initialisation mode");
    return -1;
  }
  if (component_update_outputs(c)) {
    component_fail_because(c, call_name(function), model_last_error(c->model));
    return -1;
  }
  return 0;
}

static double value_of(const component* c, const variable* found) {
  const int is_flag = variable_type_of(found) == VARIABLE_BOOLEAN && variable_causality_of(found) == CAUSALITY_OUTPUT;
  return is_flag ? (double)c->values.flag[found->id][found->index] : *variables_number(&c->values, found);
}

fmu_status values_get(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, void* values, size_t value_count) {
  variable found = {0};
  size_t at = 0;
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  for (size_t i = 0; i < count; ++i) {
    if (is_time(references[i], type)) {
      put_element(values, format, at++, c->end_of_step);
      continue;
    }
    if (find_of_type(c, function, type, references[i], &found) || update_outputs(c, function, &found)) {
      return FMU_ERROR;
    }
    const size_t extent = variables_extent(&c->values, &found);
    for (size_t k = 0; k < extent; ++k) {
      const variable one = variables_element(&found, k);
      put_element(values, format, at++, value_of(c, &one));
    }
  }
  return FMU_OK;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static int refuse_fixed(component* c, fmu_function function, const variable* found) {
  log_text reason;
  reason.length = 0;
  log_append(&reason, "a fixed parameter is written before ");
  log_append(&reason, call_name(CALL_EXIT_INITIALIZATION_MODE));
  log_append(&reason, " only");
  fail_at(c, function, found, reason.bytes);
  return -1;
}

/* 0 when the variable may be written now, whatever the value */
static int check_writable(component* c, fmu_function function, const variable* found) {
  switch (variable_causality_of(found)) {
    case CAUSALITY_INPUT: return 0;
    case CAUSALITY_OUTPUT: fail_at(c, function, found, "an output is not written"); return -1;
    default: break;
  }
  const int is_fixed = found->group || !model_parameter_range(c->model, found->index).tunable;
  return c->phase == PHASE_STEP_COMPLETE && is_fixed ? refuse_fixed(c, function, found) : 0;
}

/* 0 when the variable may have the value */
static int check_value(component* c, fmu_function function, const variable* one, double value) {
  if (variables_accept(c->model, one, value)) {
    return 0;
  }
  log_text text = log_start(call_name(function), "");
  variables_append_refusal(&text, c->model, one, value);
  component_fail(c, &text);
  return -1;
}

/* A value that check_value() took. */
static void take_value(component* c, const variable* one, double value) {
  *variables_number(&c->values, one) = value;
  if (!one->group) {
    c->values.parameters_pending = 1;
  } else if (one->group->causality == CAUSALITY_PARAMETER) {
    model_set_setting(c->model, one->id, one->index, value);
  }
  c->outputs_pending = 1;
}

fmu_status values_set(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, const void* values, size_t value_count) {
  variable found = {0};
  size_t at = 0;
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  for (size_t i = 0; i < count; ++i) { /* all or none */
    if (is_time(references[i], type)) {
      return component_fail_because(c, call_name(function), "time: the independent variable is not written");
    }
    if (find_of_type(c, function, type, references[i], &found) || check_writable(c, function, &found)) {
      return FMU_ERROR;
    }
    const size_t extent = variables_extent(&c->values, &found);
    for (size_t k = 0; k < extent; ++k) {
      const variable one = variables_element(&found, k);
      if (check_value(c, function, &one, given_value(values, format, at++, type))) {
        return FMU_ERROR;
      }
    }
  }
  at = 0;
  for (size_t i = 0; i < count; ++i) {
    variables_find(&c->values, references[i], &found);
    const size_t extent = variables_extent(&c->values, &found);
    for (size_t k = 0; k < extent; ++k) {
      const variable one = variables_element(&found, k);
      take_value(c, &one, given_value(values, format, at++, type));
    }
  }
  return FMU_OK;
}

fmu_status values_refuse(component* c, fmu_function function, const char* type, const unsigned references[],
                         size_t count, const void* values) {
  variable found = {0};
  if (!may_access(c, function, count, references, values)) {
    return FMU_ERROR;
  }
  return count ? fail_of_type(c, function, references[0], type, &found) : FMU_OK;
}
