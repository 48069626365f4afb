#include "floating_point.h"

#include "finger_memory.h"

#include <stddef.h>
#include <string.h>

/* Every array begins at a multiple of 64 bytes, a cache line. The rows of the state follow each other without gaps,
 * each a multiple of 32 bytes: aligned loads in every kernel. */
enum { ROW_BYTES = 64 };

typedef struct cursor {
  unsigned char* base; /* NULL: only count */
  size_t used;
  size_t row_bytes; /* rows begin at multiples of this */
} cursor;

/* NULL for none: what a finger lacks is not found at the place of something else */
static void* take(cursor* c, size_t bytes) {
  c->used = (c->used + c->row_bytes - 1) / c->row_bytes * c->row_bytes;
  void* place = c->base && bytes ? c->base + c->used : NULL;
  c->used += bytes;
  return place;
}

/* --- rows -----------------------------------------------------------------------------------------------------------
 */

#define AT(name)          offsetof(tendonfmu_finger, name)
#define ROWS(first, last) .place = AT(first), .pointers = (AT(last) - AT(first)) / sizeof(double*) + 1
#define ROW(name)         ROWS(name, name)
#define SENSORS(memory)   ROWS(memory.fault, memory.joint_side_then)
#define WITHIN(most)      .low = MINUS | (most), .high = (most)
#define INSTANT           WITHIN(A_TIME), .spare = 1
#define FLAG              .high = ONE, .whole = 1

static const finger_row scalars[STATE_SCALARS] = {
    [STATE_INITIALISED] = {FLAG},
    [STATE_SOURCE] = {.low = ONE, .high = THREE, .whole = 1},
    [STATE_TIME] = {INSTANT},
    [STATE_FIRST_SAMPLE] = {FLAG},
    [STATE_VELOCITY_GAIN] = {.high = ANY_NUMBER},
    [STATE_CONTACT] = {FLAG},
    [STATE_ABSORBED] = {.high = A_SQUARE},
    [STATE_ABSORBED_BEFORE] = {.high = A_SQUARE},
    [STATE_UNWELL] = {FLAG},
    [STATE_STEP] = {.high = TWO_TIMES},
};

/* in the order of sensor_memory */
static const finger_row sensors[SENSOR_NUMBERS] = {
    {.high = TWO, .whole = 1},
    {INSTANT},
    {INSTANT},
    {FLAG},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
    {INSTANT},
    {FLAG},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
    {INSTANT},
    {WITHIN(ANY_NUMBER)},
    {WITHIN(ANY_NUMBER)},
};

