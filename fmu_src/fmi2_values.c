/* FMI 2.0, reading and writing variables. */
#include "component.h"
#include "fmi2Functions.h"
#include "variable_access.h"

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* In initialisation mode outputs follow the inputs. */
static int update_outputs(component* c, fmu_function function, const variable* found) {
  if (variable_causality_of(found) != CAUSALITY_OUTPUT || component_update_outputs(c) == 0) {
    return 0;
  }
  component_fail_because(c, call_name(function), model_last_error(c->model));
  return -1;
}

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_GET_REAL, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (find_of_type(c, CALL_GET_REAL, VARIABLE_REAL, vr[i], &found) || update_outputs(c, CALL_GET_REAL, &found)) {
      return fmi2Error;
    }
    value[i] = *variables_number(&c->values, &found);
  }
  return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_GET_INTEGER, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (find_of_type(c, CALL_GET_INTEGER, VARIABLE_INTEGER, vr[i], &found) ||
        update_outputs(c, CALL_GET_INTEGER, &found)) {
      return fmi2Error;
    }
    value[i] = (fmi2Integer)*variables_number(&c->values, &found);
  }
  return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_GET_BOOLEAN, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (find_of_type(c, CALL_GET_BOOLEAN, VARIABLE_BOOLEAN, vr[i], &found) ||
        update_outputs(c, CALL_GET_BOOLEAN, &found)) {
      return fmi2Error;
    }
    const int is_true = variable_causality_of(&found) == CAUSALITY_OUTPUT
                            ? c->values.flag[found.id][found.index]
                            : *variables_number(&c->values, &found) != 0.0;
    value[i] = is_true ? fmi2True : fmi2False;
  }
  return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
  variable found = {0};
  if (!may_access(instance, CALL_GET_STRING, nvr, vr, value)) {
    return fmi2Error;
  }
  /* there is no variable of type String: says so of the first */
  return nvr && find_of_type(instance, CALL_GET_STRING, VARIABLE_STRING, vr[0], &found) ? fmi2Error : fmi2OK;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* 0 when the variable may be written now, whatever the value */
static int check_writable(component* c, fmu_function function, const variable* found) {
  switch (variable_causality_of(found)) {
    case CAUSALITY_INPUT: return 0;
    case CAUSALITY_OUTPUT: fail_at(c, function, found, "an output is not written"); return -1;
    default: break;
  }
  if (c->phase == PHASE_STEP_COMPLETE && (found->group || !model_parameter_range(c->model, found->index).tunable)) {
    fail_at(c, function, found, "a fixed parameter is written before fmi2ExitInitializationMode only");
    return -1;
  }
  return 0;
}

/* 0 for a variable of the type that may be written and have the value */
static int check_value(component* c, fmu_function function, variable_type type, fmi2ValueReference reference,
                       double value, variable* found) {
  if (find_of_type(c, function, type, reference, found) || check_writable(c, function, found)) {
    return -1;
  }
  if (variables_accept(c->model, found, value)) {
    return 0;
  }
  log_text text = log_start(call_name(function), "");
  variables_append_refusal(&text, c->model, found, value);
  component_fail(c, &text);
  return -1;
}

/* A value that check_value() took. */
static void take_value(component* c, fmi2ValueReference reference, double value, variable* found) {
  variables_find(&c->values, reference, found);
  *variables_number(&c->values, found) = value;
  if (!found->group) {
    c->values.parameters_pending = 1;
  } else if (found->group->causality == CAUSALITY_PARAMETER) {
    model_set_setting(c->model, found->id, found->index, value);
  }
  c->outputs_pending = 1;
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_SET_REAL, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) { /* all or none */
    if (check_value(c, CALL_SET_REAL, VARIABLE_REAL, vr[i], value[i], &found)) {
      return fmi2Error;
    }
  }
  for (size_t i = 0; i < nvr; ++i) {
    take_value(c, vr[i], value[i], &found);
  }
  return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_SET_INTEGER, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (check_value(c, CALL_SET_INTEGER, VARIABLE_INTEGER, vr[i], value[i], &found)) {
      return fmi2Error;
    }
  }
  for (size_t i = 0; i < nvr; ++i) {
    take_value(c, vr[i], value[i], &found);
  }
  return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_SET_BOOLEAN, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (check_value(c, CALL_SET_BOOLEAN, VARIABLE_BOOLEAN, vr[i], value[i] != fmi2False, &found)) {
      return fmi2Error;
    }
  }
  for (size_t i = 0; i < nvr; ++i) {
    take_value(c, vr[i], value[i] != fmi2False, &found);
  }
  return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
  variable found = {0};
  if (!may_access(instance, CALL_SET_STRING, nvr, vr, value)) {
    return fmi2Error;
  }
  return nvr && find_of_type(instance, CALL_SET_STRING, VARIABLE_STRING, vr[0], &found) ? fmi2Error : fmi2OK;
}
