#include "plant_model.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tendonfmu.h"
#include "variables.h"

static const double longest_step = 1000.0; /* s; half a minute of computing */

const model_texts model_text = {.resource = "rig.json",
                                .initialised = "the finger has settled",
                                .waits = "the finger settles with the first step",
                                .no_derivatives = "there are none: providesDirectionalDerivative is false"};

/* --- creation ----------------------------------------------------------------------------------------------------- */

static model* refuse(model* m, log_text* reason, const char* why) {
  if (why) {
    *reason = log_line("%s", why);
  }
  if (m) {
    model_destroy(m);
  }
  return NULL;
}

/* Its inputs are held over a step, and its outputs are those of the end: there is no choice. */
model* model_create(const void* resource, size_t size, int at_end, log_text* reason) {
  (void)at_end;
  tendonfmu_plant_settings settings;
  model* m = calloc(1, sizeof *m);
  if (!m) {
    return refuse(m, reason, "out of memory");
  }
  m->plant = tendonfmu_plant_create(resource, size, reason->bytes, sizeof reason->bytes);
  if (!m->plant) {
    return refuse(m, reason, NULL);
  }
  m->joints = tendonfmu_plant_joint_count(m->plant);
  m->tendons = tendonfmu_plant_tendon_count(m->plant);
  m->plant_state_size = tendonfmu_plant_state_size(m->plant);
  m->input_count = m->tendons + 4;
  m->inputs = calloc(m->input_count, sizeof *m->inputs);
  m->before = calloc(m->input_count, sizeof *m->before);
  m->scratch = malloc(m->plant_state_size);
  if (!m->inputs || !m->before || !m->scratch) {
    return refuse(m, reason, "out of memory");
  }
  if (tendonfmu_plant_get_settings(m->plant, &settings) != TENDONFMU_PLANT_OK) {
    return refuse(m, reason, tendonfmu_plant_last_error(m->plant));
  }
  settings_to_numbers(&settings, m->given);
  if (m->given[SETTING_SEED] > variable_groups[GROUP_SEED].maximum) {
    return refuse(m, reason, "seed: expected at most 2147483647 in an FMU, whose Integer has 32 bits");
  }
  memcpy(m->wanted, m->given, sizeof m->wanted);
  return m;
}

void model_destroy(model* m) {
  tendonfmu_plant_destroy(m->plant);
  free(m->inputs);
  free(m->before);
  free(m->scratch);
  free(m);
}

void model_reset(model* m) {
  tendonfmu_plant_reset(m->plant);
  memcpy(m->wanted, m->given, sizeof m->wanted);
  m->tolerance_written = m->commanded = m->running = 0;
  m->start = 0.0;
}

void model_guid(const void* resource, size_t size, int at_end, char guid[39]) {
  (void)at_end;
  tendonfmu_image_guid(resource, size, VARIABLE_TABLE_SALT, guid);
}

/* Its groups need neither links nor sensors that are watched, and the rig's numbers are no parameters. */
model_shape model_get_shape(const model* m) {
  return (model_shape){.joints = m->joints, .tendons = m->tendons, .state_size = plant_model_state_size(m)};
}

const char* model_last_error(const model* m) {
  return m->error;
}

int plant_failed(model* m) {
  snprintf(m->error, sizeof m->error, "%s", tendonfmu_plant_last_error(m->plant));
  return -1;
}

/* --- parameters --------------------------------------------------------------------------------------------------- */

double model_get_setting(const model* m, variable_group_id group, size_t index) {
  return m->wanted[setting_place(group, index)];
}

void model_set_setting(model* m, variable_group_id group, size_t index, double value) {
  m->wanted[setting_place(group, index)] = value;
  m->tolerance_written |= group == GROUP_RELATIVE_TOLERANCE;
}

model_range model_setting_range(const model* m, variable_group_id group) {
  return setting_range(group, m->joints);
}

const char* model_set_tolerance(model* m, double* tolerance) {
  const variable_group* group = &variable_groups[GROUP_RELATIVE_TOLERANCE];
  if (!(*tolerance > 0.0) || isinf(*tolerance)) {
    return "a finite number above 0";
  }
  *tolerance = fmin(fmax(*tolerance, group->minimum), group->maximum);
  if (!m->tolerance_written) {
    m->wanted[SETTING_RELATIVE_TOLERANCE] = *tolerance;
  }
  return NULL;
}

