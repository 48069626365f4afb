/* FMI 2.0, creation, life cycle, steps and their status. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "component.h"
#include "fmi2Functions.h"
#include "resource.h"

/* --- inquiry and logging ------------------------------------------------------------------------------------------ */

const char* fmi2GetTypesPlatform(void) {
  return fmi2TypesPlatform;
}

const char* fmi2GetVersion(void) {
  return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  component* c = instance;
  fmi2Status status = fmi2OK;
  if (!component_may_call(c, CALL_SET_DEBUG_LOGGING)) {
    return fmi2Error;
  }
  if (nCategories && !categories) {
    return component_fail_because(c, "fmi2SetDebugLogging", "categories is NULL");
  }
  unsigned named = nCategories ? LOG_NOTHING : LOG_EVERYTHING;
  for (size_t i = 0; i < nCategories; ++i) {
    const log_category category = log_find_category(categories[i]);
    if (category < LOG_CATEGORY_COUNT) {
      named |= 1u << category;
      continue;
    }
    log_text text = log_start("fmi2SetDebugLogging", "no category \"");
    log_append(&text, categories[i] ? categories[i] : "NULL");
    log_append(&text, "\": expected those of LogCategories in modelDescription.xml; ignored");
    log_send(&c->log, fmi2Warning, LOG_STATUS_WARNING, &text);
    status = fmi2Warning;
  }
  c->log.wanted = loggingOn ? named : c->log.wanted & ~named;
  return status;
}

static void log_event(const component* c, const char* function, const char* event) {
  const log_text text = log_start(function, event);
  log_send(&c->log, fmi2OK, LOG_EVENTS, &text);
}

/* --- creation ----------------------------------------------------------------------------------------------------- */

static fmi2Component refuse_instance(const log_target* log, const char* reason, const char* more) {
  log_text text = log_start("fmi2Instantiate", reason);
  log_append(&text, more);
  log_send(log, fmi2Error, LOG_STATUS_ERROR, &text);
  return NULL;
}

static fmi2Component refuse_resource(const log_target* log, const char* reason) {
  log_text text = log_start("fmi2Instantiate", model_text.resource);
  log_append(&text, ": ");
  log_append(&text, reason);
  log_send(log, fmi2Error, LOG_STATUS_ERROR, &text);
  return NULL;
}

/* the model of the resource, after a check that resource and variable table are those of the modelDescription.xml */
static model* create_model(const log_target* log, const void* resource, size_t size, const char* guid) {
  char expected[39] = "", message[256] = "";
  model* m = model_create(resource, size, message, sizeof message);
  if (!m) {
    refuse_resource(log, message);
    return NULL;
  }
  model_guid(resource, size, expected);
  if (!guid || strcmp(guid, expected) != 0) {
    model_destroy(m);
    refuse_instance(log, "fmuGUID is not that of this FMU: expected ", expected);
    return NULL;
  }
  return m;
}

static fmi2Component instantiate(const log_target* log, fmi2Type type, const char* guid, const char* location) {
  const char* reason = "";
  size_t size = 0;
  if (type != fmi2CoSimulation) {
    return refuse_instance(log, "fmuType: expected fmi2CoSimulation", "");
  }
  void* resource = resource_read(location, model_text.resource, &size, &reason);
  if (!resource) {
    return refuse_resource(log, reason);
  }
  model* m = create_model(log, resource, size, guid);
  free(resource);
  if (!m) {
    return NULL;
  }
  component* c = component_create(log, m);
  return c ? c : refuse_instance(log, "out of memory", "");
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions* functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
  (void)visible;
  /* why there is no instance is said whatever loggingOn says: nobody could ask afterwards */
  log_target log = {.logger = functions ? functions->logger : NULL,
                    .environment = functions ? functions->componentEnvironment : NULL,
                    .instance_name = instanceName ? instanceName : "",
                    .wanted = LOG_EVERYTHING};
  component* c = instantiate(&log, fmuType, fmuGUID, fmuResourceLocation);
  if (c) {
    c->log.wanted = loggingOn ? LOG_EVERYTHING : LOG_NOTHING;
  }
  return c;
}

void fmi2FreeInstance(fmi2Component instance) {
  if (instance) {
    component_destroy(instance);
  }
}

/* --- life cycle --------------------------------------------------------------------------------------------------- */

/* a time that any model takes; says so otherwise */
static int time_is_sound(component* c, const char* function, const char* name, double time) {
  if (fabs(time) <= 1e15) {
    return 1;
  }
  log_text text = log_start(function, name);
  log_append(&text, " = ");
  log_append_number(&text, time);
  log_append(&text, " s: expected a finite number of magnitude at most 1e15 s");
  component_fail(c, &text);
  return 0;
}

/* Importers give tolerances of their own (Maestro 0.1), meant for all FMUs of a system: a model that cannot take it
 * uses the nearest that it can, and says so. */
