#include "floating_point.h"

#include "saved_state.h"

#include <float.h>
#include <string.h>

#include "bytes.h"
#include "derived_numbers.h"
#include "kernel_choice.h"
#include "parameters.h"
#include "rows_in_use.h"

enum { HEADER_BYTES = 40, HASHED_FROM = 32, STATE_VERSION = 1 };

static const char magic[8] = "TFMUSTA";

size_t saved_state_size(const tendonfmu_finger* finger) {
  return HEADER_BYTES + sizeof(double) * (finger->shape.parameter_count + finger->state_count);
}

void save_state(const tendonfmu_finger* finger, void* bytes) {
  unsigned char* to = bytes;
  const size_t size = saved_state_size(finger), p = finger->shape.parameter_count;
  memset(to, 0, HEADER_BYTES);
  memcpy(to, magic, sizeof magic);
  store_u32(to + 8, STATE_VERSION);
  store_u64(to + 16, size);
  store_u64(to + 32, finger->image_id);
  store_doubles(to + HEADER_BYTES, finger->parameters, p);
  store_doubles(to + HEADER_BYTES + 8 * p, finger->state, finger->state_count);
  store_u64(to + 24, hash_bytes(to + HASHED_FROM, size - HASHED_FROM, 0));
}

static int refuse(message_line message, const char* reason) {
  message_start(message, reason);
  return -1;
}

/* whether element i of such a row stands for something */
static int is_in_use(const tendonfmu_finger* f, row_lanes lanes, size_t i) {
  const size_t joint_row = f->joints * f->tendon_lanes;
  switch (lanes) {
    case ROW_OF_JOINTS: return i < f->joints;
    case ROW_OF_TENDONS: return i < f->tendons;
    case ROW_OF_SLOTS: return i < joint_row ? i % f->tendon_lanes < f->tendons : i - joint_row < f->joints;
    default: return 1;
  }
}

/* whether numbers that begin at `from` are all within bounds; those of lanes that stand for nothing are 0 */
static int row_is_sound(const tendonfmu_finger* f, const unsigned char* from, const state_row* row, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const int tied = !row->spare_lanes && !is_in_use(f, row->lanes, i);
    const double value = load_f64(from + 8 * i), low = tied ? 0.0 : row->low, high = tied ? 0.0 : row->high;
    if (!(value >= low && value <= high) || (row->whole && value != (double)(int)value)) {
      return 0; /* NaN is neither */
    }
  }
  return 1;
}

static int rows_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const unsigned char* from = state + 8 * STATE_SCALARS;
  for (size_t k = 0; k < state_row_count; ++k) {
    const size_t count = state_row_length(f, &state_rows[k]);
    if (!row_is_sound(f, from, &state_rows[k], count)) {
      return 0;
    }
    from += 8 * count;
  }
  return 1;
}

static int scalars_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const finger_settings* has = &f->derived.settings;
  const double sensors = has->watches_sensors ? 1.0 : 0.0;
  const struct {
    double low, high;
    int whole;
  } rules[STATE_SCALARS] = {[STATE_INITIALISED] = {0.0, 1.0, 1},
                            [STATE_SOURCE] = {1.0, 3.0, 1},
                            [STATE_TIME] = {-LARGEST_TIME, LARGEST_TIME, 0},
                            [STATE_FIRST_SAMPLE] = {0.0, 1.0, 1},
                            [STATE_VELOCITY_GAIN] = {0.0, DBL_MAX, 0},
                            [STATE_CONTACT] = {0.0, 1.0, 1},
                            [STATE_ABSORBED] = {0.0, LARGEST_SQUARE, 0},
                            [STATE_ABSORBED_BEFORE] = {0.0, LARGEST_SQUARE, 0},
                            [STATE_UNWELL] = {0.0, sensors, 1},
                            [STATE_STEP] = {0.0, 2.0 * LARGEST_TIME, 0}};
  for (size_t k = 0; k < STATE_SCALARS; ++k) {
    const state_row row = {.low = rules[k].low, .high = rules[k].high, .whole = rules[k].whole, .spare_lanes = 1};
    if (!row_is_sound(f, state + 8 * k, &row, 1)) {
      return 0;
    }
  }
  return 1;
}

/* where a row of the finger stands in a saved state */
static const unsigned char* saved_row(const tendonfmu_finger* f, const unsigned char* state, const double* row) {
  return state + 8 * (size_t)(row - f->state);
}

