#include "component.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "resource.h"
#include "states.h"

static char* copy_text(const char* text) {
  const size_t bytes = strlen(text) + 1;
  char* copy = malloc(bytes);
  return copy ? memcpy(copy, text, bytes) : NULL;
}

/* Takes over the model and a copy of the name; identity: component_identity(). NULL when memory is out; the model is
 * then destroyed. */
static component* component_create(const log_target* log, model* m, uint64_t identity) {
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

/* Back to what component_create() gave; logging stays as it is set. */
static void component_reset(component* c) {
  model_reset(c->model);
  variables_start(&c->values, c->model);
  c->phase = PHASE_INSTANTIATED;
  c->failed = c->inputs_given = c->outputs_pending = c->stop_time_defined = 0;
  c->start_time = c->stop_time = *c->values.time = 0.0;
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

/* Logs "<function>: <why the model refused the inputs><consequence>" and returns FMU_WARNING. */
static fmu_status component_warn(component* c, fmu_function function, const char* consequence) {
  const log_text text = log_line("%s: %s%s", call_name(function), model_last_error(c->model), consequence);
  return log_send(&c->log, FMU_WARNING, LOG_STATUS_WARNING, &text);
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

static void log_event(const component* c, fmu_function function, const char* event, const char* more) {
  const log_text text = log_line("%s: %s%s", call_name(function), event, more);
  log_send(&c->log, FMU_OK, LOG_EVENTS, &text);
}

/* --- creation ----------------------------------------------------------------------------------------------------- */

component* life_refuse(const log_target* log, const char* format, ...) {
  log_text text = log_line("%s: ", this_fmi.instantiate);
  va_list arguments;
  va_start(arguments, format);
  log_append_list(&text, format, arguments);
  va_end(arguments);
  log_send(log, FMU_ERROR, LOG_STATUS_ERROR, &text);
  return NULL;
}

/* the model of the resource, after a check that resource and variable table are those of the modelDescription.xml */
static model* create_model(const log_target* log, const void* resource, size_t size, const char* identifier,
                           const char* resources) {
  char expected[39] = "", of_end[39] = "";
  log_text reason;
  model_guid(resource, size, 0, expected);
  model_guid(resource, size, 1, of_end);
  const int at_end = identifier && strcmp(identifier, of_end) == 0;
  model* m = model_create(resource, size, at_end, &reason);
  if (!m) {
    life_refuse(log, "%s: %s", model_text.resource, reason.bytes);
    return NULL;
  }
  if (!identifier || (!at_end && strcmp(identifier, expected) != 0)) {
    model_destroy(m);
    life_refuse(log, "%s is not that of this FMU: expected %s, as of the model in %s", this_fmi.identifier, expected,
                resources);
    return NULL;
  }
  return m;
}

component* life_create(const log_target* log, const char* identifier, const char* resources) {
  log_text reason;
  size_t size = 0;
  void* resource = resource_read(resources, model_text.resource, &size, this_fmi.resources, &reason);
  if (!resource) {
    return life_refuse(log, "%s: %s", model_text.resource, reason.bytes);
  }
  model* m = create_model(log, resource, size, identifier, resources);
  free(resource);
  if (!m) {
    return NULL;
  }
  component* c = component_create(log, m, component_identity(identifier));
  return c ? c : life_refuse(log, "out of memory");
}

/* --- logging ------------------------------------------------------------------------------------------------------ */

fmu_status life_set_logging(component* c, int on, size_t count, const char* const categories[]) {
  const char* function = call_name(CALL_SET_DEBUG_LOGGING);
  fmu_status status = FMU_OK;
  if (!component_may_call(c, CALL_SET_DEBUG_LOGGING)) {
    return FMU_ERROR;
  }
  if (count && !categories) {
    return component_fail(c, function, "categories is NULL");
  }
  unsigned named = count ? LOG_NOTHING : LOG_EVERYTHING;
  for (size_t i = 0; i < count; ++i) {
    const log_category category = log_find_category(categories[i]);
    if (category < LOG_CATEGORY_COUNT) {
      named |= 1u << category;
      continue;
    }
    const log_text text =
        log_line("%s: no category \"%s\": expected those of LogCategories in modelDescription.xml; ignored", function,
                 categories[i] ? categories[i] : "NULL");
    status = log_send(&c->log, FMU_WARNING, LOG_STATUS_WARNING, &text);
  }
  c->log.wanted = on ? named : c->log.wanted & ~named;
  return status;
}

/* --- life cycle --------------------------------------------------------------------------------------------------- */

/* a time that any model takes; otherwise a message */
static int time_is_sound(component* c, fmu_function function, const char* name, double time) {
  if (fabs(time) <= 1e15) {
    return 1;
  }
  component_fail(c, call_name(function), "%s = %g s: expected a finite number of magnitude at most 1e15 s", name, time);
  return 0;
}

/* Importers give tolerances of their own (Maestro 0.1), meant for all FMUs of a system: a model that cannot take it
 * uses the nearest that it can, with a warning. */
static int set_tolerance(component* c, fmu_function function, double tolerance) {
  double used = tolerance;
  const char* expected = model_set_tolerance(c->model, &used);
  if (!expected && !(used < tolerance || used > tolerance)) {
    return 1;
  }
  if (expected) {
    component_fail(c, call_name(function), "tolerance = %g: expected %s", tolerance, expected);
    return 0;
  }
  const log_text text = log_line("%s: tolerance = %g: this FMU goes on with %g", call_name(function), tolerance, used);
  log_send(&c->log, FMU_WARNING, LOG_STATUS_WARNING, &text);
  return 1;
}

fmu_status life_set_experiment(component* c, fmu_function function, const experiment* e) {
  if (!component_may_call(c, function) || !time_is_sound(c, function, "startTime", e->start_time)) {
    return FMU_ERROR;
  }
  if (e->stop_time_defined && !(e->stop_time >= e->start_time)) {
    return component_fail(c, call_name(function), "stopTime = %g s: expected at least startTime = %g s", e->stop_time,
                          e->start_time);
  }
  if (e->tolerance_defined && !set_tolerance(c, function, e->tolerance)) {
    return FMU_ERROR;
  }
  variables_fetch_settings(&c->values, c->model);
  c->start_time = *c->values.time = e->start_time;
  c->stop_time_defined = e->stop_time_defined;
  c->stop_time = e->stop_time_defined ? e->stop_time : 0.0;
  return FMU_OK;
}

fmu_status life_enter_initialisation(component* c) {
  if (!component_may_call(c, CALL_ENTER_INITIALIZATION_MODE)) {
    return FMU_ERROR;
  }
  c->phase = PHASE_INITIALISATION;
  c->outputs_pending = 1;
  return FMU_OK;
}

/* The model has taken a sample. */
static void show_sample(component* c) {
  model_fetch_outputs(c->model, &c->values);
  c->waiting = c->outputs_pending = 0;
}

/* Inputs that nobody has set are tried alone: parameters that do not go together are refused here. */
static model_answer initialise(component* c) {
  if (c->inputs_given || !model_text.needs_inputs) {
    return model_initialise(c->model, &c->values, c->start_time);
  }
  const model_answer answer = model_begin_trial(c->model, &c->values, c->start_time);
  if (answer == MODEL_OK) {
    model_end_trial(c->model);
  }
  return answer;
}

/* With inputs that nobody has set, or that are bad, the first step initialises. */
fmu_status life_exit_initialisation(component* c) {
  const fmu_function function = CALL_EXIT_INITIALIZATION_MODE;
  fmu_status status = FMU_OK;
  if (!component_may_call(c, function)) {
    return FMU_ERROR;
  }
  switch (initialise(c)) {
    case MODEL_OK: break;
    case MODEL_BAD_INPUTS: status = component_warn(c, function, ""); break;
    default: return component_fail_as_model(c, function);
  }
  if (model_is_initialised(c->model)) {
    show_sample(c);
  }
  c->phase = PHASE_STEP_COMPLETE;
  log_event(c, function, c->waiting ? model_text.waits : model_text.initialised, "");
  return status;
}

fmu_status life_terminate(component* c) {
  if (!component_may_call(c, CALL_TERMINATE)) {
    return FMU_ERROR;
  }
  c->phase = PHASE_TERMINATED;
  log_event(c, CALL_TERMINATE, "terminated", "");
  return FMU_OK;
}

fmu_status life_reset(component* c) {
  if (!component_may_call(c, CALL_RESET)) {
    return FMU_ERROR;
  }
  component_reset(c);
  log_event(c, CALL_RESET, "as after ", this_fmi.instantiate);
  return FMU_OK;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

/* A master that repeats a discarded step with the same inputs would never end: fmpy 0.3.32 does. */
enum { MOST_REFUSALS = 1000 };

static fmu_status discard_step(component* c, double time) {
  c->refusals = c->refusals && time == c->refused_at ? c->refusals + 1 : 1;
  c->refused_at = time;
  if (c->refusals > MOST_REFUSALS) {
    return component_fail(c, call_name(CALL_DO_STEP), "%s; the step was tried 1000 times", model_last_error(c->model));
  }
  const log_text text = log_line("%s: %s", call_name(CALL_DO_STEP), model_last_error(c->model));
  return c->step_status = log_send(&c->log, FMU_DISCARD, LOG_STATUS_DISCARD, &text);
}

/* Why there is no step from `time` over `step`; NULL when there is one. Clients round: their last step is the one that
 * ends nearest to the stop time. */
static const char* refuse_step(const component* c, double time, double step) {
  if (!isfinite(step) || !(step > 0.0)) {
    return "expected a finite communicationStepSize above 0 s";
  }
  if (c->stop_time_defined && time + step > c->stop_time + 0.5 * step) {
    return "expected a step that ends at the stop time or before";
  }
  if (c->waiting && time < c->start_time) {
    return "expected a currentCommunicationPoint not before the start time";
  }
  return model_refuse_step(c->model, time, step);
}

fmu_status life_step(component* c, double time, double step) {
  if (!component_may_call(c, CALL_DO_STEP) || !time_is_sound(c, CALL_DO_STEP, "currentCommunicationPoint", time)) {
    return FMU_ERROR;
  }
  const char* reason = refuse_step(c, time, step);
  if (reason) {
    const log_text after = log_line("after the sample at %g s", model_get_time(c->model));
    return component_fail(c, call_name(CALL_DO_STEP), "%s, got point %g s and step %g s, %s", reason, time, step,
                          c->waiting ? "before the first sample" : after.bytes);
  }
  switch (model_step(c->model, &c->values, time, step)) {
    case MODEL_OK: break;
    case MODEL_BAD_INPUTS: return discard_step(c, time);
    default: return component_fail_as_model(c, CALL_DO_STEP);
  }
  show_sample(c);
  component_forget_steps(c);
  *c->values.time = time + step;
  return FMU_OK;
}
