#include "floating_point.h"

#include "step.h"

#include <math.h>

#include "bias_tracker.h"
#include "extensions.h"
#include "kernel_choice.h"
#include "sensor_fault.h"

/* --- kinematics -----------------------------------------------------------------------------------------------------
 */

/* q = R⁺·x1 with x1 = x0 − f0/k (eqs. 2 and 4); position is overwritten by x1 */
static void angles_from_tendons(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    s->position[i] -= s->force[i] * f->derived.inverse_stiffness[i];
  }
  f->kernel->multiply(f, inverse_in_use(f), s->position, s->angle);
}

/* v_k = v_{k−1} + share·((q_k − q_{k−1})/Δt − v_{k−1}), without a filter the raw velocity itself; 0 at the first
 * sample. Returns ∂v/∂q, 1/s. */
static double filter_velocities(tendonfmu_finger* f, double step, double* velocity) {
  if (is_first(f)) {
    clear_lanes(velocity, f->joint_lanes);
    return 0.0;
  }
  const double rate = f->derived.settings.cutoff_rate;
  const double share = rate > 0.0 ? law_one_minus_exponential(rate * step) : 1.0;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double raw = (f->scratch.angle[j] - angle_before_step(f, j)) / step, before = f->remembered.speed[j];
    velocity[j] = share < 1.0 ? before + share * (raw - before) : raw;
  }
  return share / step < 1e300 ? share / step : 1e300; /* finite, however short the step */
}

/* joint angles and all velocities, into scratch; returns ∂v/∂q of this sample (1/s) */
static double find_kinematics(tendonfmu_finger* f, double time, double step) {
  const finger_scratch* s = &f->scratch;
  const int source = source_of(f);
  double gain = 0.0;
  if (source == TENDONFMU_TENDON_POSITIONS) {
    angles_from_tendons(f);
  }
  if (f->extensions.signals) {
    shape_signals(f, time, 1);
  }
  if (source != TENDONFMU_JOINT_VELOCITIES) {
    gain = filter_velocities(f, step, s->velocity + f->joints * f->tendon_lanes);
  }
  f->kernel->tendon_velocities(f, s->velocity);
  return gain;
}

/* --- torques --------------------------------------------------------------------------------------------------------
 */

/* τ = Rᵀ f0 (eq. 3), with the measured forces; less what a guided run knows */
static void measured_torques(tendonfmu_finger* f) {
  f->kernel->multiply(f, f->derived.moment_arm, f->scratch.force, f->scratch.torque);
  for (size_t j = 0; f->guide.known_torque && j < f->joints; ++j) {
    f->scratch.torque[j] -= f->guide.known_torque[j];
  }
}

/* mean |f0| over the tendons */
static double mean_tendon_force(const tendonfmu_finger* f) {
  if (has_option(f, MODEL_HAS_SENSOR_FAULT) && f->scratch.unwell) {
    return mean_sound_force(f);
  }
  double sums[4] = {0.0};
  for (size_t i = 0; i < f->tendons; ++i) {
    sums[i % 4] += fabs(f->scratch.force[i]);
  }
  return sum_of_lanes(sums) / (double)f->tendons;
}

/* 0 unless anything that the extensions are about to remember is infinite or NaN */
static double extension_probe(const tendonfmu_finger* f) {
  double probes[4] = {0.0};
  for (size_t k = 0; k < f->shape.extension_memory; ++k) {
    probes[k % 4] += 0.0 * f->scratch.extension[k];
  }
  return sum_of_lanes(probes);
}

/* 0 when anything that is about to be remembered is not finite, or its square would not be */
static int all_finite(const tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const double* velocity = s->velocity + f->joints * f->tendon_lanes;
  double probe = extension_probe(f);
  for (size_t j = 0; j < f->joints; ++j) {
    double sum = fabs(s->torque[j]) + fabs(s->friction[j]) + (fabs(s->bias_step[j]) + fabs(f->remembered.bias[j]));
    if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
      sum += fabs(s->motor_load[j]) + s->limit[j] + fabs(f->remembered.jumped[j]);
    }
    probe += 0.0 * (1e160 * sum) + (0.0 * s->angle[j] + 0.0 * velocity[j]); /* infinite above 1.8e148 */
  }
  for (size_t i = 0; has_option(f, MODEL_HAS_SENSOR_FAULT) && i < f->tendons; ++i) {
    probe += 0.0 * (1e30 * s->sensor.joint_side[i]); /* nor the force of a spring there */
  }
  return probe == 0.0;
}

/* --- memory ---------------------------------------------------------------------------------------------------------
 */

/* kinematics, forces and memory of the slots: what every accepted sample leaves behind */
static void remember_sample(tendonfmu_finger* f, double time, double velocity_gain, int transitions) {
  const finger_state* to = &f->remembered;
  const finger_scratch* from = &f->scratch;
  if (transitions) {
    remember_transitions(f, time);
  } else {
    clear_lanes(to->event, f->slots);
  }
  f->kernel->remember_slots(f, time);
  copy_lanes(to->angle, from->angle, f->joint_lanes);
  copy_lanes(to->speed, from->velocity + f->joints * f->tendon_lanes, f->joint_lanes);
  copy_lanes(to->torque, from->torque, f->joint_lanes);
  copy_lanes(to->force, from->force, f->tendon_lanes);
  copy_lanes(to->slack, from->slack, f->tendon_lanes);
  if (f->next_count) {
    memcpy(f->state + (f->state_count - f->next_count), f->next, f->next_count * sizeof(double));
  }
  to->scalar[STATE_UNWELL] = from->unwell;
  to->scalar[STATE_STEP] = is_first(f) ? 0.0 : time - to->scalar[STATE_TIME];
  to->scalar[STATE_TIME] = time;
  to->scalar[STATE_VELOCITY_GAIN] = velocity_gain;
}

