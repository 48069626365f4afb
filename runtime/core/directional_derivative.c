#include "floating_point.h"

#include "step.h"

#include <math.h>
#include <string.h>

#include "bias_tracker.h"
#include "extensions.h"
#include "sensor_fault.h"

/* The sample, its direction, and what is summed over the tendons. */
typedef struct linearisation {
  const tendonfmu_finger* finger;
  dual angle[MODEL_MAX_JOINTS], speed[MODEL_MAX_JOINTS];
  double motion[MODEL_MAX_JOINTS];  /* slope of the travel of a joint */
  dual friction[MODEL_MAX_JOINTS];  /* T of eq. (10) */
  dual load[MODEL_MAX_JOINTS];      /* Σ f_B */
  dual bias_step[MODEL_MAX_JOINTS]; /* Δb */
  double torque_slope[MODEL_MAX_JOINTS];
  double own_limit[MODEL_MAX_JOINTS]; /* of what torque rows add to the limit of a joint */
  double mean_force, mean_force_slope;
} linearisation;

static double seed(const double* direction, size_t i) {
  return direction ? direction[i] : 0.0;
}

/* A direction in the space of the signals. */
typedef struct signal_derivative {
  double force[MODEL_MAX_TENDONS], position[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS], velocity[MODEL_MAX_JOINTS];
} signal_derivative;

static void pass_signals(const tendonfmu_finger* f, effect_signals* direction, int late) {
  direction->late = late;
  for (size_t r = 0; r < f->extensions.signals; ++r) {
    const extension_row* row = f->extensions.signal + r;
    row->action->signal_pass(row, direction);
  }
}

/* what position and force make of the joint angles, where these come from them */
static void angles_along(const tendonfmu_finger* f, signal_derivative* d) {
  for (size_t j = 0; j < f->joints; ++j) {
    for (size_t i = 0; i < f->tendons; ++i) {
      const double stretch = d->force[i] * f->derived.inverse_stiffness[i];
      d->angle[j] += inverse_in_use(f)[j * f->tendon_lanes + i] * (d->position[i] - stretch);
    }
  }
}

/* the inputs' direction as the model sees it: past what the extensions make of the signals */
static void input_direction(const tendonfmu_finger* f, const tendonfmu_inputs* direction, signal_derivative* d) {
  memset(d, 0, sizeof *d);
  const int source = source_of(f);
  effect_signals signals = {.joints = f->joints,
                            .tendons = f->tendons,
                            .source = source,
                            .force = d->force,
                            .position = d->position,
                            .angle = d->angle,
                            .velocity = d->velocity,
                            .inverse_stiffness = f->derived.inverse_stiffness};
  for (size_t i = 0; i < f->tendons; ++i) {
    d->force[i] = seed(direction->tendon_force, i);
    d->position[i] = source == TENDONFMU_TENDON_POSITIONS ? seed(direction->tendon_position, i) : 0.0;
  }
  for (size_t j = 0; j < f->joints && source != TENDONFMU_TENDON_POSITIONS; ++j) {
    d->angle[j] = seed(direction->joint_position, j);
    d->velocity[j] = seed(direction->joint_velocity, j);
  }
  pass_signals(f, &signals, 0);
  if (source == TENDONFMU_TENDON_POSITIONS) {
    angles_along(f, d);
  }
  pass_signals(f, &signals, 1);
}

/* angle and velocity along a direction of the signals */
static void linearise_kinematics(linearisation* l, const signal_derivative* d) {
  const finger_state* s = &l->finger->remembered;
  const int given = source_of(l->finger) == TENDONFMU_JOINT_VELOCITIES;
  const double filtered = filtered_travel(l->finger);
  for (size_t j = 0; j < l->finger->joints; ++j) {
    const double speed = given ? d->velocity[j] : s->scalar[STATE_VELOCITY_GAIN] * d->angle[j];
    l->angle[j] = (dual){s->angle[j], d->angle[j]};
    l->speed[j] = (dual){s->speed[j], speed};
    l->motion[j] = filtered * s->scalar[STATE_STEP] * speed + (1.0 - filtered) * d->angle[j];
  }
}

/* --- friction values and bias jumps ---------------------------------------------------------------------------------
 */

/* what friction rows make of F and b */
static dual slot_grip(const linearisation* l, size_t slot, dual velocity) {
  const finger_scratch* s = &l->finger->scratch;
  if (!l->finger->extensions.frictions) {
    return (dual){1.0, 0.0};
  }
  return (dual){s->grip[slot], s->grip_slope[slot] * velocity.slope};
}

