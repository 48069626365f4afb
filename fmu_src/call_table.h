/* Which function may be called when, and what it and its arguments are called: one table for each version of FMI
 * (fmi2_call_table.c, fmi3_call_table.c). A library has one of them; all else in it is the same. */
#pragma once

/* States of an instance. Steps are carried out at once, so stepInProgress and stepCanceled never occur. A discarded
 * step leads to stepComplete, which allows all that stepFailed does and the next step too. There are no events and no
 * structural parameters, so the Event and Configuration Modes of FMI 3.0 never occur either. */
typedef enum fmu_phase {
  PHASE_INSTANTIATED,
  PHASE_INITIALISATION,
  PHASE_STEP_COMPLETE,
  PHASE_TERMINATED,
  PHASE_COUNT,
  PHASE_ERROR = PHASE_COUNT /* on top of one of the others */
} fmu_phase;

/* Types of FMI 3.0 that no variable has, but for those whose calls take other arguments: Binary and Clock. */
#define OTHER_TYPES(ENTRY) \
  ENTRY(FLOAT32, Float32)  \
  ENTRY(INT8, Int8)        \
  ENTRY(UINT8, UInt8)      \
  ENTRY(INT16, Int16)      \
  ENTRY(UINT16, UInt16)    \
  ENTRY(UINT32, UInt32)    \
  ENTRY(INT64, Int64)      \
  ENTRY(UINT64, UInt64)

/* Functions of both versions under the name that they have in FMI 2.0: fmi3SetFloat64 is CALL_SET_REAL. */
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
  CALL_GET_ADJOINT_DERIVATIVE,
  CALL_SET_REAL_INPUT_DERIVATIVES,
  CALL_GET_REAL_OUTPUT_DERIVATIVES,
  CALL_DO_STEP,
  /* of FMI 2.0 only */
  CALL_CANCEL_STEP,
  CALL_GET_STATUS,
  CALL_GET_REAL_STATUS,
  CALL_GET_INTEGER_STATUS,
  CALL_GET_BOOLEAN_STATUS,
  CALL_GET_STRING_STATUS,
/* of FMI 3.0 only, for types that no variable has */
#define CALLS_OF_TYPE(CODE, type) CALL_GET_##CODE, CALL_SET_##CODE,
  OTHER_TYPES(CALLS_OF_TYPE)
#undef CALLS_OF_TYPE
      CALL_GET_BINARY,
  CALL_SET_BINARY,
  CALL_GET_CLOCK,
  CALL_SET_CLOCK,
  CALL_COUNT
} fmu_function;

typedef struct fmu_call {
  const char* name;
  int allowed; /* bit 1 << phase */
} fmu_call;

typedef struct fmi_version {
  fmu_call calls[CALL_COUNT]; /* name NULL: the version has no such function */
  const char* phases[PHASE_ERROR + 1];
  const char* types[4]; /* by variable_type */
  const char* instantiate;
  const char* identifier; /* argument: the GUID of modelDescription.xml */
  const char* resources;  /* argument: where the folder resources is */
  const char* state;      /* argument: a saved state */
  const char* references; /* argument: value references */
  const char* values;     /* argument: values of variables */
  int arrays;             /* a value reference stands for all elements of a group, not for one */
  int time_is_variable;   /* VARIABLE_TIME_REFERENCE is the independent variable */
} fmi_version;

/* Of this library. */
extern const fmi_version this_fmi;

static inline const char* call_name(fmu_function function) {
  return this_fmi.calls[function].name;
}
static inline int call_is_allowed(fmu_function function, fmu_phase phase) {
  return (this_fmi.calls[function].allowed >> phase) & 1;
}