const finger_row state_rows[] = {
    {ROW(remembered.scalar), .count = STATE_SCALARS, .parts = scalars},
    {ROWS(remembered.angle, remembered.bias), .unit = OF_JOINTS, WITHIN(ANY_NUMBER)},
    {ROW(remembered.joint_contact), .unit = OF_JOINTS, FLAG},
    {ROW(remembered.variance), .unit = OF_JOINTS, .high = A_SQUARE, .spare = 1},
    {ROW(remembered.gain), .unit = OF_JOINTS, .high = ONE, .spare = 1},
    {ROW(remembered.residual), .unit = OF_JOINTS, WITHIN(ANY_NUMBER)},
    {ROW(remembered.level), .unit = OF_JOINTS, .high = A_SUM},
    {ROW(remembered.total_variance), .unit = OF_JOINTS, .high = ANY_NUMBER, .spare = 1},
    {ROW(remembered.force), .unit = OF_TENDONS, WITHIN(ANY_NUMBER)},
    {ROW(remembered.slack), .unit = OF_TENDONS, FLAG},
    {ROW(remembered.moving), .unit = OF_SLOTS, FLAG},
    {ROW(remembered.side), .unit = OF_SLOTS, WITHIN(ONE), .whole = 1},
    {ROW(remembered.event), .unit = OF_SLOTS, .low = MINUS | THREE, .high = ONE, .whole = 1},
    {ROW(remembered.stuck_since), .unit = OF_SLOTS, .low = MINUS | A_TIME, .high = A_SQUARE, .spare = 1},
    {ROW(remembered.last_stuck), .unit = OF_SLOTS, INSTANT},
    {ROW(remembered.jumped), .unit = OF_JOINTS, .when = MODEL_DETECTS_BY_BANDS, WITHIN(A_SUM)},
    {ROW(remembered.bands), .unit = OF_JOINTS, .count = sizeof(band_memory) / sizeof(double),
     .when = MODEL_DETECTS_BY_BANDS, WITHIN(TWO_SUMS), .spare = 1},
    {SENSORS(remembered.sensor), .unit = OF_TENDONS, .when = MODEL_HAS_SENSOR_FAULT, .parts = sensors},
    {ROW(remembered.watch), .unit = OF_JOINTS, .when = MODEL_HAS_SENSOR_FAULT, .high = TWO, .whole = 1},
    {ROW(remembered.element), .unit = OF_ELEMENTS, .count = 2, .when = WITH_MEMORY, WITHIN(A_SUM), .spare = 1},
    {ROWS(remembered.by_turning, remembered.by_limit), .unit = OF_SLOTS, .count = 2, .when = WITH_MEMORY,
     WITHIN(ANY_NUMBER), .spare = 1},
    {ROW(remembered.held_limit), .unit = OF_SLOTS, .count = 2, .when = WITH_MEMORY, .high = A_SUM, .spare = 1},
    {ROW(remembered.tension), .unit = OF_SLOTS, .count = 2, .when = WITH_CORDS, WITHIN(ANY_NUMBER), .spare = 1},
    {ROW(remembered.extension), .unit = OF_EXTENSIONS, WITHIN(ANY_NUMBER), .spare = 1},
};
const size_t state_row_count = sizeof state_rows / sizeof state_rows[0];

/* what the last of these become with this sample, in the same order */
static const finger_row next_rows[] = {
    {SENSORS(scratch.sensor), .unit = OF_TENDONS, .when = MODEL_HAS_SENSOR_FAULT},
    {ROW(scratch.watch), .unit = OF_JOINTS, .when = MODEL_HAS_SENSOR_FAULT},
    {ROW(scratch.element), .unit = OF_ELEMENTS, .count = 2, .when = WITH_MEMORY},
    {ROWS(scratch.by_turning, scratch.held_limit), .unit = OF_SLOTS, .count = 2, .when = WITH_MEMORY},
    {ROW(scratch.tension), .unit = OF_SLOTS, .count = 2, .when = WITH_CORDS},
    {ROW(scratch.extension), .unit = OF_EXTENSIONS},
};

/* the parameters in force and all that follows from them: one run, which another finger may take over */
static const finger_row prepared_rows[] = {
    {ROW(parameters), .unit = OF_PARAMETERS},
    {ROWS(derived.stiffness, derived.tendon_zero), .unit = OF_TENDONS},
    {ROWS(derived.moment_arm, derived.inverse_routing), .unit = OF_MATRIX},
    {ROW(derived.pulley_law), .unit = OF_MATRIX, .count = LAW_NUMBERS},
    {ROW(derived.edge_law), .unit = OF_RECORDS, .count = LAW_NUMBERS},
    {ROW(derived.edge_segment), .unit = OF_RECORDS, .count = 2},
    {ROW(derived.edge_angle), .unit = OF_ANGLES},
    {ROWS(derived.joint_law, derived.load_law), .unit = OF_JOINTS, .count = LAW_NUMBERS},
    {ROWS(derived.cover_stiffness, derived.deviation_per_force), .unit = OF_JOINTS},
    {ROW(derived.band_square), .unit = OF_JOINTS, .count = BANDS * BAND_NUMBERS, .when = MODEL_DETECTS_BY_BANDS},
    {ROW(derived.load_arm), .unit = OF_MATRIX, .when = MODEL_DETECTS_BY_BANDS},
    {ROWS(derived.links.axis, derived.links.tip), .unit = OF_JOINTS, .count = 3, .when = MODEL_HAS_LINKS},
    {ROW(derived.axis_cosine), .unit = OF_JOINTS, .count = MODEL_MAX_JOINTS, .when = WITH_EXTENSIONS},
    {ROWS(memory.remembers, memory.sections), .unit = OF_SLOTS, .when = WITH_MEMORY},
    {ROWS(memory.element[0].share, memory.element[0].soft), .unit = OF_SLOTS, .when = WITH_MEMORY},
    {ROWS(memory.element[1].share, memory.element[1].soft), .unit = OF_SLOTS, .when = WITH_TWO_ELEMENTS},
};

