#include "call_table.h"

/* After an error FMI 3.0 has an instance terminated: values can be read, and fmi3Reset or fmi3SetFMUState lead on. */
enum {
  INSTANTIATED = 1 << PHASE_INSTANTIATED,
  INITIALISATION = 1 << PHASE_INITIALISATION,
  STEP_MODE = 1 << PHASE_STEP_COMPLETE,
  TERMINATED = 1 << PHASE_TERMINATED,
  ERROR = 1 << PHASE_ERROR,
  ALWAYS = INSTANTIATED | INITIALISATION | STEP_MODE | TERMINATED | ERROR,
  DERIVING = INITIALISATION | STEP_MODE | TERMINATED | ERROR,
  WRITING = INSTANTIATED | INITIALISATION | STEP_MODE
};

#define CALLS_OF_TYPE(CODE, type) \
  [CALL_GET_##CODE] = {"fmi3Get" #type, ALWAYS}, [CALL_SET_##CODE] = {"fmi3Set" #type, WRITING},

/* FMI 3.0, sections 2.3 and 4.2. Without Event Mode, Step Mode takes tunable parameters. */
const fmi_version this_fmi = {
    .calls =
        {
            [CALL_SET_DEBUG_LOGGING] = {"fmi3SetDebugLogging", ALWAYS},
            [CALL_ENTER_INITIALIZATION_MODE] = {"fmi3EnterInitializationMode", INSTANTIATED},
            [CALL_EXIT_INITIALIZATION_MODE] = {"fmi3ExitInitializationMode", INITIALISATION},
            [CALL_TERMINATE] = {"fmi3Terminate", STEP_MODE},
            [CALL_RESET] = {"fmi3Reset", ALWAYS},
            [CALL_GET_REAL] = {"fmi3GetFloat64", ALWAYS},
            [CALL_GET_INTEGER] = {"fmi3GetInt32", ALWAYS},
            [CALL_GET_BOOLEAN] = {"fmi3GetBoolean", ALWAYS},
            [CALL_GET_STRING] = {"fmi3GetString", ALWAYS},
            [CALL_SET_REAL] = {"fmi3SetFloat64", WRITING},
            [CALL_SET_INTEGER] = {"fmi3SetInt32", WRITING},
            [CALL_SET_BOOLEAN] = {"fmi3SetBoolean", WRITING},
            [CALL_SET_STRING] = {"fmi3SetString", WRITING},
            [CALL_GET_FMU_STATE] = {"fmi3GetFMUState", ALWAYS},
            [CALL_SET_FMU_STATE] = {"fmi3SetFMUState", ALWAYS},
            [CALL_FREE_FMU_STATE] = {"fmi3FreeFMUState", ALWAYS},
            [CALL_SERIALIZED_FMU_STATE_SIZE] = {"fmi3SerializedFMUStateSize", ALWAYS},
            [CALL_SERIALIZE_FMU_STATE] = {"fmi3SerializeFMUState", ALWAYS},
            [CALL_DESERIALIZE_FMU_STATE] = {"fmi3DeserializeFMUState", ALWAYS},
            [CALL_GET_DIRECTIONAL_DERIVATIVE] = {"fmi3GetDirectionalDerivative", DERIVING},
            [CALL_GET_ADJOINT_DERIVATIVE] = {"fmi3GetAdjointDerivative", DERIVING},
            [CALL_DO_STEP] = {"fmi3DoStep", STEP_MODE},
            [CALL_GET_BINARY] = {"fmi3GetBinary", ALWAYS},
            [CALL_SET_BINARY] = {"fmi3SetBinary", WRITING},
            [CALL_GET_CLOCK] = {"fmi3GetClock", ALWAYS},
            [CALL_SET_CLOCK] = {"fmi3SetClock", WRITING},
            /* clang-format off */
            OTHER_TYPES(CALLS_OF_TYPE)
            /* clang-format on */
        },
    .phases = {"Instantiated", "Initialization Mode", "Step Mode", "Terminated", "Terminated after an error"},
    .types = {"Float64", "Int32", "Boolean", "String"},
    .instantiate = "fmi3InstantiateCoSimulation",
    .identifier = "instantiationToken",
    .resources = "resourcePath",
    .state = "FMUState",
    .references = "valueReferences",
    .values = "values",
    .arrays = 1,
    .time_is_variable = 1,
};