static int sensors_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const size_t m = f->tendon_lanes;
  for (size_t k = 0; f->derived.settings.watches_sensors && k < SENSOR_ROWS; ++k) {
    const int time = k == SENSOR_FAULT_SINCE || k == SENSOR_UNSOUND_AT || k == SENSOR_FORCE_HELD_SINCE ||
                     k == SENSOR_POSITION_HELD_SINCE;
    const int flag = k == SENSOR_FAULT || k == SENSOR_KNOWN || k == SENSOR_HAS_TAUT;
    const double most = flag ? (k == SENSOR_FAULT ? POSITION_FAILS : 1.0) : time ? LARGEST_TIME : DBL_MAX;
    const state_row row = {
        .lanes = ROW_OF_TENDONS, .low = flag ? 0.0 : -most, .high = most, .whole = flag, .spare_lanes = time};
    if (!row_is_sound(f, saved_row(f, state, f->remembered.sensor + k * m), &row, m)) {
      return 0;
    }
  }
  return 1;
}

/* times that may not lie ahead */
static int bands_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const double time = load_f64(state + 8 * STATE_TIME);
  for (size_t j = 0; f->derived.settings.has_bands && j < f->joints; ++j) {
    band_memory joint;
    const unsigned char* from = saved_row(f, state, (const double*)(const void*)bands_of(f, j));
    load_doubles((double*)(void*)&joint, from, sizeof joint / sizeof(double));
    if (joint.begun_at > time || joint.touched_at > time) {
      return 0;
    }
  }
  return 1;
}

/* nothing has rested for less than no time: exponents of forgetting are not negative */
static int rests_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const int absorbs = f->derived.settings.forgets_by_absorption;
  const double absorbed = load_f64(state + 8 * STATE_ABSORBED_BEFORE);
  if (load_f64(state + 8 * STATE_ABSORBED) < absorbed) {
    return 0;
  }
  for (size_t i = 0; i < f->slots; ++i) {
    const double since = load_f64(saved_row(f, state, f->remembered.stuck_since) + 8 * i);
    const double until = load_f64(saved_row(f, state, f->remembered.last_stuck) + 8 * i);
    if (absorbs ? since < 0.0 || since > absorbed : since > until) {
      return 0;
    }
  }
  return 1;
}

static int check_bytes(tendonfmu_finger* f, const unsigned char* from, message_line message) {
  const size_t size = saved_state_size(f), p = f->shape.parameter_count;
  if (memcmp(from, magic, sizeof magic) != 0 || load_u32(from + 8) != STATE_VERSION) {
    return refuse(message, "not a saved state of this version: it does not begin with \"TFMUSTA\" and 1");
  }
  if (load_u32(from + 12) != 0 || load_u64(from + 16) != size || load_u64(from + 32) != f->image_id) {
    return refuse(message, "saved state of another finger: size or model image differ");
  }
  if (load_u64(from + 24) != hash_bytes(from + HASHED_FROM, size - HASHED_FROM, 0)) {
    return refuse(message, "damaged saved state: its checksum does not match");
  }
  const unsigned char* state = from + HEADER_BYTES + 8 * p;
  if (!scalars_are_sound(f, state) || !rows_are_sound(f, state) || !sensors_are_sound(f, state) ||
      !bands_are_sound(f, state) || !rests_are_sound(f, state)) {
    return refuse(message, "damaged saved state: a number is out of its range");
  }
  load_doubles(f->candidate, from + HEADER_BYTES, p);
  const int same = memcmp(f->candidate, f->parameters, p * sizeof(double)) == 0;
  return same ? 0 : parameter_check_all(&f->shape, f->candidate, message);
}

int restore_state(tendonfmu_finger* finger, const void* bytes, message_line message) {
  const unsigned char* from = bytes;
  const size_t p = finger->shape.parameter_count;
  if (check_bytes(finger, from, message)) {
    return -1;
  }
  load_doubles(finger->state, from + HEADER_BYTES + 8 * p, finger->state_count);
  if (memcmp(finger->parameters, finger->candidate, p * sizeof(double)) != 0) {
    memcpy(finger->parameters, finger->candidate, p * sizeof(double));
    derive_numbers(finger, 1);
  }
  recall_rows(finger);
  forget_views(finger); /* they follow the side of the last moving sample, which is another one now */
  return 0;
}
