#include "floating_point.h"

#include "step.h"

#include <float.h>
#include <string.h>

#include "bytes.h"
#include "parameters.h"

enum { HEADER_BYTES = 40, HASHED_FROM = 32, STATE_VERSION = 4 };

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

/* whether lane i of such a row stands for something */
static int is_in_use(const tendonfmu_finger* f, row_unit unit, size_t i) {
  const size_t joint_row = f->joints * f->tendon_lanes;
  switch (unit) {
    case OF_JOINTS: return i < f->joints;
    case OF_TENDONS: return i < f->tendons;
    case OF_SLOTS: return i < joint_row ? i % f->tendon_lanes < f->tendons : i - joint_row < f->joints;
    default: return 1;
  }
}

static double bound_of(unsigned char bound) {
  static const double size[] = {
      0.0, 1.0, 2.0, 3.0, LARGEST_TIME, 2.0 * LARGEST_TIME, LARGEST_SUM, 2.0 * LARGEST_SUM, LARGEST_SQUARE, DBL_MAX};
  return bound & MINUS ? -size[bound & ~MINUS] : size[bound];
}

/* whether number `part` of a row in lane i is within limits; those of lanes that stand for nothing are 0 */
static int is_within(const tendonfmu_finger* f, const finger_row* row, size_t part, size_t i, double value) {
  const finger_row* limits = row->parts ? row->parts + part : row;
  const int tied = !limits->spare && !is_in_use(f, row->unit, i);
  const double low = tied ? 0.0 : bound_of(limits->low), high = tied ? 0.0 : bound_of(limits->high);
  return value >= low && value <= high && (!limits->whole || value == (double)(int)value); /* NaN is neither */
}

static int rows_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const unsigned char* from = state;
  for (const finger_row* row = state_rows; row < state_rows + state_row_count; ++row) {
    const size_t parts = row_count(f, row) * row->pointers, lanes = unit_length(f, row->unit);
    for (size_t k = 0; k < parts * lanes; ++k, from += 8) {
      if (!is_within(f, row, k / lanes, k % lanes, load_f64(from))) {
        return 0;
      }
    }
  }
  return has_option(f, MODEL_HAS_SENSOR_FAULT) || load_f64(state + 8 * STATE_UNWELL) == 0.0;
}

/* where a row of the finger stands in a saved state */
static const unsigned char* saved_row(const tendonfmu_finger* f, const unsigned char* state, const double* row) {
  return state + 8 * (size_t)(row - f->state);
}

/* times that may not lie ahead */
static int bands_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const double time = load_f64(state + 8 * STATE_TIME);
  for (size_t j = 0; has_option(f, MODEL_DETECTS_BY_BANDS) && j < f->joints; ++j) {
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
  const int absorbs = has_option(f, MODEL_FORGETS_BY_ABSORPTION);
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
    return message_write(message, "not a saved state of this version: it does not begin with \"TFMUSTA\" and 4");
  }
  if (load_u32(from + 12) != 0 || load_u64(from + 16) != size || load_u64(from + 32) != f->image_id) {
    return message_write(message, "saved state of another finger: size or model image differ");
  }
  if (load_u64(from + 24) != hash_bytes(from + HASHED_FROM, size - HASHED_FROM, 0)) {
    return message_write(message, "damaged saved state: its checksum does not match");
  }
  const unsigned char* state = from + HEADER_BYTES + 8 * p;
  if (!rows_are_sound(f, state) || !bands_are_sound(f, state) || !rests_are_sound(f, state)) {
    return message_write(message, "damaged saved state: a number is out of its range");
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
  recall_sample(finger);
  return 0;
}
