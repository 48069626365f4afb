/* FMI 3.0: each function hands its arguments to one that serves both versions. */
#include "derivatives.h"
#include "fmi3Functions.h"
#include "refused_call.h"
#include "states.h"
#include "values.h"

/* --- inquiry and logging ------------------------------------------------------------------------------------------ */

const char* fmi3GetVersion(void) {
  return fmi3Version;
}

FMI_CALL(fmi3Status, fmi3SetDebugLogging,
         (fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[]),
         life_set_logging(instance, loggingOn, nCategories, categories))

static void send_message(const log_target* target, fmu_status status, const char* category, const char* text) {
  const fmi3LogMessageCallback log_message = (fmi3LogMessageCallback)target->logger;
  log_message(target->environment, (fmi3Status)status, category, text);
}

/* Errors are logged whatever loggingOn and fmi3SetDebugLogging say: FMI 3.0.3 asks for it. */
static log_target target_of(fmi3String instanceName, fmi3InstanceEnvironment environment,
                            fmi3LogMessageCallback logMessage) {
  return (log_target){.logger = (void (*)(void))logMessage,
                      .send = send_message,
                      .environment = environment,
                      .instance_name = instanceName ? instanceName : "",
                      .wanted = LOG_NOTHING,
                      .always = 1u << LOG_STATUS_ERROR};
}

/* --- creation ----------------------------------------------------------------------------------------------------- */

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate) {
  (void)visible, (void)earlyReturnAllowed, (void)requiredIntermediateVariables, (void)intermediateUpdate;
  const log_target log = target_of(instanceName, instanceEnvironment, logMessage);
  if (eventModeUsed) {
    return life_refuse(&log, "eventModeUsed: expected false, there is no Event Mode");
  }
  if (nRequiredIntermediateVariables) {
    return life_refuse(&log, "nRequiredIntermediateVariables: expected 0, there are no intermediate values");
  }
  component* c = life_create(&log, instantiationToken, resourcePath);
  if (c) {
    c->log.wanted = loggingOn ? LOG_EVERYTHING : LOG_NOTHING;
  }
  return c;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
  (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
  const log_target log = target_of(instanceName, instanceEnvironment, logMessage);
  return life_refuse(&log, "this FMU is for co-simulation, not for model exchange");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption) {
  (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
  (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
  const log_target log = target_of(instanceName, instanceEnvironment, logMessage);
  return life_refuse(&log, "this FMU is for co-simulation, not for scheduled execution");
}

void fmi3FreeInstance(fmi3Instance instance) {
  if (instance) {
    component_destroy(instance);
  }
}

/* --- life cycle --------------------------------------------------------------------------------------------------- */

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  const experiment e = {toleranceDefined, stopTimeDefined, tolerance, startTime, stopTime};
  const fmu_status status = life_set_experiment(instance, CALL_ENTER_INITIALIZATION_MODE, &e);
  return (fmi3Status)(status == FMU_OK ? life_enter_initialisation(instance) : status);
}

FMI_CALL(fmi3Status, fmi3ExitInitializationMode, (fmi3Instance instance), life_exit_initialisation(instance))
FMI_CALL(fmi3Status, fmi3Terminate, (fmi3Instance instance), life_terminate(instance))
FMI_CALL(fmi3Status, fmi3Reset, (fmi3Instance instance), life_reset(instance))

static void put_flag(fmi3Boolean* flag) {
  if (flag) {
    *flag = fmi3False;
  }
}

/* Every step is carried out to its end or not at all, and none asks for an event or for the end of the simulation. */
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean* eventHandlingNeeded,
                      fmi3Boolean* terminateSimulation, fmi3Boolean* earlyReturn, fmi3Float64* lastSuccessfulTime) {
  (void)noSetFMUStatePriorToCurrentPoint;
  const fmu_status status = life_step(instance, currentCommunicationPoint, communicationStepSize);
  put_flag(eventHandlingNeeded);
  put_flag(terminateSimulation);
  put_flag(earlyReturn);
  if (instance && lastSuccessfulTime) {
    *lastSuccessfulTime = *((const component*)instance)->values.time;
  }
  return (fmi3Status)status;
}

/* --- variables: arrays are read and written whole ----------------------------------------------------------------- */

#define ACCESS(type, CODE, FORMAT)                                                                                \
  fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           fmi3##type values[], size_t value_count) {                                             \
    return (fmi3Status)values_get(instance, CALL_GET_##CODE, VARIABLE_##CODE, references, count, VALUES_##FORMAT, \
                                  values, value_count);                                                           \
  }                                                                                                               \
  fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           const fmi3##type values[], size_t value_count) {                                       \
    return (fmi3Status)values_set(instance, CALL_SET_##CODE, VARIABLE_##CODE, references, count, VALUES_##FORMAT, \
                                  values, value_count);                                                           \
  }

