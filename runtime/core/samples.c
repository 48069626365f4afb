#include "floating_point.h"

#include "step.h"

#include <math.h>
#include <string.h>

#include "contact_place.h"
#include "kernel_choice.h"
#include "sensor_fault.h"

enum { MOST_ROWS = 4 };

typedef struct input_row {
  const char* name;
  const char* unit;
  const double* values;
  size_t count;
  double* to;
} input_row;

/* the rows that the kinematics source, contact.watches_motors and sensor_fault use; returns how many */
static size_t used_rows(const tendonfmu_finger* f, const tendonfmu_inputs* inputs, input_row rows[MOST_ROWS]) {
  const finger_scratch* s = &f->scratch;
  const int source = source_of(f);
  const size_t m = f->tendons, n = f->joints;
  size_t count = 0;
  rows[count++] = (input_row){"tendon_force", "N", inputs->tendon_force, m, s->force};
  if (uses_positions(f)) {
    rows[count++] = (input_row){"tendon_position", "m", inputs->tendon_position, m, s->position};
  }
  if (source != TENDONFMU_TENDON_POSITIONS) {
    rows[count++] = (input_row){"joint_position", "rad", inputs->joint_position, n, s->angle};
  }
  if (source == TENDONFMU_JOINT_VELOCITIES) {
    double* speed = s->velocity + n * f->tendon_lanes;
    rows[count++] = (input_row){"joint_velocity", "rad/s", inputs->joint_velocity, n, speed};
  }
  return count;
}

static int check_time(const tendonfmu_finger* f, double time, message_line message) {
  const int initialised = !is_first(f);
  const double before = f->remembered.scalar[STATE_TIME];
  if (fabs(time) <= LARGEST_TIME && (!initialised || time >= before)) {
    return 0;
  }
  message_write(message, "time = %g s: expected a finite number of magnitude at most 1e+15 s", time);
  return initialised ? message_add(message, ", not before the sample already taken at %g s", before) : -1;
}

/* NaN is out of range */
static int is_in_range(const input_row* row) {
  const double* values = row->to;
  int outside = 0;
  for (size_t i = 0; i < row->count; ++i) {
    outside |= !(fabs(values[i]) <= LARGEST_INPUT);
  }
  return !outside;
}

static int refuse_input(const input_row* row, double time, message_line message) {
  size_t i = 0;
  while (i + 1 < row->count && fabs(row->to[i]) <= LARGEST_INPUT) {
    ++i;
  }
  return message_write(message, "%s[%zu] = %g at time %g s: expected a finite number of magnitude at most 1e+12 %s",
                       row->name, i + 1, row->to[i], time, row->unit);
}

int samples_take_inputs(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs, message_line message) {
  input_row rows[MOST_ROWS];
  const size_t count = used_rows(finger, inputs, rows);
  if (check_time(finger, time, message)) {
    return -1;
  }
  for (size_t k = 0; k < count; ++k) {
    if (!rows[k].values) {
      return message_write(message,
                           "%s is missing: this kinematics source, or contact.watches_motors or sensor_fault, needs it",
                           rows[k].name);
    }
  }
  if (!is_first(finger) && time == finger->remembered.scalar[STATE_TIME]) {
    return 0;
  }
  for (size_t k = 0; k < count; ++k) {
    memcpy(rows[k].to, rows[k].values, rows[k].count * sizeof(double));
    if (!is_in_range(&rows[k])) {
      return refuse_input(&rows[k], time, message);
    }
  }
  return 1;
}

static void give_numbers(double* to, const double* from, size_t count, size_t row) {
  if (to) {
    memcpy(to + row * count, from, count * sizeof(double));
  }
}

static void give_flags(unsigned char* to, const double* from, size_t count, size_t row) {
  for (size_t i = 0; to && i < count; ++i) {
    to[row * count + i] = from[i] != 0.0;
  }
}

static void give_deviations(double* to, const double* variance, size_t count, size_t row) {
  for (size_t j = 0; to && j < count; ++j) {
    to[row * count + j] = sqrt(variance[j]);
  }
}