/* By path there are none: another rig is another FMU. */

void model_get_parameters(const model* m, double* values) {
  (void)m, (void)values;
}

model_range model_parameter_range(const model* m, size_t index) {
  (void)m, (void)index;
  return (model_range){.unit = ""};
}

int model_parameter_path(const model* m, size_t index, char* path, size_t size) {
  (void)m, (void)index, (void)path, (void)size;
  return -1;
}

/* --- inputs and outputs ------------------------------------------------------------------------------------------- */

/* All inputs [input_count] of the importer: they stand one after the other in the block of variables. */
static const double* inputs_of(const variables* values) {
  return values->number[GROUP_TENDON_POSITION_COMMAND];
}

static int inputs_differ(const model* m, const variables* values) {
  return memcmp(m->inputs, inputs_of(values), m->input_count * sizeof *m->inputs) != 0;
}

static int is_command(const model* m, const double* inputs) {
  for (size_t i = 0; i < m->tendons; ++i) {
    if (inputs[i] != 0.0) {
      return 1;
    }
  }
  return 0;
}

/* Names the first input that is out of its range. */
static model_answer check_inputs(model* m, const variables* values) {
  for (int g = 0; g < GROUP_COUNT; ++g) {
    const variable_group* group = &variable_groups[g];
    const size_t count = group->causality == CAUSALITY_INPUT ? values->count[g] : 0;
    for (size_t i = 0; i < count; ++i) {
      const variable input = {group, (variable_group_id)g, i, 0};
      if (!variables_accept(m, &input, values->number[g][i])) {
        const log_text refusal = variables_refusal(m, &input, values->number[g][i]);
        snprintf(m->error, sizeof m->error, "%.*s", (int)sizeof m->error - 1, refusal.bytes);
        return MODEL_BAD_INPUTS;
      }
    }
  }
  return MODEL_OK;
}

int plant_take_inputs(model* m, const double* inputs) {
  const int commanded = m->commanded || is_command(m, inputs);
  const double *pretension = inputs + m->tendons, *force = pretension + 1;
  const tendonfmu_plant_inputs taken = {.tendon_position_command = commanded ? inputs : NULL,
                                        .pretension = *pretension,
                                        .push_force = {force[0], force[1], force[2]}};
  if (tendonfmu_plant_set_inputs(m->plant, &taken) != TENDONFMU_PLANT_OK) {
    return plant_failed(m);
  }
  m->commanded = commanded;
  memmove(m->inputs, inputs, m->input_count * sizeof *m->inputs);
  return 0;
}

void model_fetch_outputs(const model* m, variables* values) {
  double** number = values->number;
  const tendonfmu_plant_signals signals = {
      .measured_tendon_force = number[GROUP_TENDON_FORCE],
      .measured_tendon_position = number[GROUP_TENDON_POSITION],
      .measured_joint_position = number[GROUP_JOINT_POSITION],
      .measured_joint_velocity = number[GROUP_JOINT_VELOCITY],
      .measured_external_torque = number[GROUP_EXTERNAL_TORQUE],
      .tendon_force = number[GROUP_TRUTH_TENDON_FORCE],
      .tendon_position = number[GROUP_TRUTH_TENDON_POSITION],
      .joint_position = number[GROUP_TRUTH_JOINT_POSITION],
      .joint_velocity = number[GROUP_TRUTH_JOINT_VELOCITY],
      .joint_torque = number[GROUP_TRUTH_JOINT_TORQUE],
      .friction_torque = number[GROUP_TRUTH_FRICTION_TORQUE],
      .external_torque = number[GROUP_TRUTH_EXTERNAL_TORQUE],
      .inertial_torque = number[GROUP_TRUTH_INERTIAL_TORQUE],
      .stop_torque = number[GROUP_TRUTH_STOP_TORQUE],
      .contact_force = number[GROUP_TRUTH_CONTACT_FORCE],
      .contact_point = number[GROUP_TRUTH_CONTACT_POINT],
      .tip_position = number[GROUP_TRUTH_TIP_POSITION],
      .friction_level = number[GROUP_TRUTH_FRICTION_LEVEL],
      .contact = values->flag[GROUP_TRUTH_CONTACT],
      .slack = values->flag[GROUP_TRUTH_SLACK],
  };
  tendonfmu_plant_get_signals(m->plant, &signals);
}

int model_derive(const model* m, const variables* view) {
  (void)m, (void)view;
  return -1; /* never called: see no_derivatives */
}

