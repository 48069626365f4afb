/* The model of the friction FMU: a finger of tendonfmu.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "finger_signals.h"

struct model {
  tendonfmu_finger* finger;
  model_shape shape;
  void* scratch;           /* [state_size] a state of the finger to go back to */
  size_t* changed_indices; /* [p] parameters to hand over */
  double* changed_values;  /* [p] */
  int at_end;              /* a step takes the sample at its end, not at its beginning */
};

const model_texts model_text = {.resource = "model.image",
                                .initialised = "the first sample is taken",
                                .waits = "the first step takes the first sample",
                                .needs_inputs = 1};

model* model_create(const void* resource, size_t size, int at_end, log_text* reason) {
  model* m = calloc(1, sizeof *m);
  if (!m) {
    *reason = log_line("out of memory");
    return NULL;
  }
  m->finger = tendonfmu_create(resource, size, reason->bytes, sizeof reason->bytes);
  if (!m->finger) {
    model_destroy(m);
    return NULL;
  }
  m->at_end = at_end;
  m->shape = (model_shape){.joints = tendonfmu_joint_count(m->finger),
                           .tendons = tendonfmu_tendon_count(m->finger),
                           .parameters = tendonfmu_parameter_count(m->finger),
                           .state_size = tendonfmu_state_size(m->finger),
                           .has_links = tendonfmu_has_links(m->finger),
                           .watches_sensors = tendonfmu_watches_sensors(m->finger)};
  m->scratch = malloc(m->shape.state_size);
  m->changed_indices = malloc((m->shape.parameters + 1) * sizeof *m->changed_indices);
  m->changed_values = malloc((m->shape.parameters + 1) * sizeof *m->changed_values);
  if (!m->scratch || !m->changed_indices || !m->changed_values) {
    *reason = log_line("out of memory");
    model_destroy(m);
    return NULL;
  }
  return m;
}

void model_destroy(model* m) {
  tendonfmu_destroy(m->finger);
  free(m->scratch);
  free(m->changed_indices);
  free(m->changed_values);
  free(m);
}

void model_reset(model* m) {
  tendonfmu_reset(m->finger);
}

void model_guid(const void* resource, size_t size, int at_end, char guid[39]) {
  tendonfmu_image_guid(resource, size, VARIABLE_TABLE_SALT + (unsigned)at_end, guid);
}

model_shape model_get_shape(const model* m) {
  return m->shape;
}

const char* model_last_error(const model* m) {
  return tendonfmu_last_error(m->finger);
}

/* --- parameters --------------------------------------------------------------------------------------------------- */

/* kinematics_source is the only setting */

double model_get_setting(const model* m, variable_group_id group, size_t index) {
  (void)group, (void)index;
  return tendonfmu_get_kinematics_source(m->finger);
}

void model_set_setting(model* m, variable_group_id group, size_t index, double value) {
  (void)group, (void)index;
  tendonfmu_set_kinematics_source(m->finger, (int)value);
}

model_range model_setting_range(const model* m, variable_group_id group) {
  (void)m;
  return (model_range){.unit = variable_groups[group].unit,
                       .minimum = variable_groups[group].minimum,
                       .maximum = variable_groups[group].maximum};
}

void model_get_parameters(const model* m, double* values) {
  tendonfmu_get_parameters(m->finger, m->shape.parameters, NULL, values);
}

model_range model_parameter_range(const model* m, size_t index) {
  tendonfmu_parameter_info info = {0};
  tendonfmu_get_parameter_info(m->finger, index, &info);
  return (model_range){info.unit, info.minimum, info.maximum, info.above_minimum, info.tunable};
}

int model_parameter_path(const model* m, size_t index, char* path, size_t size) {
  return tendonfmu_get_parameter_path(m->finger, index, path, size) == TENDONFMU_OK ? 0 : -1;
}

const char* model_set_tolerance(model* m, double* tolerance) {
  (void)m, (void)tolerance; /* nothing is iterated */
  return NULL;
}

/* --- samples ------------------------------------------------------------------------------------------------------ */

int model_is_initialised(const model* m) {
  return tendonfmu_is_initialised(m->finger);
}

double model_get_time(const model* m) {
  return tendonfmu_get_time(m->finger);
}

/* Hands the finger, in one batch, the parameters that differ from its own: relations between them (static >= coulomb)
 * then hold or not for all together, whatever order they were written in. */