static const finger_row other_rows[] = {
    {ROWS(start, candidate), .unit = OF_PARAMETERS},
    {ROWS(scratch.grip, scratch.bias_grip), .unit = OF_SLOTS, .when = WITH_EXTENSIONS},
    {ROW(scratch.travelled), .unit = OF_SLOTS, .when = WITH_MEMORY},
    {ROW(scratch.own_limit), .unit = OF_JOINTS, .when = WITH_MEMORY},
    {ROWS(scratch.force, scratch.slack), .unit = OF_TENDONS},
    {ROWS(scratch.angle, scratch.residual_variance), .unit = OF_JOINTS},
    {ROWS(scratch.edge, scratch.force_between), .unit = OF_MATRIX},
    {ROWS(scratch.slip_torque, scratch.young), .unit = OF_JOINTS, .when = MODEL_DETECTS_BY_BANDS},
    {ROWS(scratch.edge_limit, scratch.pulley_limit), .unit = OF_SLOTS, .when = MODEL_DETECTS_BY_BANDS},
    {ROW(scratch.inverse_routing), .unit = OF_MATRIX, .when = MODEL_HAS_SENSOR_FAULT},
    {ROWS(scratch.leverage, scratch.row_in_use), .unit = OF_TENDONS, .when = MODEL_HAS_SENSOR_FAULT},
    {ROW(scratch.angle_shift), .unit = OF_JOINTS, .when = MODEL_HAS_SENSOR_FAULT},
    {ROW(scratch.velocity), .unit = OF_SLOTS},
};

static int is_present(const model_shape* shape, uint32_t when) {
  const uint32_t has = shape->options | (shape->extension_count > 0 ? WITH_EXTENSIONS : 0) |
                       (shape->elements > 0 ? WITH_MEMORY : 0) | (shape->elements > 1 ? WITH_TWO_ELEMENTS : 0) |
                       (shape->elements > 0 && shape->stretches ? WITH_CORDS : 0);
  return (has & when) == when;
}

static size_t edge_records(const model_shape* shape) {
  return 2 + (size_t)shape->edge_law_count + 2 * (size_t)shape->edge_count;
}

static size_t edge_angles(const tendonfmu_finger* f) {
  size_t angles = 0;
  for (size_t j = 0; j < f->joints; ++j) {
    angles += f->shape.most_points[j] * f->tendon_lanes;
  }
  return angles;
}

size_t unit_length(const tendonfmu_finger* f, row_unit unit) {
  switch (unit) {
    case OF_JOINTS: return f->joint_lanes;
    case OF_TENDONS: return f->tendon_lanes;
    case OF_MATRIX: return f->joints * f->tendon_lanes;
    case OF_SLOTS: return f->slots;
    case OF_ELEMENTS: return f->shape.elements * f->slots;
    case OF_PARAMETERS: return f->shape.parameter_count;
    case OF_RECORDS: return edge_records(&f->shape);
    case OF_ANGLES: return edge_angles(f);
    case OF_EXTENSIONS: return f->shape.extension_memory;
    default: return 1;
  }
}

