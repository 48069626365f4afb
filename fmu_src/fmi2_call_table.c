#include "call_table.h"

enum {
  INSTANTIATED = 1 << PHASE_INSTANTIATED,
  INITIALISATION = 1 << PHASE_INITIALISATION,
  STEP_COMPLETE = 1 << PHASE_STEP_COMPLETE,
  TERMINATED = 1 << PHASE_TERMINATED,
  ERROR = 1 << PHASE_ERROR,
  NEVER = 0, /* needs a step in progress */
  ALWAYS = INSTANTIATED | INITIALISATION | STEP_COMPLETE | TERMINATED | ERROR,
  READING = INITIALISATION | STEP_COMPLETE | TERMINATED | ERROR,
  WRITING = INSTANTIATED | INITIALISATION | STEP_COMPLETE,
  STATUS = STEP_COMPLETE | TERMINATED
};

/* FMI 2.0.5, section 4.2.4 */
const fmi_version this_fmi = {
    .calls =
        {
            [CALL_SET_DEBUG_LOGGING] = {"fmi2SetDebugLogging", ALWAYS},
            [CALL_SETUP_EXPERIMENT] = {"fmi2SetupExperiment", INSTANTIATED},
            [CALL_ENTER_INITIALIZATION_MODE] = {"fmi2EnterInitializationMode", INSTANTIATED},
            [CALL_EXIT_INITIALIZATION_MODE] = {"fmi2ExitInitializationMode", INITIALISATION},
            [CALL_TERMINATE] = {"fmi2Terminate", STEP_COMPLETE},
            [CALL_RESET] = {"fmi2Reset", ALWAYS},
            [CALL_GET_REAL] = {"fmi2GetReal", READING},
            [CALL_GET_INTEGER] = {"fmi2GetInteger", READING},
            [CALL_GET_BOOLEAN] = {"fmi2GetBoolean", READING},
            [CALL_GET_STRING] = {"fmi2GetString", READING},
            [CALL_SET_REAL] = {"fmi2SetReal", WRITING},
            [CALL_SET_INTEGER] = {"fmi2SetInteger", WRITING},
            [CALL_SET_BOOLEAN] = {"fmi2SetBoolean", WRITING},
            [CALL_SET_STRING] = {"fmi2SetString", WRITING},
            [CALL_GET_FMU_STATE] = {"fmi2GetFMUstate", ALWAYS},
            [CALL_SET_FMU_STATE] = {"fmi2SetFMUstate", ALWAYS},
            [CALL_FREE_FMU_STATE] = {"fmi2FreeFMUstate", ALWAYS},
            [CALL_SERIALIZED_FMU_STATE_SIZE] = {"fmi2SerializedFMUstateSize", ALWAYS},
            [CALL_SERIALIZE_FMU_STATE] = {"fmi2SerializeFMUstate", ALWAYS},
            [CALL_DESERIALIZE_FMU_STATE] = {"fmi2DeSerializeFMUstate", ALWAYS},
            [CALL_GET_DIRECTIONAL_DERIVATIVE] = {"fmi2GetDirectionalDerivative", READING},
            [CALL_SET_REAL_INPUT_DERIVATIVES] = {"fmi2SetRealInputDerivatives", WRITING},
            [CALL_GET_REAL_OUTPUT_DERIVATIVES] = {"fmi2GetRealOutputDerivatives", STEP_COMPLETE | TERMINATED | ERROR},
            [CALL_DO_STEP] = {"fmi2DoStep", STEP_COMPLETE},
            [CALL_CANCEL_STEP] = {"fmi2CancelStep", NEVER},
            [CALL_GET_STATUS] = {"fmi2GetStatus", STATUS},
            [CALL_GET_REAL_STATUS] = {"fmi2GetRealStatus", STATUS},
            [CALL_GET_INTEGER_STATUS] = {"fmi2GetIntegerStatus", STATUS},
            [CALL_GET_BOOLEAN_STATUS] = {"fmi2GetBooleanStatus", STATUS},
            [CALL_GET_STRING_STATUS] = {"fmi2GetStringStatus", STATUS},
        },
    .phases = {"instantiated", "initializationMode", "stepComplete", "terminated", "error"},
    .types = {"Real", "Integer", "Boolean", "String"},
    .instantiate = "fmi2Instantiate",
    .identifier = "fmuGUID",
    .resources = "fmuResourceLocation",
    .state = "FMUstate",
    .references = "vr",
    .values = "value",
};
