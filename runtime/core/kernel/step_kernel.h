/* One sample of the finger, as a recipe. Compiled once for each instruction set: step_plain.c, step_sse2.c, step_avx2.c
 * include a quad and then this. */
#pragma once

#include "bias_tracker.h"
#include "contact_detector.h"
#include "extensions.h"
#include "force_propagation.h"
#include "kernel_choice.h"
#include "kinematics.h"
#include "sensor_fault.h"

HOT_INLINE int is_first(const tendonfmu_finger* f) {
  return f->remembered.scalar[STATE_INITIALISED] == 0.0;
}

/* NaN is out of range */
HOT_INLINE int row_in_range(const double* row, size_t lanes) {
  int inside = QUAD_ALL;
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    inside &= quad_mask_bits(quad_at_least(quad_set(LARGEST_INPUT), quad_abs(quad_load(row + i))));
  }
  return inside == QUAD_ALL;
}

HOT_INLINE int uses_positions(const tendonfmu_finger* f) {
  return (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_TENDON_POSITIONS || f->derived.settings.watches_motors ||
         f->derived.settings.watches_sensors;
}

HOT_INLINE int inputs_in_range(const tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const int source = (int)f->remembered.scalar[STATE_SOURCE];
  if (!row_in_range(s->force, f->tendon_lanes) || (uses_positions(f) && !row_in_range(s->position, f->tendon_lanes))) {
    return 0;
  }
  if (source == TENDONFMU_TENDON_POSITIONS) {
    return 1;
  }
  return row_in_range(s->angle, f->joint_lanes) &&
         (source != TENDONFMU_JOINT_VELOCITIES ||
          row_in_range(s->velocity + f->joints * f->tendon_lanes, f->joint_lanes));
}

/* x0 from the reading at which all joints are at 0 */
HOT_INLINE void take_zeros(tendonfmu_finger* f) {
  double* position = f->scratch.position;
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    quad_store(position + i, quad_sub(quad_load(position + i), quad_load(f->derived.tendon_zero + i)));
  }
}

/* x: the load that the motors drive, as if the joints stood */
HOT_INLINE void motor_loads(tendonfmu_finger* f) {
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(f->scratch.motor_load + j, tendon_sums(f, f->derived.load_arm, f->scratch.position, j));
  }
}

/* joint angles and all velocities, into scratch; returns ∂v/∂q of this sample (1/s) */
HOT_INLINE double find_kinematics(tendonfmu_finger* f, double time, double step) {
  const finger_scratch* s = &f->scratch;
  double* joint_velocity = s->velocity + f->joints * f->tendon_lanes;
  const int source = (int)f->remembered.scalar[STATE_SOURCE];
  double gain = 0.0;
  if (source == TENDONFMU_TENDON_POSITIONS) {
    angles_from_tendons(f, s->force, s->position, s->angle);
  }
  if (f->extensions.signals) {
    shape_signals(f, time, 1);
  }
  if (source != TENDONFMU_JOINT_VELOCITIES) {
    if (is_first(f)) {
      for (size_t j = 0; j < f->joint_lanes; ++j) {
        joint_velocity[j] = 0.0;
      }
    } else {
      const double share = filter_share(f->derived.settings.cutoff_rate, step);
      filter_velocities(f, s->angle, step, share, joint_velocity);
      gain = share / step < 1e300 ? share / step : 1e300; /* finite, however short the step */
    }
  }
  relative_velocities(f, s->velocity);
  return gain;
}

/* τ = Rᵀ f0 (eq. 3), with the measured forces */
HOT_INLINE void measured_torques(tendonfmu_finger* f) {
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(f->scratch.torque + j, tendon_sums(f, f->derived.moment_arm, f->scratch.force, j));
  }
}

/* τ less the torque that a guided run knows */
COLD_STATIC void take_known_torque(tendonfmu_finger* f) {
  for (size_t j = 0; j < f->joints; ++j) {
    f->scratch.torque[j] -= f->guide.known_torque[j];
  }
}

/* mean |f0| over the tendons */
HOT_INLINE double mean_tendon_force(const tendonfmu_finger* f) {
  if (f->derived.settings.watches_sensors && f->scratch.unwell) {
    return mean_sound_force(f);
  }
  quad_sums sums;
  quad_sums_clear(&sums);
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    quad_sums_add(&sums, i, quad_abs(quad_load(f->scratch.force + i)));
  }
  return quad_sum(&sums) / (double)f->tendons;
}

