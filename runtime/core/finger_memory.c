#include "floating_point.h"

#include "finger_memory.h"

#include "presliding_step.h"

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
  d->position_variance = take_numbers(c, f->shape.options & MODEL_HAS_POSITION_FILTER ? joints : 0);
  d->contact_threshold = take_numbers(c, joints);
  d->contact_per_force = take_numbers(c, joints);
  d->initial_torque = take_numbers(c, joints);
  d->innovation_threshold = take_numbers(c, joints);
  d->innovation_per_force = take_numbers(c, joints);
  d->deviation = take_numbers(c, joints);
  d->deviation_per_force = take_numbers(c, joints);
  const size_t drifting = f->shape.options & MODEL_HAS_DRIFT ? joints : 0;
  d->drift_threshold = take_numbers(c, drifting);
  d->drift_per_force = take_numbers(c, drifting);
  const size_t resting = f->shape.options & MODEL_HAS_REST ? joints : 0;
  d->rest_threshold = take_numbers(c, resting);
  d->rest_per_force = take_numbers(c, resting);
  d->rest_creep = take_numbers(c, resting);
  d->rest_innovation = take_numbers(c, resting);
  const size_t links = f->shape.options & MODEL_HAS_LINKS ? n : 0;
  d->links.axis = take_numbers(c, 3 * links);
  d->links.offset = take_numbers(c, 3 * links);
  d->links.tip = take_numbers(c, links ? 3 : 0);
  d->least_link = take(c, links * sizeof(int));
  d->direction = take_numbers(c, model_direction_count(&f->shape) ? n * (f->tendons + MODEL_DIRECTION_SHARES) * 4 : 0);
}

static void lay_out_layer(sliding_layer* layer, size_t slots, cursor* c) {
  layer->displacement = take_numbers(c, slots);
  layer->distance = take_numbers(c, slots);
  layer->offset = take(c, slots * sizeof(uint32_t));
  layer->taken = take(c, slots / 4);
}

/* behind all memory of the extensions there is room for a place where nothing slides */
static void lay_out_extensions(tendonfmu_finger* f, cursor* c) {
  f->extensions.row = take(c, f->shape.extension_count * sizeof(extension_row));
  f->derived.axis_cosine = take_numbers(c, f->shape.extension_count ? f->joints * f->joints : 0);
  f->scratch.extension = take_numbers(c, f->shape.extension_memory + PRESLIDING_NUMBERS);
  const size_t slots = f->shape.extension_count ? f->slots : 0;
  f->scratch.grip = take_numbers(c, slots);
  f->scratch.bias_grip = take_numbers(c, slots);
  f->scratch.slides = take_numbers(c, slots);
  f->scratch.kept = take_numbers(c, slots);
  f->scratch.others = take_numbers(c, slots);
  f->scratch.whole_edge = take_numbers(c, slots);
  f->scratch.whole_pulley = take_numbers(c, slots);
  f->extensions.is_named = take(c, slots);
  lay_out_layer(&f->extensions.acting, slots, c);
  lay_out_layer(&f->extensions.overruled, slots, c);
}

