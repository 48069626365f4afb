#include "floating_point.h"

#include "finger_memory.h"

#include <float.h>
#include <stddef.h>
#include <string.h>

/* Every array begins at a multiple of 64 bytes, a cache line. The rows of the state follow each other without gaps,
 * each a multiple of 32 bytes: aligned loads in every kernel. */
enum { ROW_BYTES = 64 };

typedef struct cursor {
  unsigned char* base; /* NULL: only count */
  size_t used;
} cursor;

static void* take(cursor* c, size_t bytes) {
  void* place = c->base ? c->base + c->used : NULL;
  c->used += (bytes + ROW_BYTES - 1) / ROW_BYTES * ROW_BYTES;
  return place;
}

static double* take_numbers(cursor* c, size_t count) {
  return take(c, count * sizeof(double));
}

/* consecutive rows, each [count], with no gap: `state` must be one run */
static double* part(double** run, size_t count) {
  double* place = *run;
  *run = place ? place + count : NULL;
  return place;
}

static void lay_out_parameters(tendonfmu_finger* f, cursor* c) {
  const size_t p = f->shape.parameter_count;
  f->start = take_numbers(c, p);
  f->parameters = take_numbers(c, p);
  f->candidate = take_numbers(c, p);
}

static void lay_out_derived(tendonfmu_finger* f, cursor* c) {
  derived_numbers* d = &f->derived;
  const size_t n = f->joints, lanes = f->tendon_lanes, joints = f->joint_lanes;
  const size_t records = 2 + (size_t)f->shape.edge_law_count + 2 * (size_t)f->shape.edge_count;
  size_t angles = 0;
  for (size_t j = 0; j < n; ++j) {
    angles += f->shape.most_points[j] * lanes;
  }
  d->stiffness = take_numbers(c, lanes);
  d->inverse_stiffness = take_numbers(c, lanes);
  d->bidirectional = take_numbers(c, lanes);
  d->tendon_zero = take_numbers(c, lanes);
  d->moment_arm = take_numbers(c, n * lanes);
  d->inverse_routing = take_numbers(c, n * lanes);
  d->pulley_law = take_numbers(c, n * lanes * LAW_NUMBERS);
  d->edge_law = take_numbers(c, records * LAW_NUMBERS);
  d->edge_segment = take_numbers(c, records * 2);
  d->edge_angle = take_numbers(c, angles);
  d->edge_angle_row = take(c, n * sizeof(size_t));
  d->edge_record = take(c, n * lanes * sizeof(uint32_t));
  d->can_hold = take(c, n * lanes / 4);
  d->joint_law = take_numbers(c, joints * LAW_NUMBERS);
  d->load_law = take_numbers(c, joints * LAW_NUMBERS);
  d->cover_stiffness = take_numbers(c, joints);
  d->cover_rest = take_numbers(c, joints);
  d->contact_threshold = take_numbers(c, joints);
  d->contact_per_force = take_numbers(c, joints);
  d->initial_torque = take_numbers(c, joints);
  d->deviation = take_numbers(c, joints);
  d->deviation_per_force = take_numbers(c, joints);
  const size_t banded = f->shape.options & MODEL_DETECTS_BY_BANDS ? n : 0;
  d->band_square = take_numbers(c, banded * BANDS * BAND_NUMBERS);
  d->load_arm = take_numbers(c, banded * lanes);
  const size_t links = f->shape.options & MODEL_HAS_LINKS ? n : 0;
  d->links.axis = take_numbers(c, 3 * links);
  d->links.offset = take_numbers(c, 3 * links);
  d->links.tip = take_numbers(c, links ? 3 : 0);
  d->least_link = take(c, links * sizeof(int));
}

static void lay_out_memory(tendonfmu_finger* f, cursor* c) {
  finger_scratch* s = &f->scratch;
  const size_t slots = f->shape.elements ? f->slots : 0, stretching = f->shape.stretches ? slots : 0;
  f->memory.remembers = take_numbers(c, slots);
  for (size_t e = 0; e < f->shape.elements; ++e) {
    friction_element* element = &f->memory.element[e];
    double** const rows[] = {&element->share, &element->stiffness, &element->per_distance, &element->relaxation_time,
                             &element->kept,  &element->stiff,     &element->soft};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
      *rows[i] = take_numbers(c, slots);
    }
  }
  f->memory.sections = take_numbers(c, stretching);
  s->travelled = take_numbers(c, slots);
  s->own_limit = take_numbers(c, slots ? f->joint_lanes : 0);
  s->element = take_numbers(c, f->shape.elements * 2 * slots);
  s->by_turning = take_numbers(c, 2 * slots);
  s->by_limit = take_numbers(c, 2 * slots);
  s->tension = take_numbers(c, 2 * stretching);
}

