/* Which function may be called when, and what it and its arguments are called in each version of FMI
 * (fmi2_call_table.c, fmi3_call_table.c). A library has one of them; all else in it is the same. */
#pragma once

#include <stddef.h>

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

/* Phases in which a call is allowed. */
enum {
  CREATED = 1 << PHASE_INSTANTIATED,
  STARTING = 1 << PHASE_INITIALISATION,
  STEPPING = 1 << PHASE_STEP_COMPLETE,
  TERMINATED = 1 << PHASE_TERMINATED,
  FAILED = 1 << PHASE_ERROR,
  NEVER = 0, /* also what needs a step in progress */
  READING = STARTING | STEPPING | TERMINATED | FAILED,
  ALWAYS = CREATED | READING,
  WRITING = CREATED | STARTING | STEPPING,
  STATUS = STEPPING | TERMINATED
};

/* Functions by the name that they have in FMI 2.0 (fmi3SetFloat64 is CALL_SET_REAL): name and phases in FMI 2.0 (2.0.5,
 * section 4.2.4) and in FMI 3.0 (sections 2.3 and 4.2), where after an error an instance is terminated: values can be
 * read, and fmi3Reset or fmi3SetFMUState lead on. Without Event Mode, Step Mode takes tunable parameters. */
/* clang-format off */
#define FMI_CALLS(ENTRY) \
  ENTRY(SET_DEBUG_LOGGING, "fmi2SetDebugLogging", ALWAYS, "fmi3SetDebugLogging", ALWAYS) \
  ENTRY(SETUP_EXPERIMENT, "fmi2SetupExperiment", CREATED, NULL, NEVER) \
  ENTRY(ENTER_INITIALIZATION_MODE, "fmi2EnterInitializationMode", CREATED, "fmi3EnterInitializationMode", CREATED) \
  ENTRY(EXIT_INITIALIZATION_MODE, "fmi2ExitInitializationMode", STARTING, "fmi3ExitInitializationMode", STARTING) \
  ENTRY(TERMINATE, "fmi2Terminate", STEPPING, "fmi3Terminate", STEPPING) \
  ENTRY(RESET, "fmi2Reset", ALWAYS, "fmi3Reset", ALWAYS) \
  ENTRY(GET_REAL, "fmi2GetReal", READING, "fmi3GetFloat64", ALWAYS) \
  ENTRY(GET_INTEGER, "fmi2GetInteger", READING, "fmi3GetInt32", ALWAYS) \
  ENTRY(GET_BOOLEAN, "fmi2GetBoolean", READING, "fmi3GetBoolean", ALWAYS) \
  ENTRY(GET_STRING, "fmi2GetString", READING, "fmi3GetString", ALWAYS) \
  ENTRY(SET_REAL, "fmi2SetReal", WRITING, "fmi3SetFloat64", WRITING) \
  ENTRY(SET_INTEGER, "fmi2SetInteger", WRITING, "fmi3SetInt32", WRITING) \
  ENTRY(SET_BOOLEAN, "fmi2SetBoolean", WRITING, "fmi3SetBoolean", WRITING) \
  ENTRY(SET_STRING, "fmi2SetString", WRITING, "fmi3SetString", WRITING) \
  ENTRY(GET_FMU_STATE, "fmi2GetFMUstate", ALWAYS, "fmi3GetFMUState", ALWAYS) \
  ENTRY(SET_FMU_STATE, "fmi2SetFMUstate", ALWAYS, "fmi3SetFMUState", ALWAYS) \
  ENTRY(FREE_FMU_STATE, "fmi2FreeFMUstate", ALWAYS, "fmi3FreeFMUState", ALWAYS) \
  ENTRY(SERIALIZED_FMU_STATE_SIZE, "fmi2SerializedFMUstateSize", ALWAYS, "fmi3SerializedFMUStateSize", ALWAYS) \
  ENTRY(SERIALIZE_FMU_STATE, "fmi2SerializeFMUstate", ALWAYS, "fmi3SerializeFMUState", ALWAYS) \
  ENTRY(DESERIALIZE_FMU_STATE, "fmi2DeSerializeFMUstate", ALWAYS, "fmi3DeserializeFMUState", ALWAYS) \
  ENTRY(GET_DIRECTIONAL_DERIVATIVE, "fmi2GetDirectionalDerivative", READING, "fmi3GetDirectionalDerivative", READING) \
  ENTRY(GET_ADJOINT_DERIVATIVE, NULL, NEVER, "fmi3GetAdjointDerivative", READING) \
  ENTRY(SET_REAL_INPUT_DERIVATIVES, "fmi2SetRealInputDerivatives", WRITING, NULL, NEVER) \
  ENTRY(GET_REAL_OUTPUT_DERIVATIVES, "fmi2GetRealOutputDerivatives", STEPPING | TERMINATED | FAILED, NULL, NEVER) \
  ENTRY(DO_STEP, "fmi2DoStep", STEPPING, "fmi3DoStep", STEPPING) \
  ENTRY(CANCEL_STEP, "fmi2CancelStep", NEVER, NULL, NEVER) \
  ENTRY(GET_STATUS, "fmi2GetStatus", STATUS, NULL, NEVER) \
  ENTRY(GET_REAL_STATUS, "fmi2GetRealStatus", STATUS, NULL, NEVER) \
  ENTRY(GET_INTEGER_STATUS, "fmi2GetIntegerStatus", STATUS, NULL, NEVER) \
  ENTRY(GET_BOOLEAN_STATUS, "fmi2GetBooleanStatus", STATUS, NULL, NEVER) \
  ENTRY(GET_STRING_STATUS, "fmi2GetStringStatus", STATUS, NULL, NEVER) \
  ENTRY(GET_BINARY, NULL, NEVER, "fmi3GetBinary", ALWAYS) \
  ENTRY(SET_BINARY, NULL, NEVER, "fmi3SetBinary", WRITING) \
  ENTRY(GET_CLOCK, NULL, NEVER, "fmi3GetClock", ALWAYS) \
  ENTRY(SET_CLOCK, NULL, NEVER, "fmi3SetClock", WRITING)
/* clang-format on */

#define CALL_OF_FUNCTION(CODE, name2, phases2, name3, phases3) CALL_##CODE,
#define CALLS_OF_TYPE(CODE, type)                              CALL_GET_##CODE, CALL_SET_##CODE,
typedef enum fmu_function { FMI_CALLS(CALL_OF_FUNCTION) OTHER_TYPES(CALLS_OF_TYPE) CALL_COUNT } fmu_function;
#undef CALLS_OF_TYPE

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
  int arrays;             /* a value reference stands for all elements of a group, not for one; time is a variable */
} fmi_version;

/* Of this library. */
extern const fmi_version this_fmi;

static inline const char* call_name(fmu_function function) {
  return this_fmi.calls[function].name;
}
static inline int call_is_allowed(fmu_function function, fmu_phase phase) {
  return (this_fmi.calls[function].allowed >> phase) & 1;
}
