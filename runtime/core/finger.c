/* The public interface, tendonfmu.h. */
#include "floating_point.h"

#include "finger_memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bytes.h"
#include "kernel_choice.h"
#include "message.h"
#include "parameters.h"
#include "step.h"

#ifndef TENDONFMU_VERSION
#error "TENDONFMU_VERSION comes from the build, which has it from CMakeLists.txt"
#endif

const char* tendonfmu_version(void) {
  return TENDONFMU_VERSION;
}

/* --- errors ------------------------------------------------------------------------------------------------------- */

/* the text of the last error may be written on a finger that is otherwise only read */
static message_line error_line(const tendonfmu_finger* finger) {
  return (message_line){((tendonfmu_finger*)(uintptr_t)finger)->error, ERROR_BYTES};
}

MESSAGE_FORMAT(3)
static tendonfmu_status fail(const tendonfmu_finger* finger, tendonfmu_status status, const char* format, ...) {
  va_list arguments;
  message_write(error_line(finger), "%s", "");
  va_start(arguments, format);
  message_add_list(error_line(finger), format, arguments);
  va_end(arguments);
  return status;
}

/* the finger itself, or another argument, is NULL */
static tendonfmu_status missing(const tendonfmu_finger* finger) {
  return finger ? fail(finger, TENDONFMU_BAD_ARGUMENT, "an argument is missing: NULL or of size 0")
                : TENDONFMU_BAD_ARGUMENT;
}

const char* tendonfmu_last_error(const tendonfmu_finger* finger) {
  return finger ? finger->error : "no finger: NULL";
}

/* --- creation ----------------------------------------------------------------------------------------------------- */

