#include "call_table.h"

#define CALL_OF_FMI2(CODE, name2, phases2, name3, phases3) [CALL_##CODE] = {name2, phases2},

const fmi_version this_fmi = {
    .calls = {FMI_CALLS(CALL_OF_FMI2)},
    .phases = {"instantiated", "initializationMode", "stepComplete", "terminated", "error"},
    .types = {"Real", "Integer", "Boolean", "String"},
    .instantiate = "fmi2Instantiate",
    .identifier = "fmuGUID",
    .resources = "fmuResourceLocation",
    .state = "FMUstate",
    .references = "vr",
    .values = "value",
};