static void lay_out_extensions(tendonfmu_finger* f, cursor* c) {
  f->extensions.row = take(c, f->shape.extension_count * sizeof(extension_row));
  f->derived.axis_cosine = take_numbers(c, f->shape.extension_count ? f->joints * f->joints : 0);
  f->scratch.extension = take_numbers(c, f->shape.extension_memory);
  const size_t slots = f->shape.extension_count ? f->slots : 0;
  f->scratch.grip = take_numbers(c, slots);
  f->scratch.bias_grip = take_numbers(c, slots);
  lay_out_memory(f, c);
}

#define AT(name)     offsetof(finger_state, name)
#define ANYTHING     -DBL_MAX, DBL_MAX, 0
#define FLAG         0.0, 1.0, 1
#define SIGN         -1.0, 1.0, 1
#define UP_TO(most)  0.0, most, 0
#define WITHIN(most) -(most), most, 0

const state_row state_rows[] = {
    {AT(angle), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(speed), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(torque), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(friction), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(compensated), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(bias), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(joint_contact), ROW_OF_JOINTS, 1, 0, FLAG, 0},
    {AT(variance), ROW_OF_JOINTS, 1, 0, UP_TO(LARGEST_SQUARE), 1},
    {AT(gain), ROW_OF_JOINTS, 1, 0, UP_TO(1.0), 1},
    {AT(residual), ROW_OF_JOINTS, 1, 0, ANYTHING, 0},
    {AT(level), ROW_OF_JOINTS, 1, 0, UP_TO(LARGEST_SUM), 0},
    {AT(total_variance), ROW_OF_JOINTS, 1, 0, UP_TO(DBL_MAX), 1},
    {AT(force), ROW_OF_TENDONS, 1, 0, ANYTHING, 0},
    {AT(slack), ROW_OF_TENDONS, 1, 0, FLAG, 0},
    {AT(moving), ROW_OF_SLOTS, 1, 0, FLAG, 0},
    {AT(side), ROW_OF_SLOTS, 1, 0, SIGN, 0},
    {AT(side_before), ROW_OF_SLOTS, 1, 0, SIGN, 0},
    {AT(event), ROW_OF_SLOTS, 1, 0, SIGN, 0},
    {AT(stuck_since), ROW_OF_SLOTS, 1, 0, -LARGEST_TIME, LARGEST_SQUARE, 0, 1}, /* of time, or of absorption */
    {AT(last_stuck), ROW_OF_SLOTS, 1, 0, WITHIN(LARGEST_TIME), 1},
    {AT(jumped), ROW_OF_JOINTS, 1, MODEL_DETECTS_BY_BANDS, WITHIN(LARGEST_SUM), 0},
    {AT(bands), ROW_OF_BANDS, 1, MODEL_DETECTS_BY_BANDS, WITHIN(2.0 * LARGEST_SUM), 1},
    {AT(sensor), ROW_OF_TENDONS, SENSOR_ROWS, MODEL_HAS_SENSOR_FAULT, ANYTHING, 1},
    {AT(watch), ROW_OF_JOINTS, 1, MODEL_HAS_SENSOR_FAULT, 0.0, JOINT_BEGINS_ANEW, 1, 0},
    {AT(element), ROW_OF_ELEMENTS, 2, 0, WITHIN(LARGEST_SUM), 1},
    {AT(by_turning), ROW_OF_MEMORY, 2, 0, ANYTHING, 1},
    {AT(by_limit), ROW_OF_MEMORY, 2, 0, ANYTHING, 1},
    {AT(tension), ROW_OF_CORDS, 2, 0, ANYTHING, 1},
    {AT(extension), ROW_OF_EXTENSIONS, 1, 0, ANYTHING, 1},
};
const size_t state_row_count = sizeof state_rows / sizeof state_rows[0];

size_t state_row_length(const tendonfmu_finger* finger, const state_row* row) {
  if ((finger->shape.options & row->option) != row->option) {
    return 0;
  }
  switch (row->lanes) {
    case ROW_OF_JOINTS: return row->rows * finger->joint_lanes;
    case ROW_OF_TENDONS: return row->rows * finger->tendon_lanes;
    case ROW_OF_SLOTS: return row->rows * finger->slots;
    case ROW_OF_MEMORY: return finger->shape.elements ? row->rows * finger->slots : 0;
    case ROW_OF_ELEMENTS: return finger->shape.elements * row->rows * finger->slots;
    case ROW_OF_CORDS: return finger->shape.elements && finger->shape.stretches ? row->rows * finger->slots : 0;
    case ROW_OF_BANDS: return finger->joint_lanes * (sizeof(band_memory) / sizeof(double));
    default: return finger->shape.extension_memory;
  }
}

