#include "component.h"

#include <stdlib.h>
#include <string.h>

static char* copy_text(const char* text) {
  const size_t bytes = strlen(text) + 1;
  char* copy = malloc(bytes);
  return copy ? memcpy(copy, text, bytes) : NULL;
}

component* component_create(const log_target* log, model* m, uint64_t identity) {
  component* c = calloc(1, sizeof *c);
  if (!c) {
    model_destroy(m);
    return NULL;
  }
  c->model = m;
  c->identity = identity;
  c->log = *log;
  c->instance_name = copy_text(log->instance_name);
  c->log.instance_name = c->instance_name;
  c->waiting = 1;
  if (variables_create(&c->values, m, this_fmi.arrays) || !c->instance_name) {
    component_destroy(c);
    return NULL;
  }
  return c;
}

void component_destroy(component* c) {
  model_destroy(c->model);
  variables_destroy(&c->values);
  free(c->instance_name);
  free(c);
}

void component_reset(component* c) {
  model_reset(c->model);
  variables_start(&c->values, c->model);
  c->phase = PHASE_INSTANTIATED;
  c->failed = c->inputs_given = c->outputs_pending = c->stop_time_defined = 0;
  c->start_time = c->stop_time = c->end_of_step = 0.0;
  c->waiting = 1;
  component_forget_steps(c);
}

void component_forget_steps(component* c) {
  c->step_status = FMU_OK;
  c->refusals = 0;
}

int component_refuse_call(component* c, fmu_function function) {
  log_text expected = {.bytes = ""};
  for (int phase = 0; phase <= PHASE_ERROR; ++phase) {
    if (call_is_allowed(function, (fmu_phase)phase)) {
      log_append(&expected, "%s%s", *expected.bytes ? " or " : ", expected ", this_fmi.phases[phase]);
    }
  }
  const char* present = this_fmi.phases[c->failed ? PHASE_ERROR : c->phase];
  component_fail(c, call_name(function), "not allowed in state %s%s", present, expected.bytes);
  return 0;
}

fmu_status component_fail(component* c, const char* function, const char* format, ...) {
  log_text text = log_line("%s: ", function);
  va_list arguments;
  va_start(arguments, format);
  log_append_list(&text, format, arguments);
  va_end(arguments);
  c->failed = 1;
  return log_send(&c->log, FMU_ERROR, LOG_STATUS_ERROR, &text);
}

fmu_status component_fail_as_model(component* c, fmu_function function) {
  return component_fail(c, call_name(function), "%s", model_last_error(c->model));
}

fmu_status component_begin_trial(component* c, fmu_function function) {
  const model_answer answer = model_begin_trial(c->model, &c->values, c->start_time);
  if (answer == MODEL_FAILED) {
    return component_fail_as_model(c, function);
  }
  if (answer == MODEL_BAD_INPUTS) {
    return component_warn(c, function, "; outputs are 0 with such inputs");
  }
  return FMU_OK;
}

fmu_status component_warn(component* c, fmu_function function, const char* consequence) {
  const log_text text = log_line("%s: %s%s", call_name(function), model_last_error(c->model), consequence);
  return log_send(&c->log, FMU_WARNING, LOG_STATUS_WARNING, &text);
}

fmu_status component_update_outputs(component* c, fmu_function function) {
  if (!c->outputs_pending || c->failed) {
    return FMU_OK;
  }
  const fmu_status status = component_begin_trial(c, function);
  if (status == FMU_OK) {
    model_fetch_outputs(c->model, &c->values);
    model_end_trial(c->model);
    c->outputs_pending = 0;
  } else if (status == FMU_WARNING) {
    variables_clear_outputs(&c->values);
  }
  return status;
}
