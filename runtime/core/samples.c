#include "floating_point.h"

#include "samples.h"

#include <math.h>
#include <string.h>

/* Beyond these nothing is a measurement; below them no product in a step overflows for sane parameters. */
static const double largest_input = 1e12, largest_time = 1e15;

typedef struct input_row {
  const char* name;
  const char* unit;
  const double* values;
  size_t count;
  double* to;
} input_row;

static int refuse_input(message_line message, const input_row* row, size_t i, double time) {
  message_element(message, row->name, i + 1);
  message_text(message, " = ");
  message_number(message, row->values[i]);
  message_text(message, " at time ");
  message_number(message, time);
  message_text(message, " s: expected a finite number of magnitude at most 1e+12 ");
  message_text(message, row->unit);
  return -1;
}

static int take_row(const input_row* row, double time, message_line message) {
  if (!row->values) {
    message_start(message, row->name);
    message_text(message, " is missing: this kinematics source needs it");
    return -1;
  }
  for (size_t i = 0; i < row->count; ++i) {
    if (!(fabs(row->values[i]) <= largest_input)) {
      return refuse_input(message, row, i, time);
    }
    row->to[i] = row->values[i];
  }
  return 0;
}

static int check_time(const tendonfmu_finger* f, double time, message_line message) {
  const int initialised = f->remembered.scalar[STATE_INITIALISED] != 0.0;
  const double before = f->remembered.scalar[STATE_TIME];
  if (fabs(time) <= largest_time && (!initialised || time >= before)) {
    return 0;
  }
  message_start(message, "time = ");
  message_number(message, time);
  message_text(message, " s: expected a finite number of magnitude at most 1e+15 s");
  if (initialised) {
    message_text(message, ", not before the sample already taken at ");
    message_number(message, before);
    message_text(message, " s");
  }
  return -1;
}

int samples_take_inputs(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs, message_line message) {
  const finger_scratch* s = &finger->scratch;
  const int source = (int)finger->remembered.scalar[STATE_SOURCE];
  const size_t m = finger->tendons, n = finger->joints;
  double* joint_velocity = s->velocity + n * finger->tendon_lanes;
  const input_row force = {"tendon_force", "N", inputs->tendon_force, m, s->force};
  const input_row position = {"tendon_position", "m", inputs->tendon_position, m, s->position};
  const input_row angle = {"joint_position", "rad", inputs->joint_position, n, s->angle};
  const input_row velocity = {"joint_velocity", "rad/s", inputs->joint_velocity, n, joint_velocity};
  if (check_time(finger, time, message) || take_row(&force, time, message)) {
    return -1;
  }
  if (source == TENDONFMU_TENDON_POSITIONS) {
    return take_row(&position, time, message);
  }
  if (take_row(&angle, time, message)) {
    return -1;
  }
  return source == TENDONFMU_JOINT_VELOCITIES ? take_row(&velocity, time, message) : 0;
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

void samples_give_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* outputs, size_t row) {
  const finger_state* s = &finger->remembered;
  const size_t n = finger->joints;
  give_numbers(outputs->compensated_torque, s->compensated, n, row);
  give_numbers(outputs->joint_torque, s->torque, n, row);
  give_numbers(outputs->friction_torque, s->friction, n, row);
  give_numbers(outputs->bias_torque, s->bias, n, row);
  give_numbers(outputs->joint_angle, s->angle, n, row);
  give_numbers(outputs->joint_speed, s->speed, n, row);
  give_flags(outputs->joint_contact, s->joint_contact, n, row);
  give_flags(outputs->contact, s->scalar + STATE_CONTACT, 1, row);
  give_flags(outputs->slack, s->slack, finger->tendons, row);
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