/* 0 without contact.bands */
static void give_terms(double* to, const tendonfmu_finger* f, size_t row) {
  for (size_t j = 0; to && j < f->joints; ++j) {
    _Alignas(32) double terms[BAND_TERMS * BANDS] = {0.0};
    if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
      size_t band;
      f->kernel->weigh_bands(bands_of(f, j), f->derived.band_square + j * BANDS * BAND_NUMBERS, terms, &band);
    }
    for (size_t k = 0; k < BANDS * BAND_TERMS; ++k) {
      to[(row * f->joints + j) * BANDS * BAND_TERMS + k] = terms[k % BAND_TERMS * BANDS + k / BAND_TERMS];
    }
  }
}

/* failing sensors and what they hide; 0 without sensor_fault */
static void give_sensors(const tendonfmu_finger* finger, const tendonfmu_outputs* outputs, size_t row) {
  const double* fault = finger->remembered.sensor.fault;
  const size_t m = finger->tendons;
  for (size_t i = 0; outputs->sensor_fault && i < m; ++i) {
    outputs->sensor_fault[row * m + i] = fault && fault[i] != SENSOR_IS_WELL;
  }
  if (outputs->contact_observable) {
    outputs->contact_observable[row] = fault && !any_joint_is_blind(finger);
  }
}

static void give_place(const tendonfmu_finger* finger, const tendonfmu_outputs* outputs, size_t row) {
  if (!outputs->fingertip_force && !outputs->fingertip_force_std && !outputs->fingertip_force_observable &&
      !outputs->fingertip_force_misfit && !outputs->contact_link) {
    return;
  }
  const contact_place place = find_contact_place(finger);
  give_numbers(outputs->fingertip_force, place.tip.force, 3, row);
  give_numbers(outputs->fingertip_force_std, place.tip.deviation, 3, row);
  give_numbers(outputs->fingertip_force_misfit, &place.tip.misfit, 1, row);
  if (outputs->fingertip_force_observable) {
    outputs->fingertip_force_observable[row] = place.tip.observable != 0;
  }
  if (outputs->contact_link) {
    outputs->contact_link[row] = place.link;
  }
}

size_t outputs_size(const tendonfmu_outputs* outputs) {
  const size_t first_version = offsetof(tendonfmu_outputs, contact_terms) + sizeof outputs->contact_terms;
  return outputs->size ? outputs->size : first_version;
}

void samples_give_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* wanted, size_t row) {
  tendonfmu_outputs known = {0}; /* to this version and to the program's */
  const tendonfmu_outputs* outputs = &known;
  const finger_state* s = &finger->remembered;
  const size_t n = finger->joints, size = outputs_size(wanted);
  memcpy(&known, wanted, size < sizeof known ? size : sizeof known);
  give_numbers(outputs->compensated_torque, s->compensated, n, row);
  give_numbers(outputs->joint_torque, s->torque, n, row);
  give_numbers(outputs->friction_torque, s->friction, n, row);
  give_numbers(outputs->bias_torque, s->bias, n, row);
  give_numbers(outputs->joint_angle, s->angle, n, row);
  give_numbers(outputs->joint_speed, s->speed, n, row);
  give_flags(outputs->joint_contact, s->joint_contact, n, row);
  give_flags(outputs->contact, s->scalar + STATE_CONTACT, 1, row);
  give_flags(outputs->slack, s->slack, finger->tendons, row);
  give_deviations(outputs->compensated_torque_std, s->total_variance, n, row);
  give_numbers(outputs->residual, s->residual, n, row);
  give_numbers(outputs->contact_level, s->level, n, row);
  give_terms(outputs->contact_terms, finger, row);
  give_place(finger, outputs, row);
  give_sensors(finger, outputs, row);
}

static const double* row_of(const double* values, size_t row, size_t count) {
  return values ? values + row * count : NULL;
}

tendonfmu_inputs samples_row(const tendonfmu_finger* finger, const tendonfmu_inputs* inputs, size_t row) {
  return (tendonfmu_inputs){.tendon_force = row_of(inputs->tendon_force, row, finger->tendons),
                            .tendon_position = row_of(inputs->tendon_position, row, finger->tendons),
                            .joint_position = row_of(inputs->joint_position, row, finger->joints),
                            .joint_velocity = row_of(inputs->joint_velocity, row, finger->joints)};
}