/* --- initialisation ----------------------------------------------------------------------------------------------- */

int plant_start_over(model* m, const double* settings) {
  const tendonfmu_plant_settings taken = settings_from_numbers(settings);
  tendonfmu_plant_reset(m->plant);
  m->commanded = 0;
  if (tendonfmu_plant_set_settings(m->plant, &taken) != TENDONFMU_PLANT_OK) {
    return plant_failed(m);
  }
  memcpy(m->used, settings, sizeof m->used);
  return 0;
}

static int settle(model* m, const variables* values) {
  if (plant_start_over(m, m->wanted) || plant_take_inputs(m, inputs_of(values))) {
    return -1;
  }
  return tendonfmu_plant_initialise(m->plant) == TENDONFMU_PLANT_OK ? 0 : plant_failed(m);
}

/* Settling takes long: a plant that has settled with the present inputs and settings, to be looked at, stays as it is.
 */
static model_answer settle_as_wanted(model* m, const variables* values) {
  if (check_inputs(m, values) != MODEL_OK) {
    return MODEL_BAD_INPUTS;
  }
  if (tendonfmu_plant_is_initialised(m->plant) && memcmp(m->used, m->wanted, sizeof m->used) == 0 &&
      !inputs_differ(m, values)) {
    return MODEL_OK;
  }
  return settle(m, values) ? MODEL_FAILED : MODEL_OK;
}

int model_is_initialised(const model* m) {
  return m->running;
}

double model_get_time(const model* m) {
  return m->start + tendonfmu_plant_get_time(m->plant);
}

model_answer model_initialise(model* m, variables* values, double start) {
  const model_answer answer = settle_as_wanted(m, values);
  if (answer != MODEL_FAILED) { /* time 0 of the plant, also where the first step settles */
    m->start = start;
    m->running = answer == MODEL_OK;
  }
  return answer;
}

model_answer model_begin_trial(model* m, variables* values, double start) {
  (void)start;
  return settle_as_wanted(m, values);
}

void model_end_trial(model* m) {
  (void)m;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

/* s, what an importer's additions and the start time leave in the last digits */
static double lost_digits(double start, double time) {
  return 1e-15 + 64.0 * DBL_EPSILON * (fabs(time) + fabs(start));
}

const char* model_refuse_step(const model* m, double time, double step) {
  if (step > longest_step) {
    return "expected a communicationStepSize of at most 1000 s";
  }
  if (fabs(time - model_get_time(m)) > 1e-6 * step + 2.0 * lost_digits(m->start, time)) {
    return "expected a currentCommunicationPoint where the last step ended";
  }
  return NULL;
}

/* Time of the plant without these digits: a sensor that samples at 0.003 s is not to wait for the next step because
 * 0.001 + 0.001 + 0.001 is less. */
static double plant_time(double start, double time) {
  const double plain = time - start, rounded = round(plain * 1e9) / 1e9;
  return fabs(plain - rounded) <= lost_digits(start, time) ? rounded : plain;
}

/* The present inputs are within their ranges. */
static int advance(model* m, const variables* values, double end) {
  const int differ = inputs_differ(m, values);
  const int commanded = m->commanded;
  if (differ) { /* to go back to: inputs are part of the plant's state */
    memcpy(m->before, m->inputs, m->input_count * sizeof *m->inputs);
    tendonfmu_plant_save_state(m->plant, m->scratch, m->plant_state_size);
    if (plant_take_inputs(m, inputs_of(values))) {
      return -1;
    }
  }
  if (end > tendonfmu_plant_get_time(m->plant) && tendonfmu_plant_advance(m->plant, end) != TENDONFMU_PLANT_OK) {
    plant_failed(m);
    if (differ) {
      tendonfmu_plant_restore_state(m->plant, m->scratch, m->plant_state_size);
      memcpy(m->inputs, m->before, m->input_count * sizeof *m->inputs);
      m->commanded = commanded;
    }
    return -1;
  }
  return 0;
}

model_answer model_step(model* m, variables* values, double time, double step) {
  const int running = m->running;
  const model_answer answer = running ? check_inputs(m, values) : settle_as_wanted(m, values);
  if (answer != MODEL_OK) {
    return answer;
  }
  const int failed = advance(m, values, plant_time(m->start, time + step));
  m->running = running || !failed;
  return failed ? MODEL_FAILED : MODEL_OK;
}
