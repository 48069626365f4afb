#include "floating_point.h"

#include "extensions.h"

/* One row of the table, with where its parameters and its memory are. */
typedef struct extension {
  const effect_type* effect;
  size_t joint;
  const double* parameters;
  double* memory;
} extension;

static extension extension_begin(const tendonfmu_finger* f) {
  const double* parameters = f->parameters + f->shape.parameter_count;
  for (uint32_t i = 0; i < f->shape.extension_count; ++i) {
    parameters -= effect_by_id(f->shape.extensions[i * MODEL_EXTENSION_WORDS])->parameter_count;
  }
  return (extension){.parameters = parameters, .memory = f->remembered.extension};
}

/* moves to row i; rows are visited in order */
static void extension_at(const tendonfmu_finger* f, uint32_t i, extension* e) {
  const uint32_t* row = f->shape.extensions + (size_t)i * MODEL_EXTENSION_WORDS;
  if (e->effect) {
    e->memory += e->effect->state_count(e->parameters);
    e->parameters += e->effect->parameter_count;
  }
  e->effect = effect_by_id(row[0]);
  e->joint = row[1] - 1;
}

static effect_sample sample_at(const tendonfmu_finger* f, size_t joint, const double* angle, const double* velocity) {
  return (effect_sample){
      .joint_angle = angle[joint], .joint_velocity = velocity[joint], .rest_angle = f->derived.cover_rest[joint]};
}

void add_extension_torques(tendonfmu_finger* finger) {
  const double* velocity = finger->scratch.velocity + finger->joints * finger->tendon_lanes;
  extension e = extension_begin(finger);
  for (uint32_t i = 0; i < finger->shape.extension_count; ++i) {
    extension_at(finger, i, &e);
    const effect_sample sample = sample_at(finger, e.joint, finger->scratch.angle, velocity);
    finger->scratch.friction[e.joint] += e.effect->torque(e.parameters, &sample, e.memory).value;
  }
}

void remember_extensions(tendonfmu_finger* finger) {
  const double* velocity = finger->scratch.velocity + finger->joints * finger->tendon_lanes;
  extension e = extension_begin(finger);
  for (uint32_t i = 0; i < finger->shape.extension_count; ++i) {
    extension_at(finger, i, &e);
    if (e.effect->remember) {
      const effect_sample sample = sample_at(finger, e.joint, finger->scratch.angle, velocity);
      e.effect->remember(e.parameters, &sample, e.memory);
    }
  }
}

effect_torque extension_torque(const tendonfmu_finger* finger, size_t extension_index, size_t* joint) {
  extension e = extension_begin(finger);
  for (uint32_t i = 0; i <= extension_index; ++i) {
    extension_at(finger, i, &e);
  }
  const effect_sample sample = sample_at(finger, e.joint, finger->remembered.angle, finger->remembered.speed);
  *joint = e.joint;
  return e.effect->torque(e.parameters, &sample, e.memory);
}
