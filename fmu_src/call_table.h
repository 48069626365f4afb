/* Which function may be called when: the table of FMI 2.0.5, section 4.2.4, for co-simulation. */
#ifndef TENDONFMU_CALL_TABLE_H
#define TENDONFMU_CALL_TABLE_H

/* States of an instance. Steps are carried out at once, so stepInProgress, stepFailed and stepCanceled never occur. */
typedef enum fmu_phase {
  PHASE_INSTANTIATED,
  PHASE_INITIALISATION,
  PHASE_STEP_COMPLETE,
  PHASE_TERMINATED,
  PHASE_COUNT,
  PHASE_ERROR = PHASE_COUNT /* on top of one of the others */
} fmu_phase;

typedef enum fmu_function {
  CALL_SET_DEBUG_LOGGING,
  CALL_SETUP_EXPERIMENT,
  CALL_ENTER_INITIALIZATION_MODE,
  CALL_EXIT_INITIALIZATION_MODE,
  CALL_TERMINATE,
  CALL_RESET,
  CALL_GET_REAL,
  CALL_GET_INTEGER,
  CALL_GET_BOOLEAN,
  CALL_GET_STRING,
  CALL_SET_REAL,
  CALL_SET_INTEGER,
  CALL_SET_BOOLEAN,
  CALL_SET_STRING,
  CALL_GET_FMU_STATE,
  CALL_SET_FMU_STATE,
  CALL_FREE_FMU_STATE,
  CALL_SERIALIZED_FMU_STATE_SIZE,
  CALL_SERIALIZE_FMU_STATE,
  CALL_DESERIALIZE_FMU_STATE,
  CALL_GET_DIRECTIONAL_DERIVATIVE,
  CALL_SET_REAL_INPUT_DERIVATIVES,
  CALL_GET_REAL_OUTPUT_DERIVATIVES,
  CALL_DO_STEP,
  CALL_CANCEL_STEP,
  CALL_GET_STATUS,
  CALL_GET_REAL_STATUS,
  CALL_GET_INTEGER_STATUS,
  CALL_GET_BOOLEAN_STATUS,
  CALL_GET_STRING_STATUS,
  CALL_COUNT
} fmu_function;

const char* call_name(fmu_function function);
int call_is_allowed(fmu_function function, fmu_phase phase);
const char* phase_name(fmu_phase phase);

#endif
