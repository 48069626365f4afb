/* FMI 2.0, reading and writing variables, and their directional derivatives. */
#include <math.h>
#include <string.h>

#include "component.h"
#include "fmi2Functions.h"

/* --- finding variables -------------------------------------------------------------------------------------------- */

static fmi2Status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  log_text text = log_start(call_name(function), "");
  variables_append_name(&text, c->finger, found);
  log_append(&text, ": ");
  log_append(&text, reason);
  return component_fail(c, &text);
}

/* Finds a variable of a type; otherwise says what it is, or that there is none. */
static int find_of_type(component* c, fmu_function function, variable_type type, fmi2ValueReference reference,
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
  variables_append_name(&text, c->finger, found);
  log_append(&text, " is of type ");
  log_append(&text, variable_type_name(variable_type_of(found)));
  log_append(&text, ", expected ");
  log_append(&text, variable_type_name(type));
  component_fail(c, &text);
  return -1;
}

/* Common part of all calls below: state and pointers. */
static int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (count && (!references || !values)) {
    component_fail_because(c, call_name(function), references ? "value is NULL" : "vr is NULL");
    return 0;
  }
  return 1;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* In initialisation mode outputs follow the inputs: the first sample is taken for the time being. */
static int update_outputs(component* c, fmu_function function, const variable* found) {
  if (!c->outputs_pending || c->failed || c->phase != PHASE_INITIALISATION ||
      variable_causality_of(found) != CAUSALITY_OUTPUT) {
    return 0;
  }
  if (component_begin_trial(c)) {
    component_fail_because(c, call_name(function), tendonfmu_last_error(c->finger));
    return -1;
  }
  component_fetch_outputs(c);
  component_end_trial(c);
  c->outputs_pending = 0;
  return 0;
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
    value[i] = *variables_real(&c->values, &found);
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
    if (find_of_type(c, CALL_GET_INTEGER, VARIABLE_INTEGER, vr[i], &found)) {
      return fmi2Error;
    }
    value[i] = tendonfmu_get_kinematics_source(c->finger); /* the only Integer */
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
    value[i] = c->values.flag[found.id][found.index] ? fmi2True : fmi2False;
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
  tendonfmu_parameter_info info = {0};
  switch (variable_causality_of(found)) {
    case CAUSALITY_INPUT: return 0;
    case CAUSALITY_OUTPUT: fail_at(c, function, found, "an output is not written"); return -1;
    default: break;
  }
  if (c->phase == PHASE_STEP_COMPLETE) {
    if (!found->group) {
      tendonfmu_get_parameter_info(c->finger, found->index, &info);
    }
    if (!info.tunable) {
      fail_at(c, function, found, "a fixed parameter is written before fmi2ExitInitializationMode only");
      return -1;
    }
  }
  return 0;
}

