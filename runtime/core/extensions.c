#include "floating_point.h"

#include "extensions.h"

#include <math.h>
#include <string.h>

/* --- the table ------------------------------------------------------------------------------------------------------
 */

enum { SIGNAL_ORDERS = 3 };

static const effect_type* effect_of(const tendonfmu_finger* f, uint32_t index) {
  return effect_by_id(f->shape.extensions[(size_t)index * MODEL_EXTENSION_WORDS]);
}

/* the rows of a kind, from `to` on; how many. Numbers and memory of all rows follow each other as in the description,
 * the numbers behind all others. */
static size_t note_kind(tendonfmu_finger* f, effect_kind kind, int order, extension_row* to) {
  const double* numbers = f->parameters + f->shape.parameter_count;
  size_t found = 0, memory = 0;
  for (uint32_t i = 0; i < f->shape.extension_count; ++i) {
    numbers -= effect_of(f, i)->parameter_count;
  }
  for (uint32_t i = 0; i < f->shape.extension_count; ++i) {
    const effect_type* effect = effect_of(f, i);
    const effect_place place = model_extension_place(&f->shape, i);
    const size_t own = model_extension_memory(effect, &f->shape, place);
    if (effect->action->kind == kind && effect->action->order == order) {
      to[found++] = (extension_row){.action = effect->action,
                                    .place = place,
                                    .parameters = numbers,
                                    .before = own ? f->remembered.extension + memory : NULL,
                                    .now = own ? f->scratch.extension + memory : NULL,
                                    .memory_count = own};
    }
    numbers += effect->parameter_count;
    memory += own;
  }
  return found;
}

static void find_axis_cosines(tendonfmu_finger* f) {
  const int linked = has_option(f, MODEL_HAS_LINKS);
  const double* axis = f->derived.links.axis; /* unit vectors */
  for (size_t j = 0; j < f->joints; ++j) {
    for (size_t k = 0; k < f->joints; ++k) {
      double cosine = 1.0;
      if (linked) {
        const double *a = axis + 3 * j, *b = axis + 3 * k;
        cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      }
      f->derived.axis_cosine[j * f->joints + k] = cosine;
    }
  }
}

/* what a step finds in scratch while no friction row acts; where friction has a memory nothing sticks */
static void clear_grips(tendonfmu_finger* f) {
  for (size_t slot = 0; slot < f->slots; ++slot) {
    f->scratch.grip[slot] = 1.0;
    f->scratch.grip_slope[slot] = 0.0;
    f->scratch.bias_grip[slot] = elements_of(f) && f->memory.remembers[slot] != 0.0 ? 0.0 : 1.0;
  }
}

void find_extensions(tendonfmu_finger* f) {
  if (!f->shape.extension_count) {
    return;
  }
  extension_rows* rows = &f->extensions;
  rows->signals = 0;
  for (int order = 0; order < SIGNAL_ORDERS; ++order) {
    rows->signals += note_kind(f, EFFECT_SIGNAL, order, rows->signal + rows->signals);
  }
  rows->friction = rows->signal + rows->signals;
  rows->frictions = note_kind(f, EFFECT_FRICTION, 0, rows->friction);
  rows->torque = rows->friction + rows->frictions;
  rows->torques = note_kind(f, EFFECT_TORQUE, 0, rows->torque);
  rows->memory = rows->torque + rows->torques;
  rows->memories = note_kind(f, EFFECT_MEMORY, 0, rows->memory);
  find_axis_cosines(f);
  find_memory(f);
  clear_grips(f);
  rows->gripped = rows->frictions > 0 || elements_of(f) > 0;
}

/* --- what the others remember ---------------------------------------------------------------------------------------
 */

/* of the finger alone */
static effect_sample sample_of_finger(const tendonfmu_finger* f) {
  return (effect_sample){.joints = f->joints,
                         .tendons = f->tendons,
                         .lanes = f->tendon_lanes,
                         .moment_arm = f->derived.moment_arm,
                         .rest_angle = f->derived.cover_rest,
                         .axis_cosine = f->derived.axis_cosine,
                         .tendon_threshold = f->derived.settings.tendon_threshold,
                         .joint_threshold = f->derived.settings.joint_threshold};
}