/* |F| at the present velocity where friction has a memory, else F: 0 where the effect sticks */
static dual friction_at(const linearisation* l, const effect_laws* laws, size_t slot, dual velocity) {
  const finger_state* s = &l->finger->remembered;
  const dual grip = slot_grip(l, slot, velocity);
  if (remembers_at(l->finger, slot)) {
    const double sign = velocity.value < 0.0 ? -1.0 : 1.0;
    const int negative = sliding_side(velocity.value, threshold_of(l->finger, slot), s->side[slot]);
    return product(grip, magnitude_at(laws, negative, scaled(sign, velocity)));
  }
  if (s->moving[slot] == 0.0) {
    return (dual){0.0, 0.0};
  }
  const double side = s->side[slot];
  return product(grip, scaled(side, magnitude_at(laws, side < 0.0, scaled(side, velocity))));
}

/* what is remembered of a place, `at` in rows of edges and pulleys; slopes of its travel and of its limit */
static dual remembered_loss(const tendonfmu_finger* f, size_t at, double motion, double limit) {
  const double turned = f->remembered.scalar[STATE_FIRST_SAMPLE] != 0.0 ? 0.0 : motion;
  double force = 0.0;
  for (size_t e = 0; e < elements_of(f); ++e) {
    force += f->remembered.element[e * 2 * f->slots + at];
  }
  return (dual){force, f->remembered.by_turning[at] * turned + f->remembered.by_limit[at] * limit};
}

/* what a place of a tendon loses: friction times what acts there, or what is remembered of it. motion: slope of the
 * travel; before: of the force before the place */
static dual loss_at(const linearisation* l, size_t slot, size_t row, dual friction, dual acts, double motion,
                    double before) {
  const tendonfmu_finger* f = l->finger;
  const dual loss = product(acts, friction);
  if (!remembers_at(f, slot)) {
    return loss;
  }
  const double stretch = f->memory.compliance > 0.0 ? f->memory.sections[slot] * f->memory.compliance * before : 0.0;
  return remembered_loss(f, row * f->slots + slot, motion + stretch, loss.slope);
}

/* b of fig. 5 at the last sample */
static dual bias_at(const linearisation* l, const effect_laws* laws, size_t slot, dual velocity) {
  const finger_state* s = &l->finger->remembered;
  if (s->event[slot] == 0.0 || remembers_at(l->finger, slot)) {
    return (dual){0.0, 0.0};
  }
  const transition t = {.stops = s->event[slot] > 0.0,
                        .side_before = side_before(l->finger, slot),
                        .side_now = s->side[slot],
                        .exponent = rest_exponent(l->finger, slot, s->scalar[STATE_ABSORBED_BEFORE]),
                        .threshold = threshold_of(l->finger, slot)};
  return product(slot_grip(l, slot, velocity), jump_of(&t, laws));
}

/* --- forces along one tendon ----------------------------------------------------------------------------------------
 */

/* |f| of a bidirectional tendon, f of others; a negative f of others is slack, held at 0 */
static dual acting(const tendonfmu_finger* f, size_t i, dual* force) {
  if (f->derived.bidirectional[i] != 0.0) {
    return force->value < 0.0 ? scaled(-1.0, *force) : *force;
  }
  if (force->value < 0.0) {
    *force = (dual){0.0, 0.0};
  }
  return *force;
}

/* A tendon up to some place. */
typedef struct tendon_force {
  size_t tendon;
  dual force, acts;  /* behind the last place; as it multiplies an F or a b */
  dual lost, jumped; /* up to there: Σ of the losses, of the b */
} tendon_force;

/* past an edge or a pulley; motion: slope of the travel there */
static void pass_place(const linearisation* l, const effect_laws* laws, size_t slot, size_t row, dual velocity,
                       double motion, tendon_force* t) {
  const dual friction = friction_at(l, laws, slot, velocity);
  const dual loss = loss_at(l, slot, row, friction, t->acts, motion, t->force.slope);
  t->jumped = sum(t->jumped, product(t->acts, bias_at(l, laws, slot, velocity)));
  t->lost = sum(t->lost, loss);
  t->force = difference(t->force, loss);
  t->acts = acting(l->finger, t->tendon, &t->force);
}