ACCESS(Float64, REAL, DOUBLE)
ACCESS(Int32, INTEGER, INT)
ACCESS(Boolean, BOOLEAN, BOOL)

/* --- types that no variable has ----------------------------------------------------------------------------------- */

#define REFUSE_TYPE(CODE, type)                                                                        \
  fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                           fmi3##type values[], size_t value_count) {                                  \
    return (fmi3Status)values_refuse(instance, CALL_GET_##CODE, #type, references, count, values);     \
  }                                                                                                    \
  fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                           const fmi3##type values[], size_t value_count) {                            \
    return (fmi3Status)values_refuse(instance, CALL_SET_##CODE, #type, references, count, values);     \
  }

OTHER_TYPES(REFUSE_TYPE)
REFUSE_TYPE(STRING, String)

FMI_CALL(fmi3Status, fmi3GetBinary,
         (fmi3Instance instance, const fmi3ValueReference references[], size_t count, size_t sizes[],
          fmi3Binary values[], size_t value_count),
         values_refuse(instance, CALL_GET_BINARY, "Binary", references, count, values))
FMI_CALL(fmi3Status, fmi3SetBinary,
         (fmi3Instance instance, const fmi3ValueReference references[], size_t count, const size_t sizes[],
          const fmi3Binary values[], size_t value_count),
         values_refuse(instance, CALL_SET_BINARY, "Binary", references, count, values))
FMI_CALL(fmi3Status, fmi3GetClock,
         (fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Clock values[]),
         values_refuse(instance, CALL_GET_CLOCK, "Clock", references, count, values))
FMI_CALL(fmi3Status, fmi3SetClock,
         (fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Clock values[]),
         values_refuse(instance, CALL_SET_CLOCK, "Clock", references, count, values))

/* --- derivatives -------------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  const partials p = {{unknowns, nUnknowns}, {knowns, nKnowns}, seed, sensitivity, nSeed, nSensitivity};
  return (fmi3Status)derivatives_directional(instance, &p);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  const partials p = {{unknowns, nUnknowns}, {knowns, nKnowns}, seed, sensitivity, nSeed, nSensitivity};
  return (fmi3Status)derivatives_adjoint(instance, &p);
}

/* --- states ------------------------------------------------------------------------------------------------------- */

FMI_CALL(fmi3Status, fmi3GetFMUState, (fmi3Instance instance, fmi3FMUState* FMUState), states_get(instance, FMUState))
FMI_CALL(fmi3Status, fmi3SetFMUState, (fmi3Instance instance, fmi3FMUState FMUState), states_set(instance, FMUState))
FMI_CALL(fmi3Status, fmi3FreeFMUState, (fmi3Instance instance, fmi3FMUState* FMUState), states_free(instance, FMUState))
FMI_CALL(fmi3Status, fmi3SerializedFMUStateSize, (fmi3Instance instance, fmi3FMUState FMUState, size_t* size),
         states_serialized_size(instance, FMUState, size))
FMI_CALL(fmi3Status, fmi3SerializeFMUState,
         (fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size),
         states_serialize(instance, FMUState, serializedState, size))
FMI_CALL(fmi3Status, fmi3DeserializeFMUState,
         (fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState* FMUState),
         states_deserialize(instance, serializedState, size, FMUState))