void advance_extensions(tendonfmu_finger* f, double time, double step) {
  const finger_scratch* s = &f->scratch;
  const size_t count = f->extensions.frictions + f->extensions.torques;
  effect_sample* sample = &f->scratch.sample;
  *sample = sample_of_finger(f);
  sample->first = is_first(f);
  sample->time = time;
  sample->step = step;
  sample->angle = s->angle;
  sample->velocity = s->velocity + f->joints * f->tendon_lanes;
  sample->tendon_velocity = s->velocity;
  sample->force = s->force;
  for (const extension_row* row = f->extensions.friction; row < f->extensions.friction + count; ++row) {
    if (row->action->advance) {
      row->action->advance(row, sample);
    }
    if (row->action->slot && elements_of(f)) {
      follow_elements(f, row, row->action->size(row, sample));
    }
  }
}

effect_sample remembered_sample(const tendonfmu_finger* f) {
  effect_sample sample = sample_of_finger(f);
  sample.first = f->remembered.scalar[STATE_FIRST_SAMPLE] != 0.0;
  sample.time = f->remembered.scalar[STATE_TIME];
  sample.angle = f->remembered.angle;
  sample.velocity = f->remembered.speed;
  sample.force = f->remembered.force;
  return sample;
}

/* --- signals --------------------------------------------------------------------------------------------------------
 */

void shape_signals(tendonfmu_finger* f, double time, int late) {
  const finger_scratch* s = &f->scratch;
  effect_signals signals = {.joints = f->joints,
                            .tendons = f->tendons,
                            .first = is_first(f),
                            .source = source_of(f),
                            .late = late,
                            .time = time,
                            .force = s->force,
                            .position = s->position,
                            .angle = s->angle,
                            .velocity = s->velocity + f->joints * f->tendon_lanes,
                            .inverse_stiffness = f->derived.inverse_stiffness};
  for (size_t n = 0; n < f->extensions.signals; ++n) {
    f->extensions.signal[n].action->signal(&f->extensions.signal[n], &signals);
  }
}

/* --- friction -------------------------------------------------------------------------------------------------------
 */

/* how many velocities a friction row acts on: of a joint; of a tendon, one a joint; of all tendons, then of all joints
 */
static size_t count_members(const tendonfmu_finger* f, effect_place place) {
  if (place.joint != EFFECT_NOWHERE) {
    return 1;
  }
  return place.tendon != EFFECT_NOWHERE ? f->joints : f->joints * (f->tendons + 1);
}

/* the slot of one of them, as effect_action.grip() counts them */
static size_t slot_of_member(const tendonfmu_finger* f, effect_place place, size_t k) {
  const size_t lanes = f->tendon_lanes;
  if (place.joint != EFFECT_NOWHERE) {
    return f->joints * lanes + place.joint;
  }
  if (place.tendon != EFFECT_NOWHERE) {
    return k * lanes + place.tendon;
  }
  return k < f->joints * f->tendons ? k / f->tendons * lanes + k % f->tendons : f->joints * (lanes - f->tendons) + k;
}

static void grip_row(tendonfmu_finger* f, const extension_row* row) {
  const finger_scratch* s = &f->scratch;
  const size_t members = count_members(f, row->place);
  for (size_t k = 0; k < members; ++k) {
    const size_t slot = slot_of_member(f, row->place, k);
    const effect_grip own = row->action->grip(row, k);
    s->grip_slope[slot] = s->grip_slope[slot] * own.value + s->grip[slot] * own.by_velocity;
    s->grip[slot] *= own.value;
    s->bias_grip[slot] *= own.value;
  }
}

void find_grips(tendonfmu_finger* f) {
  if (!f->extensions.frictions) {
    return;
  }
  clear_grips(f);
  for (size_t r = 0; r < f->extensions.frictions; ++r) {
    grip_row(f, f->extensions.friction + r);
  }
}

void grip_jumps(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t joint_row = f->joints * f->tendon_lanes;
  for (size_t slot = 0; slot < joint_row; ++slot) {
    s->edge_bias[slot] *= s->bias_grip[slot];
    s->pulley_bias[slot] *= s->bias_grip[slot];
  }
  for (size_t j = 0; j < f->joints; ++j) {
    s->joint_bias[j] *= s->bias_grip[joint_row + j];
    s->load_bias[j] *= s->bias_grip[joint_row + j];
  }
}

/* --- torques --------------------------------------------------------------------------------------------------------
 */

void add_extension_torques(tendonfmu_finger* f) {
  for (size_t r = 0; r < f->extensions.torques; ++r) {
    const extension_row* row = f->extensions.torque + r;
    row->action->torque(row, &f->scratch.sample, f->scratch.friction);
  }
}