static void linearise_tendon(linearisation* l, size_t i, double force_slope) {
  const tendonfmu_finger* f = l->finger;
  const size_t lanes = f->tendon_lanes;
  dual velocity[MODEL_MAX_JOINTS + 1] = {{0.0, 0.0}};
  double motion[MODEL_MAX_JOINTS + 1] = {0.0};
  for (size_t j = f->joints; j-- > 0;) {
    const double arm = f->derived.moment_arm[j * lanes + i];
    velocity[j] = sum(velocity[j + 1], scaled(arm, l->speed[j]));
    motion[j] = motion[j + 1] + arm * l->motion[j];
  }
  tendon_force t = {.tendon = i, .force = {f->remembered.force[i], force_slope}};
  t.acts = acting(f, i, &t.force);
  for (size_t j = 0; j < f->joints; ++j) {
    const size_t slot = j * lanes + i;
    const effect_laws edge = edge_laws(f, j, i, j ? l->angle[j - 1] : (dual){0.0, 0.0});
    pass_place(l, &edge, slot, 0, velocity[j], motion[j], &t);
    l->load[j] = sum(l->load[j], t.acts);
    if (j + 1 < f->joints) {
      const effect_laws pulley = {.below = f->derived.pulley_law + (slot + lanes) * LAW_NUMBERS};
      pass_place(l, &pulley, slot + lanes, 1, velocity[j + 1], motion[j + 1], &t);
    }
    const double arm = f->derived.moment_arm[slot];
    l->friction[j] = sum(l->friction[j], scaled(arm, t.lost));
    l->bias_step[j] = sum(l->bias_step[j], scaled(arm, t.jumped));
  }
}

/* --- totals ---------------------------------------------------------------------------------------------------------
 */

/* the joint's own friction of eq. (8) */
static dual own_friction(const linearisation* l, size_t j, dual own, dual load) {
  const tendonfmu_finger* f = l->finger;
  const size_t slot = f->joints * f->tendon_lanes + j;
  const dual both = sum(own, load);
  if (!remembers_at(f, slot)) {
    return both;
  }
  return remembered_loss(f, slot, l->motion[j], both.slope + l->own_limit[j]);
}

static void linearise_joints(linearisation* l) {
  const tendonfmu_finger* f = l->finger;
  const size_t joint_row = f->joints * f->tendon_lanes;
  for (size_t j = 0; j < f->joints; ++j) {
    const effect_laws own = {.below = f->derived.joint_law + j * LAW_NUMBERS};
    const effect_laws loaded = {.below = f->derived.load_law + j * LAW_NUMBERS};
    const dual joint_friction = friction_at(l, &own, joint_row + j, l->speed[j]);
    const dual load_friction = friction_at(l, &loaded, joint_row + j, l->speed[j]);
    const dual own_bias = bias_at(l, &own, joint_row + j, l->speed[j]);
    const dual load_bias = bias_at(l, &loaded, joint_row + j, l->speed[j]);
    const dual cover = scaled(f->derived.cover_stiffness[j], l->angle[j]);
    const dual friction = own_friction(l, j, joint_friction, product(load_friction, l->load[j]));
    l->friction[j] = sum(l->friction[j], sum(friction, cover));
    l->bias_step[j] = sum(l->bias_step[j], sum(own_bias, product(l->load[j], load_bias)));
  }
}

/* slope of the travel at a slot */
static double motion_at(const linearisation* l, size_t slot) {
  const size_t n = l->finger->joints, lanes = l->finger->tendon_lanes;
  if (slot >= n * lanes) {
    return l->motion[slot - n * lanes];
  }
  double motion = 0.0;
  for (size_t j = n; j-- > slot / lanes;) {
    motion += l->finger->derived.moment_arm[j * lanes + slot % lanes] * l->motion[j];
  }
  return motion;
}

/* adds what friction as a torque owes to how it builds up at its places */
static void add_followed(const linearisation* l, const extension_row* row, const effect_sample* sample, double* slope) {
  const tendonfmu_finger* f = l->finger;
  const double size = row->action->size(row, sample);
  double slopes[MODEL_MAX_JOINTS] = {0.0};
  extension_row built_up = *row;
  built_up.now = slopes;
  for (size_t k = 0; k < row->memory_count; ++k) {
    const size_t slot = row->action->slot(row, f->joints, f->tendon_lanes, k);
    slopes[k] = follower_slope(f, row, k, size) * motion_at(l, slot);
  }
  row->action->torque(&built_up, sample, slope);
}

/* slope of what torque rows add to the limits of joints whose friction has a memory */
static void linearise_limits(linearisation* l, const double* force) {
  const tendonfmu_finger* f = l->finger;
  const size_t joint_row = f->joints * f->tendon_lanes;
  const effect_sample sample = remembered_sample(f);
  const effect_direction direction = {.force = force};
  for (size_t r = 0; r < f->extensions.torques; ++r) {
    extension_row row = f->extensions.torque[r];
    const size_t slot = row.action->slot ? row.action->slot(&row, f->joints, f->tendon_lanes, 0) : 0;
    if (slot >= joint_row && remembers_at(f, slot)) {
      double whole = 1.0;
      row.now = &whole;
      row.action->slope(&row, &sample, &direction, l->own_limit);
    }
  }
}

