/* FMI 2.0, states of an instance. */
#include "fmi2Functions.h"
#include "states.h"

fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate* FMUstate) {
  return (fmi2Status)states_get(instance, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate FMUstate) {
  return (fmi2Status)states_set(instance, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate* FMUstate) {
  return (fmi2Status)states_free(instance, FMUstate);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate FMUstate, size_t* size) {
  return (fmi2Status)states_serialized_size(instance, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  return (fmi2Status)states_serialize(instance, FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate* FMUstate) {
  return (fmi2Status)states_deserialize(instance, serializedState, size, FMUstate);
}
