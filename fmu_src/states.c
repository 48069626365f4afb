#include "states.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bytes.h"

/* byte offsets of the header; the checksum covers all that follows it */
enum { MAGIC = 0, VERSION = 8, SIZE = 16, CHECKSUM = 24, IDENTITY = 32, NUMBERS = 40 };
enum { STATE_VERSION = 3 };

/* numbers before the inputs and parameters */
enum { AT_PHASE, AT_STOP_DEFINED, AT_START, AT_STOP, AT_END, AT_INPUTS_GIVEN, LIFE_COUNT };

static const unsigned char magic[8] = {'T', 'F', 'M', 'U', 'F', 'M', 'I', '2'};

static double get_number(const unsigned char* from, size_t index) {
  return load_f64(from + NUMBERS + 8 * index);
}

static uint64_t checksum(const unsigned char* bytes, size_t size) {
  return hash_bytes(bytes + IDENTITY, size - IDENTITY, 0);
}

uint64_t component_identity(const char* identifier) {
  return hash_bytes(identifier, strlen(identifier), 0);
}

static size_t model_offset(const component* c) {
  return NUMBERS + 8 * (LIFE_COUNT + c->values.input_count + c->values.parameter_count);
}

/* Bytes of a state; the same for every instance of one FMU. */
static size_t component_state_size(const component* c) {
  return model_offset(c) + model_get_shape(c->model).state_size;
}

/* Writes the state into bytes [component_state_size()]. Logging and the state "error" are no part of it. */
static void component_save(const component* c, void* bytes) {
  unsigned char *to = bytes, *numbers = to + NUMBERS;
  const variables* v = &c->values;
  const size_t size = component_state_size(c);
  const double life[LIFE_COUNT] = {[AT_PHASE] = (double)c->phase, [AT_STOP_DEFINED] = c->stop_time_defined,
                                   [AT_START] = c->start_time,    [AT_STOP] = c->stop_time,
                                   [AT_END] = *c->values.time,    [AT_INPUTS_GIVEN] = c->inputs_given};
  memcpy(to + MAGIC, magic, sizeof magic);
  store_u64(to + VERSION, STATE_VERSION);
  store_u64(to + SIZE, size);
  store_u64(to + IDENTITY, c->identity);
  store_doubles(numbers, life, LIFE_COUNT);
  store_doubles(numbers + 8 * LIFE_COUNT, v->numbers, v->input_count);
  store_doubles(numbers + 8 * (LIFE_COUNT + v->input_count), v->parameters, v->parameter_count);
  model_save(c->model, to + model_offset(c));
  store_u64(to + CHECKSUM, checksum(to, size));
}

static int is_flag(double x) {
  return x == 0.0 || x == 1.0;
}

static int life_is_sound(const unsigned char* from) {
  const double phase = get_number(from, AT_PHASE);
  return phase >= 0.0 && phase < PHASE_COUNT && phase == floor(phase) && is_flag(get_number(from, AT_STOP_DEFINED)) &&
         is_flag(get_number(from, AT_INPUTS_GIVEN)) && isfinite(get_number(from, AT_START)) &&
         !isnan(get_number(from, AT_STOP)) && isfinite(get_number(from, AT_END));
}

/* Parameters within their ranges. Inputs may be anything: a step says what is wrong with them. */
static int parameters_are_sound(const component* c, const unsigned char* from) {
  for (size_t i = 0; i < c->values.parameter_count; ++i) {
    const variable parameter = {NULL, GROUP_COUNT, i, 0};
    const double value = get_number(from, LIFE_COUNT + c->values.input_count + i);
    if (value != c->values.parameters[i] && !variables_accept(c->model, &parameter, value)) {
      return 0;
    }
  }
  return 1;
}

/* Why a block that component_save() of some instance wrote is no state of this FMU, NULL when it is. Reads its first
 * bytes only, which every FMU of this kind writes. */
static const char* component_refuse_block(const component* c, const void* bytes) {
  const unsigned char* from = bytes;
  if (memcmp(from + MAGIC, magic, sizeof magic) != 0 || load_u64(from + VERSION) != STATE_VERSION) {
    return "not a state of an FMU of this kind and version";
  }
  if (load_u64(from + SIZE) != component_state_size(c) || load_u64(from + IDENTITY) != c->identity) {
    return "state of another FMU";
  }
  return NULL;
}

/* Why these bytes [size] cannot be a state of this FMU, NULL when they can. Changes nothing. */
static const char* component_check_state(component* c, const void* bytes, size_t size) {
  if (size != component_state_size(c)) {
    return "expected as many bytes as this FMU's states have";
  }
  const char* reason = component_refuse_block(c, bytes);
  if (reason) {
    return reason;
  }
  if (load_u64((const unsigned char*)bytes + CHECKSUM) != checksum(bytes, size)) {
    return "damaged state: its checksum does not match";
  }
  if (!life_is_sound(bytes) || !parameters_are_sound(c, bytes)) {
    return "damaged state: a number is out of its range";
  }
  const unsigned char* of_model = (const unsigned char*)bytes + model_offset(c);
  return model_check_state(c->model, of_model, get_number(bytes, AT_PHASE) >= PHASE_STEP_COMPLETE);
}

/* Takes over a state; an instance in the state "error" leaves it. Returns NULL, or with nothing changed the reason. */
static const char* component_restore(component* c, const void* bytes) {
  const unsigned char* from = bytes;
  variables* v = &c->values;
  const char* reason = component_refuse_block(c, from);
  if (reason) {
    return reason;
  }
  if (model_restore(c->model, from + model_offset(c))) {
    return model_last_error(c->model);
  }
  variables_fetch_settings(v, c->model);
  c->failed = 0;
  c->waiting = c->outputs_pending = !model_is_initialised(c->model);
  c->phase = (fmu_phase)get_number(from, AT_PHASE);
  v->parameters_pending = 1; /* whether they differ from the model's is found when they are handed over */
  c->stop_time_defined = get_number(from, AT_STOP_DEFINED) != 0.0;
  c->start_time = get_number(from, AT_START);
  c->stop_time = get_number(from, AT_STOP);
  *v->time = get_number(from, AT_END);
  c->inputs_given = get_number(from, AT_INPUTS_GIVEN) != 0.0;
  component_forget_steps(c);
  load_doubles(v->numbers, from + NUMBERS + 8 * LIFE_COUNT, v->input_count);
  load_doubles(v->parameters, from + NUMBERS + 8 * (LIFE_COUNT + v->input_count), v->parameter_count);
  if (!c->waiting) {
    model_fetch_outputs(c->model, v);
  }
  return NULL;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

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