/* the first sample: nothing detected, nothing tracked */
static void begin_tracking(tendonfmu_finger* f, double time, double mean_force) {
  const finger_state* s = &f->remembered;
  for (size_t slot = 0; slot < f->slots; ++slot) {
    s->event[slot] = 0.0;
    s->last_stuck[slot] = time;
    s->stuck_since[slot] = has_option(f, MODEL_FORGETS_BY_ABSORPTION) ? 0.0 : time;
  }
  clear_lanes(s->joint_contact, f->joint_lanes);
  begin_detection(f, time);
  begin_bias(f, mean_force);
  s->scalar[STATE_INITIALISED] = s->scalar[STATE_FIRST_SAMPLE] = 1.0;
  s->scalar[STATE_CONTACT] = 0.0;
}

static void jump_bias(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    s->bias[j] += f->scratch.bias_step[j];
    if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
      s->jumped[j] += f->scratch.bias_step[j];
    }
  }
}

/* T_eff = b_eff + T with b_eff already stepped, and r; scratch.friction remains T: the estimation reads it */
static void leave_residual(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    s->friction[j] = s->bias[j] + f->scratch.friction[j];
    s->residual[j] = s->torque[j] - s->friction[j];
  }
}

/* steps 4 and 6 of a guided sample: the caller knows what the bias learns from, and contact is not decided */
static void track_guided(tendonfmu_finger* f, double step, double mean_force) {
  const double noise = noise_of_step(f, step, mean_force);
  jump_bias(f);
  leave_residual(f);
  predict_residual(f, step, noise);
  if (f->guide.begins) {
    begin_bias(f, mean_force);
  } else if (f->guide.learns) {
    track_bias(f, step, noise);
  }
}

/* steps 4 to 6 (docs/reference/semantics/README.md#order-of-the-steps) for every later sample */
static void track_sample(tendonfmu_finger* f, double time, double step, double mean_force) {
  const int unwell = has_option(f, MODEL_HAS_SENSOR_FAULT) && f->scratch.unwell;
  jump_bias(f);
  if (unwell) {
    begin_bias_anew(f);
  }
  leave_residual(f);
  if (unwell) {
    forget_unwatched(f);
  }
  const int contact = detect_contact(f, mean_force, time, step);
  if (contact) {
    hold_bias(f, time);
  } else {
    track_bias(f, step, noise_of_step(f, step, mean_force));
  }
  if (unwell && !contact) {
    leave_unwatched(f);
  }
  f->remembered.scalar[STATE_CONTACT] = contact;
}

/* --- the recipe -----------------------------------------------------------------------------------------------------
 */

/* friction, torques and what of the bias jumps, into scratch; returns whether any slot comes to rest or begins to move
 */
static int find_torques(tendonfmu_finger* f) {
  find_grips(f);
  const int transitions = f->kernel->find_friction(f);
  add_extension_torques(f);
  measured_torques(f);
  if (transitions && !is_first(f)) {
    find_bias_steps(f);
  } else {
    clear_lanes(f->scratch.bias_step, f->joint_lanes);
  }
  return transitions;
}

int take_sample(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const int first = is_first(f);
  const double step = time - s->scalar[STATE_TIME];

  for (size_t i = 0; has_option(f, MODEL_HAS_TENDON_ZERO) && uses_positions(f) && i < f->tendons; ++i) {
    f->scratch.position[i] -= f->derived.tendon_zero[i];
  }
  if (has_option(f, MODEL_WATCHES_MOTORS)) { /* x: the load that the motors drive, as if the joints stood */
    f->kernel->multiply(f, f->derived.load_arm, f->scratch.position, f->scratch.motor_load);
  }
  if (f->extensions.signals) {
    shape_signals(f, time, 0);
  }
  if (has_option(f, MODEL_HAS_SENSOR_FAULT)) {
    watch_sensors(f, time, first ? 0.0 : step);
  }
  const double velocity_gain = find_kinematics(f, time, step);
  if (elements_of(f)) {
    turn_places(f, step);
  }
  if (f->shape.extension_count) {
    advance_extensions(f, time, step);
  }
  const int transitions = find_torques(f);
  const double mean_force = mean_tendon_force(f);
  if (!all_finite(f)) {
    return -1;
  }

  remember_sample(f, time, velocity_gain, transitions);
  if (first) {
    begin_tracking(f, time, mean_force);
  } else {
    s->scalar[STATE_ABSORBED_BEFORE] = s->scalar[STATE_ABSORBED];
    s->scalar[STATE_FIRST_SAMPLE] = 0.0;
    if (f->guide.guides) {
      track_guided(f, step, mean_force);
    } else {
      track_sample(f, time, step, mean_force);
    }
  }
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    s->compensated[j] = s->torque[j] - s->friction[j];
  }
  estimate_variance(f, mean_force);
  return 0;
}