static int set_tolerance(component* c, double tolerance) {
  double used = tolerance;
  const char* expected = model_set_tolerance(c->model, &used);
  if (!expected && !(used < tolerance || used > tolerance)) {
    return 1;
  }
  log_text text = log_start("fmi2SetupExperiment", "tolerance = ");
  log_append_number(&text, tolerance);
  log_append(&text, expected ? ": expected " : ": this FMU goes on with ");
  if (expected) {
    log_append(&text, expected);
    component_fail(c, &text);
    return 0;
  }
  log_append_number(&text, used);
  log_send(&c->log, fmi2Warning, LOG_STATUS_WARNING, &text);
  return 1;
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  component* c = instance;
  if (!component_may_call(c, CALL_SETUP_EXPERIMENT) ||
      !time_is_sound(c, "fmi2SetupExperiment", "startTime", startTime)) {
    return fmi2Error;
  }
  if (stopTimeDefined && !(stopTime >= startTime)) {
    log_text text = log_start("fmi2SetupExperiment", "stopTime = ");
    log_append_number(&text, stopTime);
    log_append(&text, " s: expected at least startTime = ");
    log_append_number(&text, startTime);
    log_append(&text, " s");
    return component_fail(c, &text);
  }
  if (toleranceDefined && !set_tolerance(c, tolerance)) {
    return fmi2Error;
  }
  variables_fetch_settings(&c->values, c->model);
  c->start_time = c->end_of_step = startTime;
  c->stop_time_defined = stopTimeDefined != fmi2False;
  c->stop_time = stopTimeDefined ? stopTime : 0.0;
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
  component* c = instance;
  if (!component_may_call(c, CALL_ENTER_INITIALIZATION_MODE)) {
    return fmi2Error;
  }
  c->phase = PHASE_INITIALISATION;
  c->outputs_pending = 1;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
  component* c = instance;
  if (!component_may_call(c, CALL_EXIT_INITIALIZATION_MODE)) {
    return fmi2Error;
  }
  if (model_initialise(c->model, &c->values, c->start_time)) {
    return component_fail_because(c, "fmi2ExitInitializationMode", model_last_error(c->model));
  }
  model_fetch_outputs(c->model, &c->values);
  c->phase = PHASE_STEP_COMPLETE;
  c->outputs_pending = 0;
  log_event(c, "fmi2ExitInitializationMode", model_text.initialised);
  return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component instance) {
  component* c = instance;
  if (!component_may_call(c, CALL_TERMINATE)) {
    return fmi2Error;
  }
  c->phase = PHASE_TERMINATED;
  log_event(c, "fmi2Terminate", "terminated");
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance) {
  component* c = instance;
  if (!component_may_call(c, CALL_RESET)) {
    return fmi2Error;
  }
  component_reset(c);
  log_event(c, "fmi2Reset", "as after fmi2Instantiate");
  return fmi2OK;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

/* Why there is no step from `time` over `step`; NULL when there is one. A step past the stop time by rounding is one.
 */
static const char* refuse_step(const component* c, double time, double step) {
  if (!isfinite(step) || !(step > 0.0)) {
    return "expected a finite communicationStepSize above 0 s";
  }
  if (c->stop_time_defined && time > c->stop_time + 0.5 * step) {
    return "expected a currentCommunicationPoint not past the stop time";
  }
  return model_refuse_step(c->model, time, step, c->end_of_step);
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  component* c = instance;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!component_may_call(c, CALL_DO_STEP) ||
      !time_is_sound(c, "fmi2DoStep", "currentCommunicationPoint", currentCommunicationPoint)) {
    return fmi2Error;
  }
  const char* reason = refuse_step(c, currentCommunicationPoint, communicationStepSize);
  if (reason) {
    log_text text = log_start("fmi2DoStep", reason);
    log_append(&text, ", got point ");
    log_append_number(&text, currentCommunicationPoint);
    log_append(&text, " s and step ");
    log_append_number(&text, communicationStepSize);
    log_append(&text, " s, after the sample at ");
    log_append_number(&text, model_get_time(c->model));
    log_append(&text, " s");
    return component_fail(c, &text);
  }
  if (model_step(c->model, &c->values, currentCommunicationPoint, communicationStepSize)) {
    return component_fail_because(c, "fmi2DoStep", model_last_error(c->model));
  }
  model_fetch_outputs(c->model, &c->values);
  c->end_of_step = currentCommunicationPoint + communicationStepSize;
  return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component instance) {
  component_may_call(instance, CALL_CANCEL_STEP); /* never: no step is ever in progress */
  return fmi2Error;
}

/* --- status ------------------------------------------------------------------------------------------------------- */

/* Common part of the inquiries: fmi2Discard for what this FMU has no answer to, as the standard wants it. */
static fmi2Status begin_status(component* c, fmu_function function, const void* value, int has_answer) {
  if (!component_may_call(c, function)) {
    return fmi2Error;
  }
  if (!value) {
    return component_fail_because(c, call_name(function), "value is NULL");
  }
  if (!has_answer) {
    const log_text text = log_start(call_name(function), "no such status: every step is carried out at once");
    log_send(&c->log, fmi2Discard, LOG_STATUS_WARNING, &text);
    return fmi2Discard;
  }
  return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status* value) {
  const fmi2Status status = begin_status(instance, CALL_GET_STATUS, value, kind == fmi2DoStepStatus);
  if (status == fmi2OK) {
    *value = fmi2OK;
  }
  return status;
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real* value) {
  const fmi2Status status = begin_status(instance, CALL_GET_REAL_STATUS, value, kind == fmi2LastSuccessfulTime);
  if (status == fmi2OK) {
    *value = ((const component*)instance)->end_of_step;
  }
  return status;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer* value) {
  (void)kind;
  return begin_status(instance, CALL_GET_INTEGER_STATUS, value, 0);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean* value) {
  const fmi2Status status = begin_status(instance, CALL_GET_BOOLEAN_STATUS, value, kind == fmi2Terminated);
  if (status == fmi2OK) {
    *value = fmi2False; /* no model ends a simulation by itself */
  }
  return status;
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String* value) {
  (void)kind;
  return begin_status(instance, CALL_GET_STRING_STATUS, value, 0);
}
