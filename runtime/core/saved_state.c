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

/* Which lanes of a row stand for something; the others hold 0 unless the row says otherwise. */
typedef enum row_kind { ROW_OF_JOINTS, ROW_OF_TENDONS, ROW_OF_SLOTS, ROW_WITHOUT_LANES } row_kind;

/* What may stand in a row of the remembered numbers. */
typedef struct row_rule {
  const double* row;
  size_t count;
  row_kind kind;
  double low, high;
  int whole;       /* whole numbers only */
  int spare_lanes; /* in lanes that stand for nothing, too: they are tracked along */
} row_rule;

static int is_in_use(const tendonfmu_finger* f, row_kind kind, size_t i) {
  const size_t joint_row = f->joints * f->tendon_lanes;
  switch (kind) {
    case ROW_OF_JOINTS: return i < f->joints;
    case ROW_OF_TENDONS: return i < f->tendons;
    case ROW_OF_SLOTS: return i < joint_row ? i % f->tendon_lanes < f->tendons : i - joint_row < f->joints;
    default: return 1;
  }
}

static int row_is_sound(const tendonfmu_finger* f, const unsigned char* state, const row_rule* rule) {
  const unsigned char* from = state + 8 * (size_t)(rule->row - f->state);
  for (size_t i = 0; i < rule->count; ++i, from += 8) {
    const int tied = !rule->spare_lanes && !is_in_use(f, rule->kind, i);
    const double value = load_f64(from), low = tied ? 0.0 : rule->low, high = tied ? 0.0 : rule->high;
    if (!(value >= low && value <= high) || (rule->whole && value != (double)(int)value)) {
      return 0; /* NaN is neither */
    }
  }
  return 1;
}

static int rows_are_sound(const tendonfmu_finger* f, const unsigned char* state, const row_rule* rules, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    if (!row_is_sound(f, state, rules + k)) {
      return 0;
    }
  }
  return 1;
}

static int scalars_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const double* s = f->remembered.scalar;
  const double rests = f->derived.settings.watches_rest ? 1.0 : 0.0;
  const double drifts = f->derived.settings.watches_drift ? 1.0 : 0.0;
  const row_rule rules[] = {
      {s + STATE_INITIALISED, 1, ROW_WITHOUT_LANES, 0.0, 1.0, 1, 0},
      {s + STATE_SOURCE, 1, ROW_WITHOUT_LANES, 1.0, 3.0, 1, 0},
      {s + STATE_TIME, 1, ROW_WITHOUT_LANES, -LARGEST_TIME, LARGEST_TIME, 0, 0},
      {s + STATE_FIRST_SAMPLE, 1, ROW_WITHOUT_LANES, 0.0, 1.0, 1, 0},
      {s + STATE_VELOCITY_GAIN, 1, ROW_WITHOUT_LANES, 0.0, DBL_MAX, 0, 0},
      {s + STATE_CONTACT, 1, ROW_WITHOUT_LANES, 0.0, 1.0, 1, 0},
      {s + STATE_CONTACT_SINCE, 1, ROW_WITHOUT_LANES, -LARGEST_TIME, LARGEST_TIME, 0, 0},
      {s + STATE_ABSORBED, 2, ROW_WITHOUT_LANES, 0.0, LARGEST_SQUARE, 0, 0}, /* and the one before */
      {s + STATE_STANDING, 1, ROW_WITHOUT_LANES, 0.0, rests, 1, 0},
      {s + STATE_MARKED_AT, 1, ROW_WITHOUT_LANES, -LARGEST_TIME * rests, LARGEST_TIME * rests, 0, 0},
      {s + STATE_CONTACT_AT_REST, 1, ROW_WITHOUT_LANES, 0.0, rests, 1, 0},
      {s + STATE_RECENT_AT, 1, ROW_WITHOUT_LANES, -LARGEST_TIME * rests, LARGEST_TIME * rests, 0, 0},
      {s + STATE_STARTED_AT, 1, ROW_WITHOUT_LANES, -LARGEST_TIME * drifts, LARGEST_TIME * drifts, 0, 0},
      {s + STATE_UNWELL, 1, ROW_WITHOUT_LANES, 0.0, f->derived.settings.watches_sensors ? 1.0 : 0.0, 1, 0},
      {s + STATE_START_OPEN, 1, ROW_WITHOUT_LANES, 0.0, f->derived.settings.has_start_share ? 1.0 : 0.0, 1, 0},
  };
  return rows_are_sound(f, state, rules, sizeof rules / sizeof rules[0]);
}

