#include "component.h"

#include <stdlib.h>
#include <string.h>

static char* copy_text(const char* text) {
  const size_t bytes = strlen(text) + 1;
  char* copy = malloc(bytes);
  return copy ? memcpy(copy, text, bytes) : NULL;
}

component* component_create(const log_target* log, tendonfmu_finger* finger) {
  component* c = calloc(1, sizeof *c);
  if (!c) {
    tendonfmu_destroy(finger);
    return NULL;
  }
  c->finger = finger;
  c->log = *log;
  c->instance_name = copy_text(log->instance_name);
  c->log.instance_name = c->instance_name;
  c->state_size = tendonfmu_state_size(finger);
  c->scratch = malloc(c->state_size);
  const int failed = variables_create(&c->values, finger);
  c->changed_indices = malloc((c->values.parameter_count + 1) * sizeof *c->changed_indices);
  c->changed_values = malloc((c->values.parameter_count + 1) * sizeof *c->changed_values);
  c->derivatives = calloc(c->values.input_count + c->values.output_count, sizeof *c->derivatives);
  if (failed || !c->instance_name || !c->scratch || !c->changed_indices || !c->changed_values || !c->derivatives) {
    component_destroy(c);
    return NULL;
  }
  return c;
}

void component_destroy(component* c) {
  tendonfmu_destroy(c->finger);
  variables_destroy(&c->values);
  free(c->instance_name);
  free(c->scratch);
  free(c->changed_indices);
  free(c->changed_values);
  free(c->derivatives);
  free(c);
}

void component_reset(component* c) {
  tendonfmu_reset(c->finger);
  variables_start(&c->values, c->finger);
  c->phase = PHASE_INSTANTIATED;
  c->failed = c->parameters_pending = c->outputs_pending = c->stop_time_defined = 0;
  c->start_time = c->stop_time = c->end_of_step = 0.0;
}

int component_may_call(component* c, fmu_function function) {
  if (!c) {
    return 0;
  }
  const fmu_phase now = c->failed ? PHASE_ERROR : c->phase;
  if (call_is_allowed(function, now)) {
    return 1;
  }
  log_text text = log_start(call_name(function), "not allowed in state ");
  log_append(&text, phase_name(now));
  const char* separator = ", expected ";
  for (int phase = 0; phase <= PHASE_ERROR; ++phase) {
    if (call_is_allowed(function, (fmu_phase)phase)) {
      log_append(&text, separator);
      log_append(&text, phase_name((fmu_phase)phase));
      separator = " or ";
    }
  }
  component_fail(c, &text);
  return 0;
}

fmi2Status component_fail(component* c, const log_text* text) {
  c->failed = 1;
  log_send(&c->log, fmi2Error, LOG_STATUS_ERROR, text);
  return fmi2Error;
}

fmi2Status component_fail_because(component* c, const char* function, const char* reason) {
  const log_text text = log_start(function, reason);
  return component_fail(c, &text);
}

/* Hands the finger, in one batch, the parameters that differ from its own: relations between them (static >= coulomb)
 * then hold or not for all together, whatever order they were written in. */
static int hand_over_parameters(component* c) {
  size_t changed = 0;
  tendonfmu_get_parameters(c->finger, c->values.parameter_count, NULL, c->changed_values);
  for (size_t i = 0; i < c->values.parameter_count; ++i) {
    if (c->values.parameters[i] != c->changed_values[i]) {
      c->changed_indices[changed] = i;
      c->changed_values[changed++] = c->values.parameters[i];
    }
  }
  if (!changed) {
    return 0;
  }
  return tendonfmu_set_parameters(c->finger, changed, c->changed_indices, c->changed_values) == TENDONFMU_OK ? 0 : -1;
}

static int advance(component* c, double time) {
  const tendonfmu_inputs inputs = variables_inputs(&c->values);
  if (c->parameters_pending && hand_over_parameters(c)) {
    return -1;
  }
  return (tendonfmu_is_initialised(c->finger) ? tendonfmu_step(c->finger, time, &inputs)
                                              : tendonfmu_initialise(c->finger, time, &inputs)) == TENDONFMU_OK
             ? 0
             : -1;
}

int component_take_sample(component* c, double time) {
  if (tendonfmu_is_initialised(c->finger) && time == tendonfmu_get_time(c->finger)) {
    return 0; /* taken already: nothing changes, and parameters wait for the next sample */
  }
  if (c->parameters_pending) {
    tendonfmu_save_state(c->finger, c->scratch, c->state_size);
  }
  if (advance(c, time)) {
    if (c->parameters_pending) { /* they are not to stay with a finger that refused the sample */
      tendonfmu_restore_state(c->finger, c->scratch, c->state_size);
    }
    return -1;
  }
  c->parameters_pending = c->outputs_pending = 0;
  component_fetch_outputs(c);
  return 0;
}

int component_begin_trial(component* c) {
  tendonfmu_save_state(c->finger, c->scratch, c->state_size);
  if (advance(c, c->start_time)) {
    component_end_trial(c);
    return -1;
  }
  return 0;
}

void component_end_trial(component* c) {
  tendonfmu_restore_state(c->finger, c->scratch, c->state_size);
}

void component_fetch_outputs(component* c) {
  const tendonfmu_outputs outputs = variables_outputs(&c->values);
  tendonfmu_get_outputs(c->finger, &outputs);
}
