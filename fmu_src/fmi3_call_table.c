#include "call_table.h"

#define CALL_OF_FMI3(CODE, name2, phases2, name3, phases3) [CALL_##CODE] = {name3, phases3},
#define CALLS_OF_TYPE(CODE, type) \
  [CALL_GET_##CODE] = {"fmi3Get" #type, ALWAYS}, [CALL_SET_##CODE] = {"fmi3Set" #type, WRITING},

const fmi_version this_fmi = {
    .calls = {FMI_CALLS(CALL_OF_FMI3) OTHER_TYPES(CALLS_OF_TYPE)},
    .phases = {"Instantiated", "Initialization Mode", "Step Mode", "Terminated", "Terminated after an error"},
    .types = {"Float64", "Int32", "Boolean", "String"},
    .instantiate = "fmi3InstantiateCoSimulation",
    .identifier = "instantiationToken",
    .resources = "resourcePath",
    .state = "FMUState",
    .references = "valueReferences",
    .values = "values",
    .arrays = 1,
};
