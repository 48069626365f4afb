/* FMI 2.0: each function hands its arguments to one that serves both versions. */
#include "derivatives.h"
#include "fmi2Functions.h"
#include "states.h"
#include "values.h"

/* --- inquiry and logging ------------------------------------------------------------------------------------------ */

const char* fmi2GetTypesPlatform(void) {
  return fmi2TypesPlatform;
}

const char* fmi2GetVersion(void) {
  return fmi2Version;
}

FMI_CALL(fmi2Status, fmi2SetDebugLogging,
         (fmi2Component instance, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[]),
         life_set_logging(instance, loggingOn != fmi2False, nCategories, categories))

/* the text as a format string that prints it */
static void escape_percent(char* to, const char* from) {
  for (; *from; ++from) {
    *to++ = *from;
    if (*from == '%') {
      *to++ = '%';
    }
  }
  *to = '\0';
}

/* Importers that drop the variable arguments see the text in the message, those that format it print it unchanged; the
 * text is passed once more for the few that expect an argument always. */
static void send_message(const log_target* target, fmu_status status, const char* category, const char* text) {
  char format[2 * LOG_TEXT_BYTES];
  const fmi2CallbackLogger logger = (fmi2CallbackLogger)target->logger;
  escape_percent(format, text);
  logger(target->environment, target->instance_name, (fmi2Status)status, category, format, text);
}

/* --- creation ----------------------------------------------------------------------------------------------------- */

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions* functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
  (void)visible;
  /* why there is no instance is said whatever loggingOn says: nobody could ask afterwards */
  log_target log = {.logger = functions ? (void (*)(void))functions->logger : NULL,
                    .send = send_message,
                    .environment = functions ? functions->componentEnvironment : NULL,
                    .instance_name = instanceName ? instanceName : "",
                    .wanted = LOG_EVERYTHING};
  component* c = fmuType == fmi2CoSimulation ? life_create(&log, fmuGUID, fmuResourceLocation)
                                             : life_refuse(&log, "fmuType: expected fmi2CoSimulation");
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

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  const experiment e = {toleranceDefined != fmi2False, stopTimeDefined != fmi2False, tolerance, startTime, stopTime};
  return (fmi2Status)life_set_experiment(instance, CALL_SETUP_EXPERIMENT, &e);
}

FMI_CALL(fmi2Status, fmi2EnterInitializationMode, (fmi2Component instance), life_enter_initialisation(instance))
FMI_CALL(fmi2Status, fmi2ExitInitializationMode, (fmi2Component instance), life_exit_initialisation(instance))
FMI_CALL(fmi2Status, fmi2Terminate, (fmi2Component instance), life_terminate(instance))
FMI_CALL(fmi2Status, fmi2Reset, (fmi2Component instance), life_reset(instance))

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  (void)noSetFMUStatePriorToCurrentPoint;
  return (fmi2Status)life_step(instance, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component instance) {
  component_may_call(instance, CALL_CANCEL_STEP); /* never: no step is ever in progress */
  return fmi2Error;
}

/* --- status ------------------------------------------------------------------------------------------------------- */

/* Common part of the inquiries: fmi2Discard for what this FMU cannot answer, as the standard requires. */
static fmi2Status begin_status(component* c, fmu_function function, const void* value, int has_answer) {
  if (!component_may_call(c, function)) {
    return fmi2Error;
  }
  if (!value) {
    return (fmi2Status)component_fail(c, call_name(function), "value is NULL");
  }
  if (!has_answer) {
    const log_text text = log_line("%s: no such status: every step is carried out at once", call_name(function));
    return (fmi2Status)log_send(&c->log, FMU_DISCARD, LOG_STATUS_DISCARD, &text);
  }
  return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status* value) {
  const fmi2Status status = begin_status(instance, CALL_GET_STATUS, value, kind == fmi2DoStepStatus);
  if (status == fmi2OK) {
    *value = (fmi2Status)((const component*)instance)->step_status;
  }
  return status;
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real* value) {
  const fmi2Status status = begin_status(instance, CALL_GET_REAL_STATUS, value, kind == fmi2LastSuccessfulTime);
  if (status == fmi2OK) {
    *value = *((const component*)instance)->values.time;
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

/* --- variables: fmi2Integer and fmi2Boolean are int, and a value reference is one number -------------------------- */

#define ACCESS(type, CODE, FORMAT)                                                                                   \
  fmi2Status fmi2Get##type(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2##type value[]) {  \
    return (fmi2Status)values_get(instance, CALL_GET_##CODE, VARIABLE_##CODE, vr, nvr, VALUES_##FORMAT, value, nvr); \
  }                                                                                                                  \
  fmi2Status fmi2Set##type(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,                        \
                           const fmi2##type value[]) {                                                               \
    return (fmi2Status)values_set(instance, CALL_SET_##CODE, VARIABLE_##CODE, vr, nvr, VALUES_##FORMAT, value, nvr); \
  }

ACCESS(Real, REAL, DOUBLE)
ACCESS(Integer, INTEGER, INT)
ACCESS(Boolean, BOOLEAN, INT)

FMI_CALL(fmi2Status, fmi2GetString,
         (fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]),
         values_refuse(instance, CALL_GET_STRING, "String", vr, nvr, value))
FMI_CALL(fmi2Status, fmi2SetString,
         (fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]),
         values_refuse(instance, CALL_SET_STRING, "String", vr, nvr, value))

/* --- derivatives -------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
  const partials p = {.unknowns = {vUnknown_ref, nUnknown},
                      .knowns = {vKnown_ref, nKnown},
                      .seed = dvKnown,
                      .sensitivity = dvUnknown,
                      .seed_count = nKnown,
                      .sensitivity_count = nUnknown};
  return (fmi2Status)derivatives_directional(instance, &p);
}

/* --- states ------------------------------------------------------------------------------------------------------- */

FMI_CALL(fmi2Status, fmi2GetFMUstate, (fmi2Component instance, fmi2FMUstate* FMUstate), states_get(instance, FMUstate))
FMI_CALL(fmi2Status, fmi2SetFMUstate, (fmi2Component instance, fmi2FMUstate FMUstate), states_set(instance, FMUstate))
FMI_CALL(fmi2Status, fmi2FreeFMUstate, (fmi2Component instance, fmi2FMUstate* FMUstate),
         states_free(instance, FMUstate))
FMI_CALL(fmi2Status, fmi2SerializedFMUstateSize, (fmi2Component instance, fmi2FMUstate FMUstate, size_t* size),
         states_serialized_size(instance, FMUstate, size))
FMI_CALL(fmi2Status, fmi2SerializeFMUstate,
         (fmi2Component instance, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size),
         states_serialize(instance, FMUstate, serializedState, size))
FMI_CALL(fmi2Status, fmi2DeSerializeFMUstate,
         (fmi2Component instance, const fmi2Byte serializedState[], size_t size, fmi2FMUstate* FMUstate),
         states_deserialize(instance, serializedState, size, FMUstate))
