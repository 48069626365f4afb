#include "floating_point.h"

#include "saved_state.h"

#include <math.h>
#include <string.h>

#include "bytes.h"
#include "derived_numbers.h"
#include "parameters.h"

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

static int is_flag(double x) {
  return x == 0.0 || x == 1.0;
}

static int is_sign(double x) {
  return x == -1.0 || x == 0.0 || x == 1.0;
}

/* 1 when the number at `bytes` may stand at `index` of the remembered numbers */
static int number_is_sound(const tendonfmu_finger* f, size_t index, double value) {
  const finger_state* s = &f->remembered;
  const size_t moving = (size_t)(s->moving - f->state), side = (size_t)(s->side - f->state);
  const size_t since = (size_t)(s->stuck_since - f->state), contact = (size_t)(s->joint_contact - f->state);
  const size_t slack = (size_t)(s->slack - f->state);
  if (!isfinite(value)) {
    return 0;
  }
  if (index == STATE_SOURCE) {
    return value == 1.0 || value == 2.0 || value == 3.0;
  }
  if (index == STATE_INITIALISED || index == STATE_FIRST_SAMPLE || index == STATE_CONTACT ||
      (index >= moving && index < side) || (index >= contact && index < contact + f->joint_lanes) ||
      (index >= slack && index < moving)) {
    return is_flag(value);
  }
  if (index >= side && index < since) {
    return is_sign(value);
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
  for (size_t i = 0; i < f->state_count; ++i) {
    if (!number_is_sound(f, i, load_f64(from + HEADER_BYTES + 8 * (p + i)))) {
      return refuse(message, "damaged saved state: a number in it cannot be");
    }
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
  forget_views(finger); /* they follow the side of the last moving sample, which is another one now */
  return 0;
}