/* what the torque rows add */
static void linearise_extensions(linearisation* l, const double* force) {
  const tendonfmu_finger* f = l->finger;
  double angle[MODEL_MAX_JOINTS], velocity[MODEL_MAX_JOINTS], slope[MODEL_MAX_JOINTS] = {0.0};
  if (!f->extensions.torques) {
    return;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    angle[j] = l->angle[j].slope;
    velocity[j] = l->speed[j].slope;
  }
  const effect_sample sample = remembered_sample(f);
  const effect_direction direction = {.angle = angle, .velocity = velocity, .force = force};
  for (size_t r = 0; r < f->extensions.torques; ++r) {
    const extension_row* row = f->extensions.torque + r;
    if (row->action->slope) {
      row->action->slope(row, &sample, &direction, slope);
    }
    if (row->action->slot && elements_of(f)) {
      add_followed(l, row, &sample, slope);
    }
  }
  for (size_t j = 0; j < f->joints; ++j) {
    l->friction[j].slope += slope[j];
  }
}

/* mean |f0| and its slope */
static void linearise_mean(linearisation* l, const double* direction) {
  const tendonfmu_finger* f = l->finger;
  double sound[MODEL_MAX_TENDONS];
  const int watches = has_option(f, MODEL_HAS_SENSOR_FAULT);
  if (watches) {
    weigh_forces(f, f->remembered.sensor.fault, sound);
  }
  for (size_t i = 0; i < f->tendons; ++i) {
    const double force = f->remembered.force[i], slope = force < 0.0 ? -direction[i] : direction[i];
    l->mean_force += watches ? sound[i] * fabs(force) : fabs(force) / (double)f->tendons;
    l->mean_force_slope += watches ? sound[i] * slope : slope / (double)f->tendons;
  }
}

static void linearise_forces(linearisation* l, const double* direction) {
  const tendonfmu_finger* f = l->finger;
  linearise_mean(l, direction);
  for (size_t i = 0; i < f->tendons; ++i) {
    const double slope = direction[i];
    for (size_t j = 0; j < f->joints; ++j) {
      l->torque_slope[j] += f->derived.moment_arm[j * f->tendon_lanes + i] * slope;
    }
    linearise_tendon(l, i, slope);
  }
}

/* what the bias took at the last sample: d(K·r), where the gain of the Kalman filter varies with the mean tendon force
 */
static double correction_slope(const linearisation* l, size_t j, double residual_slope) {
  const finger_settings* settings = &l->finger->derived.settings;
  const finger_state* s = &l->finger->remembered;
  const double noise = settings->noise_std + settings->noise_std_per_force * l->mean_force;
  /* dK·r = −K·(1 − K)·r·dN/N with N the noise variance, and (1 − K)·r is the compensated torque */
  const double relative = noise > 0.0 ? 2.0 * settings->noise_std_per_force * l->mean_force_slope / noise : 0.0;
  return s->gain[j] * (residual_slope - s->compensated[j] * relative);
}

static void write_slope(double* to, size_t j, double slope) {
  if (to) {
    to[j] = slope;
  }
}

static void write_joint(const linearisation* l, size_t j, const tendonfmu_outputs* derivative) {
  const tendonfmu_finger* f = l->finger;
  const double torque = l->torque_slope[j], friction = l->friction[j].slope;
  double bias = l->bias_step[j].slope;
  double total = friction + bias;
  const int begins_anew = has_option(f, MODEL_HAS_SENSOR_FAULT) && f->remembered.watch[j] == JOINT_BEGINS_ANEW;
  if (begins_anew) {
    bias = torque - friction;
    total = torque;
  } else if (f->remembered.scalar[STATE_FIRST_SAMPLE] != 0.0) {
    bias = f->derived.settings.has_initial_torque ? 0.0 : torque - friction;
    total = f->derived.settings.has_initial_torque ? friction : torque;
  } else {
    const double correction = correction_slope(l, j, torque - total);
    bias += correction;
    total += correction;
  }
  write_slope(derivative->compensated_torque, j, torque - total);
  write_slope(derivative->joint_torque, j, torque);
  write_slope(derivative->friction_torque, j, total);
  write_slope(derivative->bias_torque, j, bias);
  write_slope(derivative->joint_angle, j, l->angle[j].slope);
  write_slope(derivative->joint_speed, j, l->speed[j].slope);
}

static void linearise_torques(linearisation* l, const double* force) {
  linearise_forces(l, force);
  if (elements_of(l->finger)) {
    linearise_limits(l, force);
  }
  linearise_joints(l);
  linearise_extensions(l, force);
}

void directional_derivative(tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                            const tendonfmu_outputs* derivative) {
  linearisation l = {.finger = finger};
  find_grips(finger); /* scratch may be of a sample that was refused */
  signal_derivative signals;
  input_direction(finger, direction, &signals);
  linearise_kinematics(&l, &signals);
  linearise_torques(&l, signals.force);
  for (size_t j = 0; j < finger->joints; ++j) {
    write_joint(&l, j, derivative);
  }
}