static int joints_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const finger_state* s = &f->remembered;
  const double* const any[] = {s->angle, s->speed,    s->torque,     s->friction, s->compensated,
                               s->bias,  s->residual, s->innovation, s->tracked};
  const size_t n = f->joint_lanes;
  const row_rule rules[] = {
      {s->joint_contact, n, ROW_OF_JOINTS, 0.0, 1.0, 1, 0},
      {s->variance, n, ROW_OF_JOINTS, 0.0, LARGEST_SQUARE, 0, 1},
      {s->gain, n, ROW_OF_JOINTS, 0.0, 1.0, 0, 1},
      {s->stuck_friction, n, ROW_OF_JOINTS, 0.0, LARGEST_SUM, 0, 0},
      {s->friction_jump, n, ROW_OF_JOINTS, 0.0, LARGEST_SUM, 0, 0},
      {s->evidence, n, ROW_OF_JOINTS, 0.0, LARGEST_TIME, 0, 0},
      {s->exceeded_at, n, ROW_OF_JOINTS, -LARGEST_TIME, LARGEST_TIME, 0, 0},
      {s->total_variance, n, ROW_OF_JOINTS, 0.0, DBL_MAX, 0, 1},
  };
  for (size_t k = 0; k < sizeof any / sizeof any[0]; ++k) {
    const row_rule rule = {any[k], n, ROW_OF_JOINTS, -DBL_MAX, DBL_MAX, 0, 0};
    if (!row_is_sound(f, state, &rule)) {
      return 0;
    }
  }
  return rows_are_sound(f, state, rules, sizeof rules / sizeof rules[0]);
}

static int slots_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const finger_state* s = &f->remembered;
  const size_t slots = f->slots, lanes = f->tendon_lanes, rest = (size_t)(f->state + f->state_count - s->entry_edge);
  const int absorbs = f->derived.settings.forgets_by_absorption;
  const size_t starts = f->derived.settings.has_start_share ? 1 : 0;
  const row_rule rules[] = {
      {s->force, lanes, ROW_OF_TENDONS, -DBL_MAX, DBL_MAX, 0, 0},
      {s->slack, lanes, ROW_OF_TENDONS, 0.0, 1.0, 1, 0},
      {s->moving, slots, ROW_OF_SLOTS, 0.0, 1.0, 1, 0},
      {s->side, slots, ROW_OF_SLOTS, -1.0, 1.0, 1, 0},
      {s->side_before, slots, ROW_OF_SLOTS, -1.0, 1.0, 1, 0},
      {s->event, slots, ROW_OF_SLOTS, -1.0, 1.0, 1, 0},
      {s->stuck_since, slots, ROW_OF_SLOTS, absorbs ? 0.0 : -LARGEST_TIME, absorbs ? LARGEST_SQUARE : LARGEST_TIME, 0,
       1},
      {s->last_stuck, slots, ROW_OF_SLOTS, -LARGEST_TIME, LARGEST_TIME, 0, 1},
      {s->entry_edge, rest, ROW_WITHOUT_LANES, -DBL_MAX, DBL_MAX, 0,
       0}, /* entries, start, parts, filter, rest, sensors, … */
      {s->start_left, starts * slots, ROW_OF_SLOTS, 0.0, 1.0, 0, 0},
      {s->drift_of_late, f->derived.settings.watches_drift ? 5 * f->joint_lanes : 0, ROW_WITHOUT_LANES,
       -2.0 * LARGEST_SUM, 2.0 * LARGEST_SUM, 0, 0}, /* and the four rows after it */
      {s->unlearned, starts * f->joint_lanes, ROW_OF_JOINTS, 0.0, LARGEST_SUM, 0, 0},
  };
  return rows_are_sound(f, state, rules, sizeof rules / sizeof rules[0]);
}