/* 0 in all lanes unless anything that the extensions are about to remember is infinite or NaN */
HOT_INLINE quad extension_probe(const tendonfmu_finger* f) {
  enum { TWO = 2 * QUAD_LANES };
  const size_t count = f->shape.extension_memory, whole = count / TWO * TWO;
  const quad zero = quad_set(0.0);
  quad even = zero, odd = zero;
  double rest = 0.0;
  for (size_t k = 0; k < whole; k += TWO) {
    even = quad_add(even, quad_mul(zero, quad_load(f->scratch.extension + k)));
    odd = quad_add(odd, quad_mul(zero, quad_load(f->scratch.extension + k + QUAD_LANES)));
  }
  for (size_t k = whole; k < count; ++k) {
    rest += 0.0 * f->scratch.extension[k];
  }
  return quad_add(quad_add(even, odd), quad_set(rest));
}

/* 0 when anything that is about to be remembered is not finite, or its square would not be */
HOT_INLINE int all_finite(const tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const double* joint_velocity = s->velocity + f->joints * f->tendon_lanes;
  const quad zero = quad_set(0.0);
  quad probe = extension_probe(f);
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad torques = quad_add(quad_abs(quad_load(s->torque + j)), quad_abs(quad_load(s->friction + j)));
    const quad biases = quad_add(quad_abs(quad_load(s->bias_step + j)), quad_abs(quad_load(f->remembered.bias + j)));
    quad sum = quad_add(torques, biases);
    if (f->derived.settings.has_bands) {
      const quad detected = quad_add(quad_abs(quad_load(s->motor_load + j)), quad_load(s->limit + j));
      sum = quad_add(sum, quad_add(detected, quad_abs(quad_load(f->remembered.jumped + j))));
    }
    const quad motion =
        quad_add(quad_mul(zero, quad_load(s->angle + j)), quad_mul(zero, quad_load(joint_velocity + j)));
    probe =
        quad_add(probe, quad_add(quad_mul(zero, quad_mul(quad_set(1e160), sum)), motion)); /* infinite above 1.8e148 */
  }
  return quad_mask_bits(quad_at_least(zero, quad_abs(probe))) == QUAD_ALL &&
         (!f->derived.settings.watches_sensors || sensors_are_finite(f));
}

HOT_INLINE void copy_row(double* to, const double* from, size_t lanes) {
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad_store(to + i, quad_load(from + i));
  }
}

/* T_eff = b_eff + T with b_eff already stepped */
HOT_INLINE void effective_friction(tendonfmu_finger* f, double* total) {
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(total + j, quad_add(quad_load(f->remembered.bias + j), quad_load(f->scratch.friction + j)));
  }
}

HOT_INLINE void leave_residual(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  effective_friction(f, s->friction); /* scratch.friction remains T: the estimation reads it */
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(s->residual + j, quad_sub(quad_load(s->torque + j), quad_load(s->friction + j)));
  }
}

/* kinematics, forces and memory of the slots: what every accepted sample leaves behind */
HOT_INLINE void remember_sample(tendonfmu_finger* f, double time, double velocity_gain, int transitions) {
  const finger_state* s = &f->remembered;
  if (transitions) {
    remember_transitions(f, time);
  } else {
    forget_transitions(f);
  }
  remember_slots(f, time);
  copy_row(s->angle, f->scratch.angle, f->joint_lanes);
  copy_row(s->speed, f->scratch.velocity + f->joints * f->tendon_lanes, f->joint_lanes);
  copy_row(s->torque, f->scratch.torque, f->joint_lanes);
  copy_row(s->force, f->scratch.force, f->tendon_lanes);
  copy_row(s->slack, f->scratch.slack, f->tendon_lanes);
  if (f->derived.settings.watches_sensors) {
    remember_sensors(f);
  }
  if (f->shape.extension_count) {
    remember_extensions(f);
  }
  if (f->memory.elements) {
    remember_elements(f);
  }
  s->scalar[STATE_STEP] = is_first(f) ? 0.0 : time - s->scalar[STATE_TIME];
  s->scalar[STATE_TIME] = time;
  s->scalar[STATE_VELOCITY_GAIN] = velocity_gain;
}

/* b_eff = τ − T unless it is given */
HOT_INLINE void begin_bias(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const double variance =
      settings->initial_variance >= 0.0 ? settings->initial_variance : noise_variance(settings, mean_force, 1.0);
  for (size_t j = 0; j < f->joints; ++j) {
    s->bias[j] = settings->has_initial_torque ? f->derived.initial_torque[j] : s->torque[j] - f->scratch.friction[j];
    s->variance[j] = variance;
    s->gain[j] = 0.0;
  }
  effective_friction(f, s->friction);
  if (!settings->has_initial_torque) {
    copy_row(s->friction, s->torque, f->joint_lanes); /* to the last bit */
  }
}

/* the first sample: nothing detected, nothing tracked */
HOT_INLINE void begin_tracking(tendonfmu_finger* f, double time, double mean_force) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  for (size_t slot = 0; slot < f->slots; ++slot) {
    s->event[slot] = 0.0;
    s->last_stuck[slot] = time;
    s->stuck_since[slot] = settings->forgets_by_absorption ? 0.0 : time;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    s->joint_contact[j] = 0.0;
  }
  for (size_t j = 0; settings->has_bands && j < f->joints; ++j) {
    begin_bands(f, j, time);
  }
  begin_bias(f, mean_force);
  s->scalar[STATE_INITIALISED] = 1.0;
  s->scalar[STATE_FIRST_SAMPLE] = 1.0;
  s->scalar[STATE_CONTACT] = 0.0;
}