static tendonfmu_status hand_over_parameters(model* m, const variables* values) {
  size_t changed = 0;
  tendonfmu_get_parameters(m->finger, m->shape.parameters, NULL, m->changed_values);
  for (size_t i = 0; i < m->shape.parameters; ++i) {
    if (values->parameters[i] != m->changed_values[i]) {
      m->changed_indices[changed] = i;
      m->changed_values[changed++] = values->parameters[i];
    }
  }
  if (!changed) {
    return TENDONFMU_OK;
  }
  return tendonfmu_set_parameters(m->finger, changed, m->changed_indices, m->changed_values);
}

static model_answer advance(model* m, const variables* values, double time) {
  const tendonfmu_inputs inputs = variables_inputs(values);
  tendonfmu_status status = values->parameters_pending ? hand_over_parameters(m, values) : TENDONFMU_OK;
  if (status == TENDONFMU_OK) {
    status = tendonfmu_is_initialised(m->finger) ? tendonfmu_step(m->finger, time, &inputs)
                                                 : tendonfmu_initialise(m->finger, time, &inputs);
  }
  return status == TENDONFMU_OK ? MODEL_OK : status == TENDONFMU_BAD_SAMPLE ? MODEL_BAD_INPUTS : MODEL_FAILED;
}

/* Takes a sample of the present inputs; parameters that were written take effect in it. */
static model_answer take_sample(model* m, variables* values, double time) {
  if (tendonfmu_is_initialised(m->finger) && time == tendonfmu_get_time(m->finger)) {
    return MODEL_OK; /* taken already: nothing changes, and parameters wait for the next sample */
  }
  if (values->parameters_pending) {
    tendonfmu_save_state(m->finger, m->scratch, m->shape.state_size);
  }
  const model_answer answer = advance(m, values, time);
  if (answer == MODEL_OK) {
    values->parameters_pending = 0;
  } else if (values->parameters_pending) { /* they are not to stay with a finger that refused the sample */
    tendonfmu_restore_state(m->finger, m->scratch, m->shape.state_size);
  }
  return answer;
}

model_answer model_initialise(model* m, variables* values, double start) {
  return take_sample(m, values, start);
}

model_answer model_begin_trial(model* m, variables* values, double start) {
  tendonfmu_save_state(m->finger, m->scratch, m->shape.state_size);
  const model_answer answer = advance(m, values, start);
  if (answer != MODEL_OK) {
    model_end_trial(m);
  }
  return answer;
}

void model_end_trial(model* m) {
  tendonfmu_restore_state(m->finger, m->scratch, m->shape.state_size);
}

static double sample_time(const model* m, double time, double step) {
  return m->at_end ? time + step : time;
}

const char* model_refuse_step(const model* m, double time, double step) {
  const double sample = sample_time(m, time, step);
  if (tendonfmu_is_initialised(m->finger) && sample < tendonfmu_get_time(m->finger)) {
    return m->at_end ? "expected a step that does not end before the sample already taken"
                     : "expected a currentCommunicationPoint not before the sample already taken";
  }
  return fabs(sample) <= 1e15 ? NULL : "expected a step that ends at a magnitude of at most 1e15 s";
}

model_answer model_step(model* m, variables* values, double time, double step) {
  return take_sample(m, values, sample_time(m, time, step));
}

int model_derive(const model* m, const variables* view) {
  const tendonfmu_inputs direction = variables_inputs(view);
  const tendonfmu_outputs derivative = variables_outputs(view);
  return tendonfmu_get_directional_derivative(m->finger, &direction, &derivative) == TENDONFMU_OK ? 0 : -1;
}

/* --- saved states ------------------------------------------------------------------------------------------------- */

void model_fetch_outputs(const model* m, variables* values) {
  variables_fetch_outputs(values, m->finger);
}

void model_save(const model* m, void* bytes) {
  tendonfmu_save_state(m->finger, bytes, m->shape.state_size);
}

const char* model_check_state(model* m, const void* bytes, int may_be_initialised) {
  const char* reason = NULL;
  tendonfmu_save_state(m->finger, m->scratch, m->shape.state_size);
  if (tendonfmu_restore_state(m->finger, bytes, m->shape.state_size) != TENDONFMU_OK) {
    return tendonfmu_last_error(m->finger);
  }
  if (tendonfmu_is_initialised(m->finger) && !may_be_initialised) {
    reason = "damaged state: its phase does not fit its finger";
  }
  tendonfmu_restore_state(m->finger, m->scratch, m->shape.state_size);
  return reason;
}

int model_restore(model* m, const void* bytes) {
  return tendonfmu_restore_state(m->finger, bytes, m->shape.state_size) == TENDONFMU_OK ? 0 : -1;
}