static int filter_is_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const size_t n = f->joint_lanes;
  for (size_t row = 0; f->derived.settings.filters_position && row < FILTER_ROWS; ++row) {
    const int variance = row == FILTER_P00 || row == FILTER_P11 || row == FILTER_P22, flag = row == FILTER_CARRIES;
    const int estimate = row <= FILTER_HELD_ANGLE; /* the rest is tracked in spare lanes, too */
    const row_rule rule = {f->remembered.filter + row * n, n,    ROW_OF_JOINTS, variance || flag ? 0.0 : -DBL_MAX,
                           flag ? 1.0 : DBL_MAX,           flag, !estimate};
    if (!row_is_sound(f, state, &rule)) {
      return 0;
    }
  }
  return 1;
}

static int motors_rest_is_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const finger_state* s = &f->remembered;
  const size_t n = f->joint_lanes, m = f->tendon_lanes;
  const row_rule rules[] = {
      {s->contact_change, n, ROW_OF_JOINTS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->rest_tracked, n, ROW_OF_JOINTS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->rest_contact, n, ROW_OF_JOINTS, 0.0, 1.0, 1, 0},
      {s->rest_extreme, n, ROW_OF_JOINTS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->carried_load, n, ROW_OF_JOINTS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->smooth_force, m, ROW_OF_TENDONS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->mark_force, m, ROW_OF_TENDONS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->mark_position, m, ROW_OF_TENDONS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->recent_force, m, ROW_OF_TENDONS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
      {s->recent_position, m, ROW_OF_TENDONS, -LARGEST_SUM, LARGEST_SUM, 0, 0},
  };
  const double marked_at = load_f64(state + 8 * STATE_MARKED_AT), time = load_f64(state + 8 * STATE_TIME);
  return !f->derived.settings.watches_rest ||
         (marked_at <= time && rows_are_sound(f, state, rules, sizeof rules / sizeof rules[0]));
}

static int sensors_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const size_t m = f->tendon_lanes, n = f->joint_lanes;
  for (size_t row = 0; f->derived.settings.watches_sensors && row < SENSOR_ROWS; ++row) {
    const int time = row == SENSOR_FAULT_SINCE || row == SENSOR_UNSOUND_AT || row == SENSOR_FORCE_HELD_SINCE ||
                     row == SENSOR_POSITION_HELD_SINCE;
    const int flag = row == SENSOR_FAULT || row == SENSOR_KNOWN || row == SENSOR_HAS_TAUT;
    const double most = flag ? (row == SENSOR_FAULT ? POSITION_FAILS : 1.0) : time ? LARGEST_TIME : DBL_MAX;
    const double* at = f->remembered.sensor + row * m;
    const row_rule rule = {at, m, ROW_OF_TENDONS, flag ? 0.0 : -most, most, flag, time};
    if (!row_is_sound(f, state, &rule)) {
      return 0;
    }
  }
  const row_rule watch = {f->remembered.watch, n, ROW_OF_JOINTS, 0.0, JOINT_BEGINS_ANEW, 1, 0};
  return !f->derived.settings.watches_sensors || row_is_sound(f, state, &watch);
}

/* nothing has rested for less than no time: exponents of forgetting are not negative */
static int rests_are_sound(const tendonfmu_finger* f, const unsigned char* state) {
  const finger_state* s = &f->remembered;
  const double absorbed = load_f64(state + 8 * STATE_ABSORBED_BEFORE);
  if (load_f64(state + 8 * STATE_ABSORBED) < absorbed) {
    return 0;
  }
  for (size_t i = 0; i < f->slots; ++i) {
    const double since = load_f64(state + 8 * ((size_t)(s->stuck_since - f->state) + i));
    const double until = load_f64(state + 8 * ((size_t)(s->last_stuck - f->state) + i));
    if (since > (f->derived.settings.forgets_by_absorption ? absorbed : until)) {
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
  if (!scalars_are_sound(f, state) || !joints_are_sound(f, state) || !slots_are_sound(f, state) ||
      !filter_is_sound(f, state) || !motors_rest_is_sound(f, state) || !sensors_are_sound(f, state) ||
      !rests_are_sound(f, state)) {
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