/* noise variance of step 6 */
HOT_INLINE double noise_of_step(const tendonfmu_finger* f, double step, double mean_force) {
  const finger_settings* settings = &f->derived.settings;
  const double wanted = settings->noise_time >= 0.0 ? settings->noise_time / step : 1.0;
  const double scale = wanted < 1e300 ? wanted : 1e300; /* finite, however short the step */
  return noise_variance(settings, mean_force, scale);
}

HOT_INLINE void jump_bias(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(s->bias + j, quad_add(quad_load(s->bias + j), quad_load(f->scratch.bias_step + j)));
    if (f->derived.settings.has_bands) {
      quad_store(s->jumped + j, quad_add(quad_load(s->jumped + j), quad_load(f->scratch.bias_step + j)));
    }
  }
}

/* steps 4 and 6 of a guided sample: the caller knows what the bias learns from, and contact is not decided */
COLD_STATIC void track_guided(tendonfmu_finger* f, double step, double mean_force) {
  const finger_state* s = &f->remembered;
  const double noise = noise_of_step(f, step, mean_force);
  jump_bias(f);
  leave_residual(f);
  s->scalar[STATE_ABSORBED_BEFORE] = s->scalar[STATE_ABSORBED];
  predict_residual(f, step, noise);
  if (f->guide.begins) {
    begin_bias(f, mean_force);
  } else if (f->guide.learns) {
    track_bias(f, step, noise);
  }
  s->scalar[STATE_FIRST_SAMPLE] = 0.0;
}

/* steps 4 to 6 (docs/reference/semantics/README.md#order-of-the-steps) for every later sample */
HOT_INLINE void track_sample(tendonfmu_finger* f, double time, double step, double mean_force) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const int unwell = settings->watches_sensors && f->scratch.unwell;
  jump_bias(f);
  if (unwell) {
    begin_bias_anew(f);
  }
  leave_residual(f);
  if (unwell) {
    forget_unwatched(f);
  }
  const int contact = detect_contact(f, mean_force, time, step);
  s->scalar[STATE_ABSORBED_BEFORE] = s->scalar[STATE_ABSORBED];
  if (contact) {
    hold_bias(f, time);
  } else {
    track_bias(f, step, noise_of_step(f, step, mean_force));
    if (unwell) {
      leave_unwatched(f);
    }
  }
  s->scalar[STATE_FIRST_SAMPLE] = 0.0;
  s->scalar[STATE_CONTACT] = contact ? 1.0 : 0.0;
}

/* The recipe. Inputs stand in scratch; unless SAMPLE_TAKEN is returned, nothing is remembered. */
static sample_result take_sample(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  const int first = is_first(f);
  const double step = time - s->scalar[STATE_TIME];

  if (!inputs_in_range(f)) {
    return SAMPLE_OUT_OF_RANGE;
  }
  if (f->derived.settings.has_tendon_zero && uses_positions(f)) {
    take_zeros(f);
  }
  if (f->derived.settings.watches_motors) {
    motor_loads(f);
  }
  if (f->extensions.signals) {
    shape_signals(f, time, 0);
  }
  if (f->derived.settings.watches_sensors) {
    watch_sensors(f, time, first ? 0.0 : step);
  }
  const double velocity_gain = find_kinematics(f, time, step);
  if (f->shape.extension_count) {
    if (f->memory.elements) {
      turn_places(f, step, first);
    }
    advance_extensions(f, time, step);
  }
  find_grips(f);
  const int transitions = friction_values(f);
  total_friction(f);
  add_extension_torques(f);
  measured_torques(f);
  if (f->guide.known_torque) {
    take_known_torque(f);
  }
  const double mean_force = mean_tendon_force(f);
  if (f->derived.settings.has_bands) {
    friction_limits(f);
  }
  if (transitions && !first) {
    bias_steps(f);
  } else {
    for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
      quad_store(f->scratch.bias_step + j, quad_set(0.0));
    }
  }
  if (!all_finite(f)) {
    return SAMPLE_OVERFLOWS;
  }

  remember_sample(f, time, velocity_gain, transitions);
  if (first) {
    begin_tracking(f, time, mean_force);
  } else if (f->guide.guides) {
    track_guided(f, step, mean_force);
  } else {
    track_sample(f, time, step, mean_force);
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(s->compensated + j, quad_sub(quad_load(s->torque + j), quad_load(s->friction + j)));
  }
  estimate_variance(f, mean_force);
  return SAMPLE_TAKEN;
}