static int check_real(component* c, fmi2ValueReference reference, double value, variable* found) {
  if (find_of_type(c, CALL_SET_REAL, VARIABLE_REAL, reference, found) || check_writable(c, CALL_SET_REAL, found)) {
    return -1;
  }
  if (variables_accept(c->finger, found, value)) {
    return 0;
  }
  log_text text = log_start("fmi2SetReal", "");
  variables_append_refusal(&text, c->finger, found, value);
  component_fail(c, &text);
  return -1;
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  component* c = instance;
  variable found = {0};
  if (!may_access(c, CALL_SET_REAL, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) { /* all or none */
    if (check_real(c, vr[i], value[i], &found)) {
      return fmi2Error;
    }
  }
  for (size_t i = 0; i < nvr; ++i) {
    variables_find(&c->values, vr[i], &found);
    *variables_real(&c->values, &found) = value[i];
    c->parameters_pending |= !found.group;
  }
  c->outputs_pending = 1;
  return fmi2OK;
}

static int check_integer(component* c, fmi2ValueReference reference, int value) {
  variable found = {0};
  if (find_of_type(c, CALL_SET_INTEGER, VARIABLE_INTEGER, reference, &found) ||
      check_writable(c, CALL_SET_INTEGER, &found)) {
    return -1;
  }
  if (value >= found.group->minimum && value <= found.group->maximum) {
    return 0;
  }
  log_text text = log_start("fmi2SetInteger", found.group->name);
  log_append(&text, " = ");
  log_append_number(&text, value);
  log_append(&text, ": expected ");
  log_append_number(&text, found.group->minimum);
  log_append(&text, " to ");
  log_append_number(&text, found.group->maximum);
  component_fail(c, &text);
  return -1;
}

fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  component* c = instance;
  if (!may_access(c, CALL_SET_INTEGER, nvr, vr, value)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nvr; ++i) {
    if (check_integer(c, vr[i], value[i])) {
      return fmi2Error;
    }
  }
  for (size_t i = 0; i < nvr; ++i) {
    tendonfmu_set_kinematics_source(c->finger, value[i]);
  }
  c->outputs_pending = 1;
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
    if (find_of_type(c, CALL_SET_BOOLEAN, VARIABLE_BOOLEAN, vr[i], &found) ||
        check_writable(c, CALL_SET_BOOLEAN, &found)) {
      return fmi2Error;
    }
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

/* --- directional derivatives -------------------------------------------------------------------------------------- */

/* Directions of the inputs and derivatives of the outputs, laid out as the variables are: a view of c->derivatives. */
static variables lay_out(component* c) {
  variables view = c->values;
  memset(c->derivatives, 0, (view.input_count + view.output_count) * sizeof *c->derivatives);
  for (int g = 0; g < GROUP_COUNT; ++g) {
    view.flag[g] = NULL;
    view.real[g] = view.real[g] ? c->derivatives + (view.real[g] - view.numbers) : NULL;
  }
  return view;
}

/* 0 when the reference is a Real input or output, as wanted */
static int find_for_derivative(component* c, fmi2ValueReference reference, variable_causality wanted, variable* found) {
  const fmu_function function = CALL_GET_DIRECTIONAL_DERIVATIVE;
  if (find_of_type(c, function, VARIABLE_REAL, reference, found)) {
    return -1;
  }
  if (variable_causality_of(found) != wanted) {
    fail_at(c, function, found,
            wanted == CAUSALITY_INPUT ? "not a known: derivatives are by the inputs"
                                      : "not an unknown: derivatives are those of the Real outputs");
    return -1;
  }
  return 0;
}

static int read_direction(component* c, const variables* view, const fmi2ValueReference known[], size_t count,
                          const double values[]) {
  variable found = {0};
  for (size_t i = 0; i < count; ++i) {
    if (find_for_derivative(c, known[i], CAUSALITY_INPUT, &found)) {
      return -1;
    }
    if (!isfinite(values[i])) {
      fail_at(c, CALL_GET_DIRECTIONAL_DERIVATIVE, &found, "its dvKnown is not finite");
      return -1;
    }
    *variables_real(view, &found) += values[i];
  }
  return 0;
}

/* at the sample last taken, or in initialisation mode at the first one, taken for the time being */
static int derive(component* c, const variables* view) {
  const tendonfmu_inputs direction = variables_inputs(view);
  const tendonfmu_outputs derivative = variables_outputs(view);
  const int trial = !c->failed && c->phase == PHASE_INITIALISATION;
  if (trial && component_begin_trial(c)) {
    return -1;
  }
  const tendonfmu_status status = tendonfmu_get_directional_derivative(c->finger, &direction, &derivative);
  if (trial) {
    component_end_trial(c);
  }
  return status == TENDONFMU_OK ? 0 : -1;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
  const fmu_function function = CALL_GET_DIRECTIONAL_DERIVATIVE;
  component* c = instance;
  variable found = {0};
  if (!may_access(c, function, nUnknown, vUnknown_ref, dvUnknown) ||
      !may_access(c, function, nKnown, vKnown_ref, dvKnown)) {
    return fmi2Error;
  }
  const variables view = lay_out(c);
  if (read_direction(c, &view, vKnown_ref, nKnown, dvKnown)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nUnknown; ++i) {
    if (find_for_derivative(c, vUnknown_ref[i], CAUSALITY_OUTPUT, &found)) {
      return fmi2Error;
    }
  }
  if (derive(c, &view)) {
    return component_fail_because(c, call_name(function), tendonfmu_last_error(c->finger));
  }
  for (size_t i = 0; i < nUnknown; ++i) {
    variables_find(&c->values, vUnknown_ref[i], &found);
    dvUnknown[i] = *variables_real(&view, &found);
  }
  return fmi2OK;
}