static void lay_out_state(tendonfmu_finger* f, cursor* c) {
  finger_state* s = &f->remembered;
  const size_t joints = f->joint_lanes, tendons = f->tendon_lanes, slots = f->slots;
  const size_t entries = f->shape.options & MODEL_REMEMBERS_ENTRY_LOAD ? slots : 0;
  const size_t parts = f->shape.options & MODEL_HAS_UNCERTAINTY ? f->joints * tendons + 3 * joints : 0;
  const size_t filter = f->shape.options & MODEL_HAS_POSITION_FILTER ? FILTER_ROWS * joints : 0;
  const size_t rests = f->shape.options & MODEL_HAS_REST ? 1 : 0;
  const size_t starts = f->shape.options & MODEL_HAS_START_SHARE ? 1 : 0;
  const size_t drifts = f->shape.options & MODEL_HAS_DRIFT ? 1 : 0;
  const size_t sensors = f->shape.options & MODEL_HAS_SENSOR_FAULT ? 1 : 0;
  f->state_count = STATE_SCALARS + 17 * joints + 2 * tendons + 6 * slots + 2 * entries + parts + filter +
                   starts * (slots + joints) + drifts * 5 * joints + rests * (5 * joints + 5 * tendons) +
                   sensors * (SENSOR_ROWS * tendons + joints) + f->shape.extension_memory;
  f->state = take_numbers(c, f->state_count + (f->shape.extension_count ? PRESLIDING_NUMBERS : 0));
  double* run = f->state;
  s->scalar = part(&run, STATE_SCALARS);
  double** const joint_rows[] = {
      &s->angle,          &s->speed,         &s->torque,   &s->friction,    &s->compensated,   &s->bias,
      &s->joint_contact,  &s->variance,      &s->gain,     &s->residual,    &s->innovation,    &s->tracked,
      &s->stuck_friction, &s->friction_jump, &s->evidence, &s->exceeded_at, &s->total_variance};
  for (size_t i = 0; i < sizeof joint_rows / sizeof joint_rows[0]; ++i) {
    *joint_rows[i] = part(&run, joints);
  }
  s->force = part(&run, tendons);
  s->slack = part(&run, tendons);
  double** const slot_rows[] = {&s->moving, &s->side, &s->side_before, &s->event, &s->stuck_since, &s->last_stuck};
  for (size_t i = 0; i < sizeof slot_rows / sizeof slot_rows[0]; ++i) {
    *slot_rows[i] = part(&run, slots);
  }
  s->entry_edge = part(&run, entries);
  s->entry_pulley = part(&run, entries);
  s->start_left = part(&run, starts * slots);
  s->unlearned = part(&run, starts * joints);
  s->part = part(&run, parts);
  s->filter = part(&run, filter);
  double** const drift_rows[] = {&s->drift_of_late, &s->drift_quick, &s->drift_slow, &s->learned, &s->drift};
  for (size_t i = 0; i < sizeof drift_rows / sizeof drift_rows[0]; ++i) {
    *drift_rows[i] = part(&run, drifts * joints);
  }
  double** const rest_of_joints[] = {&s->contact_change, &s->rest_tracked, &s->rest_contact, &s->rest_extreme,
                                     &s->carried_load};
  for (size_t i = 0; i < sizeof rest_of_joints / sizeof rest_of_joints[0]; ++i) {
    *rest_of_joints[i] = part(&run, rests * joints);
  }
  double** const rest_of_tendons[] = {&s->smooth_force, &s->mark_force, &s->mark_position, &s->recent_force,
                                      &s->recent_position};
  for (size_t i = 0; i < sizeof rest_of_tendons / sizeof rest_of_tendons[0]; ++i) {
    *rest_of_tendons[i] = part(&run, rests * tendons);
  }
  s->sensor = part(&run, sensors * SENSOR_ROWS * tendons);
  s->watch = part(&run, sensors * joints);
  s->extension = run;
}

static void lay_out_scratch(tendonfmu_finger* f, cursor* c) {
  finger_scratch* s = &f->scratch;
  const size_t matrix = f->joints * f->tendon_lanes;
  double** const tendon_rows[] = {&s->force, &s->position, &s->slack};
  double** const joint_rows[] = {&s->angle,     &s->torque,         &s->friction,      &s->bias_step,
                                 &s->load,      &s->joint_friction, &s->load_friction, &s->joint_bias,
                                 &s->load_bias, &s->stuck_friction, &s->uncertainty};
  double** const slot_rows[] = {&s->edge_kept, &s->pulley_kept, &s->edge_stuck, &s->pulley_stuck};
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
  for (size_t i = 0; i < sizeof slot_rows / sizeof slot_rows[0]; ++i) {
    *slot_rows[i] = take_numbers(c, f->slots);
  }
  s->part = take_numbers(c, matrix + 3 * f->joint_lanes);
  const int filtered = (f->shape.options & MODEL_HAS_POSITION_FILTER) != 0;
  s->filter = take_numbers(c, filtered ? FILTER_ROWS * f->joint_lanes : 0);
  s->travel = take_numbers(c, filtered ? f->slots : 0);
  const int starts = (f->shape.options & MODEL_HAS_START_SHARE) != 0;
  s->edge_turned = take_numbers(c, starts ? f->slots : 0);
  s->pulley_turned = take_numbers(c, starts ? f->slots : 0);
  s->start_left = take_numbers(c, starts ? f->slots : 0);
  s->turned = take_numbers(c, starts ? f->joint_lanes : 0);
  s->drift_share = take_numbers(c, f->shape.options & MODEL_HAS_DRIFT ? 4 : 0);
  const int resting = (f->shape.options & MODEL_HAS_REST) != 0;
  s->motor_position = take_numbers(c, resting ? f->tendon_lanes : 0);
  s->force_change = take_numbers(c, resting ? f->tendon_lanes : 0);
  s->rest_noise = take_numbers(c, resting ? f->joint_lanes : 0);
  s->rest_bound = take_numbers(c, resting ? f->joint_lanes : 0);
  s->rest_sudden_bound = take_numbers(c, resting ? f->joint_lanes : 0);
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