tendonfmu_status tendonfmu_check_image(const void* image, size_t image_size, char* message, size_t message_size) {
  model_shape shape;
  if (!image || (!message && message_size)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  const message_line line = {message, message_size};
  message_write(line, "%s", "");
  /* the numbers themselves are checked where there is memory to read them into */
  return model_read_header(image, image_size, &shape, line) ? TENDONFMU_BAD_IMAGE : TENDONFMU_OK;
}

size_t tendonfmu_memory_size(const void* image, size_t image_size) {
  model_shape shape;
  const message_line nowhere = {NULL, 0};
  return image && model_read_header(image, image_size, &shape, nowhere) == 0 ? finger_memory_size(&shape) : 0;
}

static void begin(tendonfmu_finger* finger) {
  memcpy(finger->parameters, finger->start, finger->shape.parameter_count * sizeof(double));
  memset(finger->state, 0, finger->state_count * sizeof(double));
  finger->remembered.scalar[STATE_SOURCE] = TENDONFMU_TENDON_POSITIONS;
  derive_numbers(finger, 1);
}

tendonfmu_finger* tendonfmu_place(void* memory, size_t memory_size, const void* image, size_t image_size, char* message,
                                  size_t message_size) {
  const message_line line = {message, message ? message_size : 0};
  model_shape shape;
  uint32_t* words;
  message_write(line, "%s", "");
  if (!memory || !image || !kernel_rounds_as_written()) {
    message_write(line, "%s",
                  memory && image ? "compiled with -ffast-math, -ffp-contract=fast or the like: expected none of them"
                                  : "memory and image must not be NULL");
    return NULL;
  }
  if (model_read_header(image, image_size, &shape, line)) {
    return NULL;
  }
  if (memory_size < finger_memory_size(&shape)) {
    message_write(line, "too little memory for this finger: expected at least %zu bytes", finger_memory_size(&shape));
    return NULL;
  }
  tendonfmu_finger* finger = finger_lay_out(&shape, memory, &words);
  if (model_read_body(image, &finger->shape, words, finger->start, line) ||
      parameter_check_all(&finger->shape, finger->start, line)) {
    return NULL;
  }
  finger->image_id = load_u64((const unsigned char*)image + 24);
  finger->kernel = kernel_choose("auto");
  begin(finger);
  return finger;
}

tendonfmu_finger* tendonfmu_create(const void* image, size_t image_size, char* message, size_t message_size) {
  const message_line line = {message, message ? message_size : 0};
  const size_t size = tendonfmu_memory_size(image, image_size);
  void* memory = size ? malloc(size) : NULL;
  if (size && !memory) {
    message_write(line, "out of memory: expected %zu bytes", size);
    return NULL;
  }
  unsigned char unused[1]; /* so that a refused image is refused with its reason */
  tendonfmu_finger* finger =
      tendonfmu_place(memory ? memory : unused, memory ? size : 0, image, image_size, message, message_size);
  if (finger) {
    finger->allocation = memory;
  } else {
    free(memory);
  }
  return finger;
}

void tendonfmu_destroy(tendonfmu_finger* finger) {
  if (finger) {
    free(finger->allocation);
  }
}

static char hexadecimal(uint64_t four_bits) {
  return "0123456789abcdef"[four_bits & 15];
}

tendonfmu_status tendonfmu_image_guid(const void* image, size_t image_size, unsigned long long salt, char guid[39]) {
  if (!image || !guid) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  const uint64_t halves[2] = {hash_bytes(image, image_size, salt), hash_bytes(image, image_size, salt ^ 0x5bd1e995u)};
  char* to = guid;
  *to++ = '{';
  for (int i = 0; i < 32; ++i) {
    if (i == 8 || i == 12 || i == 16 || i == 20) {
      *to++ = '-';
    }
    *to++ = hexadecimal(halves[i / 16] >> (60 - 4 * (i % 16)));
  }
  *to++ = '}';
  *to = 0;
  return TENDONFMU_OK;
}

size_t tendonfmu_joint_count(const tendonfmu_finger* finger) {
  return finger ? finger->joints : 0;
}
size_t tendonfmu_tendon_count(const tendonfmu_finger* finger) {
  return finger ? finger->tendons : 0;
}

int tendonfmu_has_links(const tendonfmu_finger* finger) {
  return finger && has_option(finger, MODEL_HAS_LINKS);
}

int tendonfmu_watches_motors(const tendonfmu_finger* finger) {
  return finger && has_option(finger, MODEL_WATCHES_MOTORS);
}

int tendonfmu_watches_sensors(const tendonfmu_finger* finger) {
  return finger && has_option(finger, MODEL_HAS_SENSOR_FAULT);
}

/* --- samples ------------------------------------------------------------------------------------------------------ */

int tendonfmu_is_initialised(const tendonfmu_finger* finger) {
  return finger && !is_first(finger);
}

double tendonfmu_get_time(const tendonfmu_finger* finger) {
  return finger ? finger->remembered.scalar[STATE_TIME] : 0.0;
}

int tendonfmu_get_kinematics_source(const tendonfmu_finger* finger) {
  return finger ? source_of(finger) : 0;
}

tendonfmu_status tendonfmu_set_kinematics_source(tendonfmu_finger* finger, int source) {
  if (!finger) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  if (source < TENDONFMU_TENDON_POSITIONS || source > TENDONFMU_JOINT_VELOCITIES) {
    return fail(finger, TENDONFMU_BAD_PARAMETER,
                "kinematics_source: expected 1 (tendon positions), 2 (joint positions) "
                "or 3 (joint positions and velocities)");
  }
  if (tendonfmu_is_initialised(finger)) {
    return fail(finger, TENDONFMU_WRONG_ORDER, "kinematics_source is fixed once the first sample is taken");
  }
  finger->remembered.scalar[STATE_SOURCE] = source;
  recall_sample(finger); /* measured angles need no rows */
  return TENDONFMU_OK;
}

static tendonfmu_status take(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs) {
  const int taken = samples_take_inputs(finger, time, inputs, error_line(finger));
  if (taken <= 0) {
    return taken ? TENDONFMU_BAD_SAMPLE : TENDONFMU_OK;
  }
  if (take_sample(finger, time)) {
    recall_sample(finger);
    return fail(finger, TENDONFMU_BAD_SAMPLE,
                "the sample at time %g s overflows: expected forces and velocities whose torques are finite", time);
  }
  return TENDONFMU_OK;
}

static tendonfmu_status already_taken(const tendonfmu_finger* finger) {
  return fail(finger, TENDONFMU_WRONG_ORDER, "the first sample is already taken: expected a reset before another one");
}

tendonfmu_status tendonfmu_initialise(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs) {
  if (!finger || !inputs) {
    return missing(finger);
  }
  if (tendonfmu_is_initialised(finger)) {
    return already_taken(finger);
  }
  return take(finger, time, inputs);
}

tendonfmu_status tendonfmu_step(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs) {
  if (!finger || !inputs) {
    return missing(finger);
  }
  if (!tendonfmu_is_initialised(finger)) {
    return fail(finger, TENDONFMU_WRONG_ORDER, "a step before the first sample: expected tendonfmu_initialise()");
  }
  return take(finger, time, inputs);
}

/* of a row, after that of the row before; the bias begins with the first sample that it may learn from */
static sample_guide guide_of_row(const tendonfmu_finger* finger, const tendonfmu_guide* guide, size_t row) {
  const sample_guide before = finger->guide;
  const int waits = before.begins && !before.learns && !finger->derived.settings.has_initial_torque;
  return (sample_guide){.guides = 1,
                        .begins = row == 0 || waits,
                        .learns = !guide->learns || guide->learns[row],
                        .known_torque = guide->known_torque ? guide->known_torque + row * finger->joints : NULL};
}

static void give_variance(const tendonfmu_finger* finger, double* variance, size_t row) {
  for (size_t j = 0; variance && j < finger->joints; ++j) {
    variance[row * finger->joints + j] = finger->guide.begins ? NAN : finger->scratch.residual_variance[j];
  }
}

/* guide: NULL where the finger decides itself what the bias learns from */
static tendonfmu_status take_rows(tendonfmu_finger* finger, size_t samples, const double* time,
                                  const tendonfmu_inputs* inputs, const tendonfmu_guide* guide,
                                  const tendonfmu_outputs* outputs, size_t* done) {
  tendonfmu_status status = TENDONFMU_OK;
  size_t row = 0;
  for (; row < samples; ++row) {
    const tendonfmu_inputs sample = samples_row(finger, inputs, row);
    finger->guide = guide ? guide_of_row(finger, guide, row) : (sample_guide){0};
    status = take(finger, time[row], &sample);
    if (status != TENDONFMU_OK) {
      break;
    }
    samples_give_outputs(finger, outputs, row);
    give_variance(finger, guide ? guide->variance : NULL, row);
  }
  finger->guide = (sample_guide){0};
  if (done) {
    *done = row;
  }
  return status;
}

tendonfmu_status tendonfmu_run(tendonfmu_finger* finger, size_t samples, const double* time,
                               const tendonfmu_inputs* inputs, const tendonfmu_outputs* outputs, size_t* done) {
  if (done) {
    *done = 0;
  }
  if (!finger || !inputs || !outputs || (!time && samples)) {
    return missing(finger);
  }
  return take_rows(finger, samples, time, inputs, NULL, outputs, done);
}

tendonfmu_status tendonfmu_run_guided(tendonfmu_finger* finger, size_t samples, const double* time,
                                      const tendonfmu_inputs* inputs, const tendonfmu_guide* guide,
                                      const tendonfmu_outputs* outputs, size_t* done) {
  if (done) {
    *done = 0;
  }
  if (!finger || !inputs || !guide || !outputs || (!time && samples)) {
    return missing(finger);
  }
  if (has_option(finger, MODEL_HAS_SENSOR_FAULT)) {
    return fail(finger, TENDONFMU_BAD_ARGUMENT, "a guided run with sensor_fault: expected a finger without");
  }
  if (samples && tendonfmu_is_initialised(finger)) {
    return already_taken(finger);
  }
  return take_rows(finger, samples, time, inputs, guide, outputs, done);
}

tendonfmu_status tendonfmu_get_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* outputs) {
  if (!finger || !outputs) {
    return missing(finger);
  }
  if (!tendonfmu_is_initialised(finger)) {
    return fail(finger, TENDONFMU_WRONG_ORDER, "no outputs before the first sample");
  }
  samples_give_outputs(finger, outputs, 0);
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_get_directional_derivative(tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                                                      const tendonfmu_outputs* derivative) {
  if (!finger || !direction || !derivative) {
    return missing(finger);
  }
  if (!tendonfmu_is_initialised(finger)) {
    return fail(finger, TENDONFMU_WRONG_ORDER, "no derivative before the first sample");
  }
  directional_derivative(finger, direction, derivative);
  return TENDONFMU_OK;
}

/* one finger of a hand: its sample, the first one too, and its outputs */
static tendonfmu_status take_with_outputs(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs,
                                          const tendonfmu_outputs* outputs) {
  const tendonfmu_status status = finger ? take(finger, time, inputs) : TENDONFMU_BAD_ARGUMENT;
  if (status == TENDONFMU_OK && outputs) {
    samples_give_outputs(finger, outputs, 0);
  }
  return status;
}

tendonfmu_status tendonfmu_step_hand(size_t count, tendonfmu_finger* const* fingers, double time,
                                     const tendonfmu_inputs* inputs, const tendonfmu_outputs* outputs,
                                     tendonfmu_status* statuses) {
  tendonfmu_status first = TENDONFMU_OK;
  if (count && (!fingers || !inputs)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  for (size_t k = 0; k < count; ++k) {
    const char* to = outputs ? (const char*)outputs + k * outputs_size(outputs) : NULL;
    const tendonfmu_status status = take_with_outputs(fingers[k], time, &inputs[k], (const void*)to);
    if (statuses) {
      statuses[k] = status;
    }
    if (first == TENDONFMU_OK) {
      first = status;
    }
  }
  return first;
}

/* --- parameters --------------------------------------------------------------------------------------------------- */

size_t tendonfmu_parameter_count(const tendonfmu_finger* finger) {
  return finger ? finger->shape.parameter_count : 0;
}

static int has_parameter(const tendonfmu_finger* finger, size_t index) {
  if (index < finger->shape.parameter_count) {
    return 1;
  }
  message_write(error_line(finger), "parameter index %zu: expected below %zu", index,
                (size_t)finger->shape.parameter_count);
  return 0;
}

tendonfmu_status tendonfmu_get_parameter_path(const tendonfmu_finger* finger, size_t index, char* path,
                                              size_t path_size) {
  if (!finger || !path || !path_size) {
    return missing(finger);
  }
  if (!has_parameter(finger, index)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  char whole[PARAMETER_PATH_BYTES];
  const model_item item = parameter_item(&finger->shape, (uint32_t)index);
  parameter_path(&item, (uint32_t)index, whole);
  if (strlen(whole) + 1 > path_size) {
    return fail(finger, TENDONFMU_BAD_ARGUMENT, "path_size is too small: 80 bytes are enough");
  }
  memcpy(path, whole, strlen(whole) + 1);
  return TENDONFMU_OK;
}

size_t tendonfmu_find_parameter(const tendonfmu_finger* finger, const char* path) {
  return finger && path ? parameter_find(&finger->shape, path) : tendonfmu_parameter_count(finger);
}

tendonfmu_status tendonfmu_get_parameter_info(const tendonfmu_finger* finger, size_t index,
                                              tendonfmu_parameter_info* info) {
  if (!finger || !info) {
    return missing(finger);
  }
  if (!has_parameter(finger, index)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  const model_item item = parameter_item(&finger->shape, (uint32_t)index);
  const parameter_range range = parameter_range_of(&item, (uint32_t)index);
  *info = (tendonfmu_parameter_info){.start = finger->start[index],
                                     .minimum = range.minimum,
                                     .maximum = range.maximum,
                                     .above_minimum = range.above_minimum,
                                     .tunable = range.tunable,
                                     .unit = range.unit};
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_get_parameters(const tendonfmu_finger* finger, size_t count, const size_t* indices,
                                          double* values) {
  if (!finger || (count && !values)) {
    return missing(finger);
  }
  for (size_t i = 0; i < count; ++i) {
    if (!has_parameter(finger, indices ? indices[i] : i)) {
      return TENDONFMU_BAD_ARGUMENT;
    }
  }
  for (size_t i = 0; i < count; ++i) {
    values[i] = finger->parameters[indices ? indices[i] : i];
  }
  return TENDONFMU_OK;
}

static int say_fixed(const tendonfmu_finger* finger, const model_item* item, uint32_t index) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(item, index, path);
  return message_write(error_line(finger), "%s is fixed once the first sample is taken", path);
}

typedef struct candidate_check {
  const tendonfmu_finger* finger;
  tendonfmu_status status;
  int routing; /* something moves a tendon */
} candidate_check;

/* checks the numbers of an item that are given; the others, NaN in the candidate, stay as they are */
static int check_candidate(void* context, const model_item* item) {
  candidate_check* c = context;
  double* candidate = c->finger->candidate;
  for (uint32_t i = item->first; i < item->first + item->count; ++i) {
    if (candidate[i] != candidate[i]) {
      candidate[i] = c->finger->parameters[i];
      continue;
    }
    if (parameter_check_value(item, i, candidate[i], error_line(c->finger))) {
      c->status = TENDONFMU_BAD_PARAMETER;
    } else if (tendonfmu_is_initialised(c->finger) && !parameter_range_of(item, i).tunable) {
      say_fixed(c->finger, item, i);
      c->status = TENDONFMU_WRONG_ORDER;
    }
    c->routing |= item->kind == ITEM_MOMENT_ARMS;
  }
  return c->status != TENDONFMU_OK;
}

tendonfmu_status tendonfmu_set_parameters(tendonfmu_finger* finger, size_t count, const size_t* indices,
                                          const double* values) {
  if (!finger || (count && !values)) {
    return missing(finger);
  }
  candidate_check check = {finger, TENDONFMU_OK, 0};
  for (size_t i = 0; i < finger->shape.parameter_count; ++i) {
    finger->candidate[i] = NAN;
  }
  for (size_t i = 0; i < count; ++i) {
    const size_t index = indices ? indices[i] : i;
    if (!has_parameter(finger, index)) {
      return TENDONFMU_BAD_ARGUMENT;
    }
    if (values[i] != values[i]) {
      const model_item item = parameter_item(&finger->shape, (uint32_t)index);
      parameter_check_value(&item, (uint32_t)index, values[i], error_line(finger));
      return TENDONFMU_BAD_PARAMETER;
    }
    finger->candidate[index] = values[i];
  }
  if (model_visit(&finger->shape, check_candidate, &check)) {
    return check.status;
  }
  if (parameter_check_relations(&finger->shape, finger->candidate, error_line(finger)) ||
      (check.routing && parameter_check_routing(&finger->shape, finger->candidate, error_line(finger)))) {
    return TENDONFMU_BAD_PARAMETER;
  }
  memcpy(finger->parameters, finger->candidate, finger->shape.parameter_count * sizeof(double));
  derive_numbers(finger, check.routing);
  return TENDONFMU_OK;
}

typedef struct fixed_search {
  const tendonfmu_finger* finger;
  const double* values; /* [p] */
} fixed_search;

/* names the first parameter of an item that is fixed and has another value */
static int find_fixed(void* context, const model_item* item) {
  const fixed_search* s = context;
  for (uint32_t i = item->first; i < item->first + item->count; ++i) {
    if (s->values[i] != s->finger->parameters[i] && !parameter_range_of(item, i).tunable) {
      return say_fixed(s->finger, item, i);
    }
  }
  return 0;
}

tendonfmu_status tendonfmu_take_parameters(tendonfmu_finger* finger, const tendonfmu_finger* prepared) {
  if (!finger || !prepared) {
    return missing(finger);
  }
  if (prepared->image_id != finger->image_id || prepared->prepared_bytes != finger->prepared_bytes) {
    return fail(finger, TENDONFMU_BAD_ARGUMENT, "prepared: a finger of another image");
  }
  fixed_search search = {finger, prepared->parameters};
  if (tendonfmu_is_initialised(finger) && model_visit(&finger->shape, find_fixed, &search)) {
    return TENDONFMU_WRONG_ORDER;
  }
  take_prepared_numbers(finger, prepared);
  return TENDONFMU_OK;
}

static int find_or_fail(const tendonfmu_finger* finger, const char* path, size_t* index) {
  *index = parameter_find(&finger->shape, path);
  if (*index < finger->shape.parameter_count) {
    return 0;
  }
  return message_write(error_line(finger), "no parameter \"%s\" in this finger", path);
}

tendonfmu_status tendonfmu_get_parameter(const tendonfmu_finger* finger, const char* path, double* value) {
  size_t index;
  if (!finger || !path || !value) {
    return missing(finger);
  }
  if (find_or_fail(finger, path, &index)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  *value = finger->parameters[index];
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_set_parameter(tendonfmu_finger* finger, const char* path, double value) {
  size_t index;
  if (!finger || !path) {
    return missing(finger);
  }
  if (find_or_fail(finger, path, &index)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  return tendonfmu_set_parameters(finger, 1, &index, &value);
}

/* --- state -------------------------------------------------------------------------------------------------------- */

size_t tendonfmu_state_size(const tendonfmu_finger* finger) {
  return finger ? saved_state_size(finger) : 0;
}

tendonfmu_status tendonfmu_save_state(const tendonfmu_finger* finger, void* bytes, size_t size) {
  if (!finger || !bytes) {
    return missing(finger);
  }
  if (size != saved_state_size(finger)) {
    return fail(finger, TENDONFMU_BAD_ARGUMENT, "size: expected that of tendonfmu_state_size()");
  }
  save_state(finger, bytes);
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_restore_state(tendonfmu_finger* finger, const void* bytes, size_t size) {
  if (!finger || !bytes) {
    return missing(finger);
  }
  if (size != saved_state_size(finger)) {
    return fail(finger, TENDONFMU_BAD_STATE,
                "saved state of another finger or cut off: expected as many bytes as "
                "tendonfmu_state_size() says");
  }
  return restore_state(finger, bytes, error_line(finger)) ? TENDONFMU_BAD_STATE : TENDONFMU_OK;
}

tendonfmu_status tendonfmu_reset(tendonfmu_finger* finger) {
  if (!finger) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  begin(finger);
  return TENDONFMU_OK;
}

/* --- kernels ------------------------------------------------------------------------------------------------------ */

const char* tendonfmu_get_kernel(const tendonfmu_finger* finger) {
  return finger ? finger->kernel->name : "";
}

tendonfmu_status tendonfmu_set_kernel(tendonfmu_finger* finger, const char* name) {
  if (!finger || !name) {
    return missing(finger);
  }
  const step_kernel* kernel = kernel_choose(name);
  if (!kernel) {
    return fail(finger, TENDONFMU_BAD_ARGUMENT,
                "kernel: expected \"auto\", \"plain\", or \"sse2\", \"avx2\" or \"neon\" where "
                "processor and build have it");
  }
  finger->kernel = kernel;
  recall_sample(finger); /* the kernels fill views by one or by four */
  return TENDONFMU_OK;
}