size_t row_count(const tendonfmu_finger* f, const finger_row* row) {
  return !is_present(&f->shape, row->when) ? 0 : row->count ? row->count : 1;
}

static void place_rows(tendonfmu_finger* f, cursor* c, const finger_row* rows, size_t count) {
  for (const finger_row* row = rows; row < rows + count; ++row) {
    double** pointer = (double**)(void*)((char*)f + row->place);
    const size_t bytes = row_count(f, row) * unit_length(f, row->unit) * sizeof(double);
    for (size_t k = 0; k < row->pointers; ++k) {
      pointer[k] = take(c, bytes);
    }
  }
}

static void lay_out_prepared(tendonfmu_finger* f, cursor* c) {
  derived_numbers* d = &f->derived;
  const size_t n = f->joints, matrix = n * f->tendon_lanes;
  take(c, 0); /* to where a row begins */
  const size_t begin = c->used;
  place_rows(f, c, prepared_rows, sizeof prepared_rows / sizeof prepared_rows[0]);
  d->edge_angle_row = take(c, n * sizeof(size_t));
  d->edge_record = take(c, matrix * sizeof(uint32_t));
  d->can_hold = take(c, matrix / 4);
  d->least_link = take(c, is_present(&f->shape, MODEL_HAS_LINKS) ? n * sizeof(int) : 0);
  f->prepared_bytes = c->used - begin;
}

/* rows without gaps; returns how many numbers */
static size_t place_run(tendonfmu_finger* f, cursor* c, const finger_row* rows, size_t count, double** run) {
  take(c, 0); /* to where a row begins */
  const size_t begin = c->used;
  *run = (double*)(void*)(c->base ? c->base + begin : NULL);
  c->row_bytes = sizeof(double);
  place_rows(f, c, rows, count);
  c->row_bytes = ROW_BYTES;
  return (c->used - begin) / sizeof(double);
}

static size_t lay_out(const model_shape* shape, tendonfmu_finger* f, unsigned char* base, uint32_t** words) {
  cursor c = {base, 0, ROW_BYTES};
  take(&c, sizeof *f);
  f->shape = *shape;
  f->joints = shape->joints;
  f->tendons = shape->tendons;
  f->joint_lanes = (f->joints + 3) / 4 * 4;
  f->tendon_lanes = (f->tendons + 3) / 4 * 4;
  f->slots = f->joints * f->tendon_lanes + f->joint_lanes;
  *words = take(&c, sizeof(uint32_t) * (shape->word_count + (size_t)MODEL_EXTENSION_WORDS * shape->extension_count));
  f->state_count = place_run(f, &c, state_rows, state_row_count, &f->state);
  f->next_count = place_run(f, &c, next_rows, sizeof next_rows / sizeof next_rows[0], &f->next);
  lay_out_prepared(f, &c);
  place_rows(f, &c, other_rows, sizeof other_rows / sizeof other_rows[0]);
  f->extensions.signal = take(&c, f->shape.extension_count * sizeof(extension_row));
  f->scratch.shares = take(&c, is_present(shape, MODEL_DETECTS_BY_BANDS) ? sizeof(band_shares) : 0);
  f->scratch.view = take(&c, f->slots / 4 * sizeof(slot_view));
  return c.used;
}

size_t finger_memory_size(const model_shape* shape) {
  tendonfmu_finger counted;
  uint32_t* words;
  return lay_out(shape, &counted, NULL, &words) + ROW_BYTES; /* room to align what the caller gives */
}

tendonfmu_finger* finger_lay_out(const model_shape* shape, void* memory, uint32_t** words) {
  const size_t size = finger_memory_size(shape);
  memset(memory, 0, size);
  const size_t skip = (ROW_BYTES - (uintptr_t)memory % ROW_BYTES) % ROW_BYTES;
  unsigned char* base = (unsigned char*)memory + skip;
  tendonfmu_finger* finger = (tendonfmu_finger*)(void*)base;
  lay_out(shape, finger, base, words);
  return finger;
}