static void lay_out_state(tendonfmu_finger* f, cursor* c) {
  f->state_count = STATE_SCALARS;
  for (size_t k = 0; k < state_row_count; ++k) {
    f->state_count += state_row_length(f, &state_rows[k]);
  }
  f->state = take_numbers(c, f->state_count);
  double* run = f->state;
  f->remembered.scalar = part(&run, STATE_SCALARS);
  for (size_t k = 0; k < state_row_count; ++k) {
    double** pointer = (double**)(void*)((char*)&f->remembered + state_rows[k].place);
    *pointer = part(&run, state_row_length(f, &state_rows[k]));
  }
}

static void lay_out_scratch(tendonfmu_finger* f, cursor* c) {
  finger_scratch* s = &f->scratch;
  const size_t matrix = f->joints * f->tendon_lanes;
  double** const tendon_rows[] = {&s->force, &s->position, &s->slack};
  double** const joint_rows[] = {&s->angle,     &s->torque,           &s->friction,      &s->bias_step,
                                 &s->load,      &s->joint_friction,   &s->load_friction, &s->joint_bias,
                                 &s->load_bias, &s->residual_variance};
  double** const band_rows[] = {&s->slip_torque, &s->limit, &s->motor_load, &s->unknown};
  double** const limit_rows[] = {&s->edge_limit, &s->pulley_limit};
  const int banded = (f->shape.options & MODEL_DETECTS_BY_BANDS) != 0;
  double** const matrices[] = {&s->edge, &s->pulley, &s->edge_bias, &s->pulley_bias, &s->force_at, &s->force_between};
  for (size_t i = 0; i < sizeof tendon_rows / sizeof tendon_rows[0]; ++i) {
    *tendon_rows[i] = take_numbers(c, f->tendon_lanes);
  }
  for (size_t i = 0; i < sizeof joint_rows / sizeof joint_rows[0]; ++i) {
    *joint_rows[i] = take_numbers(c, f->joint_lanes);
  }
  for (size_t i = 0; i < sizeof matrices / sizeof matrices[0]; ++i) {
    *matrices[i] = take_numbers(c, matrix);
  }
  for (size_t i = 0; i < sizeof band_rows / sizeof band_rows[0]; ++i) {
    *band_rows[i] = take_numbers(c, banded ? f->joint_lanes : 0);
  }
  for (size_t i = 0; i < sizeof limit_rows / sizeof limit_rows[0]; ++i) {
    *limit_rows[i] = take_numbers(c, banded ? f->slots : 0);
  }
  const size_t sensors = f->shape.options & MODEL_HAS_SENSOR_FAULT ? 1 : 0;
  s->sensor = take_numbers(c, sensors * SENSOR_ROWS * f->tendon_lanes);
  s->watch = take_numbers(c, sensors * f->joint_lanes);
  s->inverse_routing = take_numbers(c, sensors * f->joints * f->tendon_lanes);
  s->leverage = take_numbers(c, sensors * f->tendon_lanes);
  s->determined = take_numbers(c, sensors * f->tendon_lanes);
  s->row_in_use = take_numbers(c, sensors * f->tendon_lanes);
  s->angle_shift = take_numbers(c, sensors * f->joint_lanes);
  s->velocity = take_numbers(c, f->slots);
  s->view = take(c, f->slots / 4 * sizeof *s->view);
}

static size_t lay_out(const model_shape* shape, tendonfmu_finger* f, unsigned char* base, uint32_t** words) {
  cursor c = {base, 0};
  take(&c, sizeof *f);
  f->shape = *shape;
  f->joints = shape->joints;
  f->tendons = shape->tendons;
  f->joint_lanes = (f->joints + 3) / 4 * 4;
  f->tendon_lanes = (f->tendons + 3) / 4 * 4;
  f->slots = f->joints * f->tendon_lanes + f->joint_lanes;
  *words = take(&c, sizeof(uint32_t) * (shape->word_count + (size_t)MODEL_EXTENSION_WORDS * shape->extension_count));
  lay_out_parameters(f, &c);
  lay_out_derived(f, &c);
  lay_out_state(f, &c);
  lay_out_extensions(f, &c);
  lay_out_scratch(f, &c);
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
