/* FMI 2.0, states of an instance: get, set, free, and as bytes. An fmi2FMUstate is a block of component_save(). */
#include <stdlib.h>
#include <string.h>

#include "component.h"
#include "component_state.h"
#include "fmi2Functions.h"

/* A block of another FMU may be shorter than those of this one. */
static int is_own_block(component* c, const char* function, fmi2FMUstate block) {
  const char* reason = block ? component_refuse_block(c, block) : "FMUstate is NULL";
  if (reason) {
    component_fail_because(c, function, reason);
  }
  return !reason;
}

fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate* FMUstate) {
  component* c = instance;
  if (!component_may_call(c, CALL_GET_FMU_STATE)) {
    return fmi2Error;
  }
  if (!FMUstate) {
    return component_fail_because(c, "fmi2GetFMUstate", "FMUstate is NULL");
  }
  if (*FMUstate && !is_own_block(c, "fmi2GetFMUstate", *FMUstate)) {
    return fmi2Error;
  }
  if (!*FMUstate) {
    *FMUstate = malloc(component_state_size(c));
  }
  if (!*FMUstate) {
    return component_fail_because(c, "fmi2GetFMUstate", "out of memory");
  }
  component_save(c, *FMUstate);
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate FMUstate) {
  component* c = instance;
  if (!component_may_call(c, CALL_SET_FMU_STATE)) {
    return fmi2Error;
  }
  const char* reason = FMUstate ? component_restore(c, FMUstate) : "FMUstate is NULL";
  return reason ? component_fail_because(c, "fmi2SetFMUstate", reason) : fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate* FMUstate) {
  if (!component_may_call(instance, CALL_FREE_FMU_STATE)) {
    return fmi2Error;
  }
  if (FMUstate) { /* a state that is NULL is no error, by the standard */
    free(*FMUstate);
    *FMUstate = NULL;
  }
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate FMUstate, size_t* size) {
  component* c = instance;
  if (!component_may_call(c, CALL_SERIALIZED_FMU_STATE_SIZE)) {
    return fmi2Error;
  }
  if (!is_own_block(c, "fmi2SerializedFMUstateSize", FMUstate)) {
    return fmi2Error;
  }
  if (!size) {
    return component_fail_because(c, "fmi2SerializedFMUstateSize", "size is NULL");
  }
  *size = component_state_size(c);
  return fmi2OK;
}

/* Common part of the two below: bytes of the right number. */
static int has_bytes(component* c, const char* function, const void* bytes, size_t size) {
  if (bytes && size == component_state_size(c)) {
    return 1;
  }
  log_text text = log_start(function, bytes ? "size = " : "serializedState is NULL, size = ");
  log_append_count(&text, size);
  log_append(&text, ": expected ");
  log_append_count(&text, component_state_size(c));
  log_append(&text, " bytes");
  component_fail(c, &text);
  return 0;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  component* c = instance;
  if (!component_may_call(c, CALL_SERIALIZE_FMU_STATE)) {
    return fmi2Error;
  }
  if (!is_own_block(c, "fmi2SerializeFMUstate", FMUstate) ||
      !has_bytes(c, "fmi2SerializeFMUstate", serializedState, size)) {
    return fmi2Error;
  }
  memcpy(serializedState, FMUstate, size);
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate* FMUstate) {
  component* c = instance;
  if (!component_may_call(c, CALL_DESERIALIZE_FMU_STATE)) {
    return fmi2Error;
  }
  if (!FMUstate) {
    return component_fail_because(c, "fmi2DeSerializeFMUstate", "FMUstate is NULL");
  }
  if (!has_bytes(c, "fmi2DeSerializeFMUstate", serializedState, size)) {
    return fmi2Error;
  }
  const char* reason = component_check_state(c, serializedState, size);
  if (reason) {
    return component_fail_because(c, "fmi2DeSerializeFMUstate", reason);
  }
  if (*FMUstate && !is_own_block(c, "fmi2DeSerializeFMUstate", *FMUstate)) {
    return fmi2Error;
  }
  if (!*FMUstate) {
    *FMUstate = malloc(size);
  }
  if (!*FMUstate) {
    return component_fail_because(c, "fmi2DeSerializeFMUstate", "out of memory");
  }
  memcpy(*FMUstate, serializedState, size);
  return fmi2OK;
}
