#include "states.h"

#include <stdlib.h>
#include <string.h>

#include "component_state.h"

static fmu_status fail(component* c, fmu_function function, const char* reason) {
  return component_fail(c, call_name(function), "%s", reason);
}

/* "<function>: <what the version calls a state> is NULL" */
static fmu_status fail_without_state(component* c, fmu_function function) {
  return component_fail(c, call_name(function), "%s is NULL", this_fmi.state);
}

/* A block of another FMU may be shorter than those of this one. */
static int is_own_block(component* c, fmu_function function, const void* block) {
  const char* reason = block ? component_refuse_block(c, block) : NULL;
  if (!block) {
    fail_without_state(c, function);
  } else if (reason) {
    fail(c, function, reason);
  }
  return block && !reason;
}

/* *state NULL: a new block of this FMU; otherwise it must be one. */
static fmu_status provide_block(component* c, fmu_function function, void** state) {
  if (*state) {
    return is_own_block(c, function, *state) ? FMU_OK : FMU_ERROR;
  }
  *state = malloc(component_state_size(c));
  return *state ? FMU_OK : fail(c, function, "out of memory");
}

fmu_status states_get(component* c, void** state) {
  if (!component_may_call(c, CALL_GET_FMU_STATE)) {
    return FMU_ERROR;
  }
  if (!state) {
    return fail_without_state(c, CALL_GET_FMU_STATE);
  }
  if (provide_block(c, CALL_GET_FMU_STATE, state)) {
    return FMU_ERROR;
  }
  component_save(c, *state);
  return FMU_OK;
}

fmu_status states_set(component* c, const void* state) {
  if (!component_may_call(c, CALL_SET_FMU_STATE)) {
    return FMU_ERROR;
  }
  if (!state) {
    return fail_without_state(c, CALL_SET_FMU_STATE);
  }
  const char* reason = component_restore(c, state);
  return reason ? fail(c, CALL_SET_FMU_STATE, reason) : FMU_OK;
}

fmu_status states_free(component* c, void** state) {
  if (!component_may_call(c, CALL_FREE_FMU_STATE)) {
    return FMU_ERROR;
  }
  if (state) { /* a state that is NULL is no error, by the standard */
    free(*state);
    *state = NULL;
  }
  return FMU_OK;
}

fmu_status states_serialized_size(component* c, const void* state, size_t* size) {
  if (!component_may_call(c, CALL_SERIALIZED_FMU_STATE_SIZE) ||
      !is_own_block(c, CALL_SERIALIZED_FMU_STATE_SIZE, state)) {
    return FMU_ERROR;
  }
  if (!size) {
    return fail(c, CALL_SERIALIZED_FMU_STATE_SIZE, "size is NULL");
  }
  *size = component_state_size(c);
  return FMU_OK;
}

/* Common part of the two below: bytes of the right number. */
static int has_bytes(component* c, fmu_function function, const void* bytes, size_t size) {
  if (bytes && size == component_state_size(c)) {
    return 1;
  }
  component_fail(c, call_name(function), "%ssize = %zu: expected %zu bytes", bytes ? "" : "serializedState is NULL, ",
                 size, component_state_size(c));
  return 0;
}

fmu_status states_serialize(component* c, const void* state, void* bytes, size_t size) {
  if (!component_may_call(c, CALL_SERIALIZE_FMU_STATE) || !is_own_block(c, CALL_SERIALIZE_FMU_STATE, state) ||
      !has_bytes(c, CALL_SERIALIZE_FMU_STATE, bytes, size)) {
    return FMU_ERROR;
  }
  memcpy(bytes, state, size);
  return FMU_OK;
}

fmu_status states_deserialize(component* c, const void* bytes, size_t size, void** state) {
  if (!component_may_call(c, CALL_DESERIALIZE_FMU_STATE)) {
    return FMU_ERROR;
  }
  if (!state) {
    return fail_without_state(c, CALL_DESERIALIZE_FMU_STATE);
  }
  if (!has_bytes(c, CALL_DESERIALIZE_FMU_STATE, bytes, size)) {
    return FMU_ERROR;
  }
  const char* reason = component_check_state(c, bytes, size);
  if (reason) {
    return fail(c, CALL_DESERIALIZE_FMU_STATE, reason);
  }
  if (provide_block(c, CALL_DESERIALIZE_FMU_STATE, state)) {
    return FMU_ERROR;
  }
  memcpy(*state, bytes, size);
  return FMU_OK;
}
