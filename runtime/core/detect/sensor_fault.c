#include "floating_point.h"

#include "sensor_fault.h"

#include <math.h>
#include <string.h>

#include "kernel_choice.h"

/* --- rows in use -------------------------------------------------------------------------------------------------- */

/* h_i = r_i·R⁺e_i: the share of a row in its own fit */
static double leverage_of(const tendonfmu_finger* f, size_t i) {
  double sum = 0.0;
  for (size_t j = 0; j < f->joints; ++j) {
    const size_t at = j * f->tendon_lanes + i;
    sum += f->derived.moment_arm[at] * f->scratch.inverse_routing[at];
  }
  return sum;
}

/* R⁺ ← R⁺ − R⁺e_i·(e_iᵀ − r_i·R⁺)/(1 − h_i): the least-squares fit without row i */
static void take_out(tendonfmu_finger* f, size_t i, double freedom) {
  const size_t n = f->joints, lanes = f->tendon_lanes;
  double* inverse = f->scratch.inverse_routing;
  double share[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    share[j] = inverse[j * lanes + i] / freedom;
    inverse[j * lanes + i] = 0.0;
  }
  for (size_t l = 0; l < f->tendons; ++l) {
    double told = 0.0;
    for (size_t j = 0; j < n; ++j) {
      told += f->derived.moment_arm[j * lanes + i] * inverse[j * lanes + l];
    }
    for (size_t j = 0; j < n && l != i; ++j) {
      inverse[j * lanes + l] += share[j] * told;
    }
  }
}

void use_rows(tendonfmu_finger* f, const double* fault) {
  const finger_scratch* s = &f->scratch;
  const int by_tendons = source_of(f) == TENDONFMU_TENDON_POSITIONS;
  memcpy(s->inverse_routing, f->derived.inverse_routing, f->joints * f->tendon_lanes * sizeof(double));
  f->scratch.angles_determined = 1;
  for (size_t i = 0; i < f->tendons; ++i) {
    const double freedom = 1.0 - leverage_of(f, i);
    s->row_in_use[i] = by_tendons;
    if (by_tendons && fault[i] != SENSOR_IS_WELL) {
      if (freedom >= LEAST_FREEDOM) {
        take_out(f, i, freedom);
        s->row_in_use[i] = 0.0;
      } else {
        f->scratch.angles_determined = 0;
      }
    }
  }
  for (size_t i = 0; i < f->tendons; ++i) {
    const double leverage = by_tendons ? leverage_of(f, i) : 0.0, freedom = 1.0 - leverage;
    s->determined[i] = freedom >= LEAST_FREEDOM ? 1.0 : 0.0;
    s->leverage[i] = freedom >= LEAST_FREEDOM ? leverage / freedom : 0.0;
  }
}

/* whether the torque of joint j, or its friction, reads the force of tendon i; joints with load friction read all */
static int joint_reads(const tendonfmu_finger* f, size_t j, size_t i) {
  const int has_load_friction = (f->shape.words[j] >> 3 & 3) != LAW_ABSENT;
  int reads = has_load_friction || f->derived.moment_arm[j * f->tendon_lanes + i] != 0.0;
  for (size_t r = 0; r < f->shape.extension_count; ++r) {
    const effect_place place = f->extensions.signal[r].place;
    reads |= place.joint == j && place.tendon == i;
  }
  return reads;
}

/* joints whose torque, or the whole of them where the angles are not determined, cannot be trusted, into watch [N] */
static void find_blind_joints(const tendonfmu_finger* f, const double* fault, double* watch) {
  for (size_t j = 0; j < f->joints; ++j) {
    int blind = !f->scratch.angles_determined;
    for (size_t i = 0; i < f->tendons; ++i) {
      blind |= fault[i] == FORCE_FAILS && joint_reads(f, j, i);
    }
    watch[j] = blind ? JOINT_BLIND : f->remembered.watch[j] == JOINT_BLIND ? JOINT_BEGINS_ANEW : JOINT_WATCHED;
  }
}

void weigh_forces(const tendonfmu_finger* f, const double* fault, double* weight) {
  size_t sound = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    sound += fault[i] != FORCE_FAILS;
  }
  for (size_t i = 0; i < f->tendons; ++i) {
    weight[i] = sound == 0 ? 1.0 / (double)f->tendons : fault[i] == FORCE_FAILS ? 0.0 : 1.0 / (double)sound;
  }
}

int any_joint_is_blind(const tendonfmu_finger* f) {
  for (size_t j = 0; has_option(f, MODEL_HAS_SENSOR_FAULT) && j < f->joints; ++j) {
    if (f->remembered.watch[j] == JOINT_BLIND) {
      return 1;
    }
  }
  return 0;
}

/* --- all tendons -------------------------------------------------------------------------------------------------- */

/* a sensor begins to fail; what its spring was like before is kept */
static void begin_fault(const tendonfmu_finger* f, size_t i, sensor_fault_kind kind, int jumps, double time) {
  const sensor_memory *before = &f->remembered.sensor, *now = &f->scratch.sensor;
  const double stiffness = f->derived.stiffness[i];
  now->fault[i] = kind;
  now->fault_since[i] = now->unsound_at[i] = time;
  if (kind == FORCE_FAILS && jumps) {
    now->taut_force[i] = before->force[i];
    now->taut_spring[i] = stiffness * (before->position[i] - before->joint_side[i]);
  } else if (kind == POSITION_FAILS) {
    now->taut_force[i] = now->force_then[i];
    now->taut_spring[i] = stiffness * (now->held_position[i] - now->joint_side_then[i]);
  }
}

/* z = x0 − f0/k of all tendons */
static void find_spring_ends(const tendonfmu_finger* f, const double* position, const double* force, double* end) {
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    end[i] = position[i] - force[i] * f->derived.inverse_stiffness[i];
  }
}

/* q of the sample before by the rows in use, times `sign`, added to angle_shift [N] */
static void shift_angles(const tendonfmu_finger* f, double sign) {
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS];
  find_spring_ends(f, f->remembered.sensor.position, f->remembered.sensor.force, spring_end);
  f->kernel->multiply(f, f->scratch.inverse_routing, spring_end, angle);
  for (size_t j = 0; j < f->joints; ++j) {
    f->scratch.angle_shift[j] += sign * angle[j];
  }
}

/* other rows give the angles from this sample on: those of the sample before, and what w is taken from, change too */
static void change_rows(tendonfmu_finger* f) {
  const sensor_memory* now = &f->scratch.sensor;
  if (source_of(f) == TENDONFMU_TENDON_POSITIONS) {
    shift_angles(f, -1.0);
    use_rows(f, now->fault);
    shift_angles(f, 1.0);
    clear_lanes(now->known, f->tendon_lanes);
  }
}

/* whether a sensor fails or a joint is not watched, after this sample */
static int is_unwell(const tendonfmu_finger* f) {
  int any = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    any |= f->scratch.sensor.fault[i] != SENSOR_IS_WELL;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    any |= f->scratch.watch[j] != JOINT_WATCHED;
  }
  return any;
}

void watch_sensors(tendonfmu_finger* f, double time, double step) {
  const sensor_memory* now = &f->scratch.sensor;
  const int by_tendons = source_of(f) == TENDONFMU_TENDON_POSITIONS;
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS];
  clear_lanes(f->scratch.angle_shift, f->joint_lanes);
  clear_lanes(f->scratch.watch, f->joint_lanes);
  copy_lanes(now->fault, f->remembered.sensor.fault, 3 * f->tendon_lanes); /* fault_since and unsound_at, too */
  if (by_tendons) {
    find_spring_ends(f, f->scratch.position, f->scratch.force, spring_end);
    f->kernel->multiply(f, f->scratch.inverse_routing, spring_end, angle);
  }
  const sensor_findings all = f->kernel->watch_tendons(f, by_tendons ? angle : f->scratch.angle, time, step);
  const uint64_t forces = all.forces | all.jumps; /* a force that stands is the likelier fault */
  const uint64_t fails = forces ? forces : all.stands ? 0 : all.positions;
  for (size_t i = 0; i < f->tendons; ++i) {
    if (fails >> i & 1) {
      begin_fault(f, i, forces ? FORCE_FAILS : POSITION_FAILS, (int)(all.jumps >> i & 1), time);
    }
  }
  if (fails | all.recovers) {
    change_rows(f);
  }
  f->scratch.unwell = 0;
  if (fails | all.recovers || f->remembered.scalar[STATE_UNWELL] != 0.0) {
    find_blind_joints(f, now->fault, f->scratch.watch);
    f->scratch.unwell = is_unwell(f);
  }
}

double mean_sound_force(const tendonfmu_finger* f) {
  double weight[MODEL_MAX_TENDONS], sum = 0.0;
  weigh_forces(f, f->scratch.sensor.fault, weight);
  for (size_t i = 0; i < f->tendons; ++i) {
    sum += weight[i] * fabs(f->scratch.force[i]);
  }
  return sum;
}

void leave_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    s->gain[j] = s->watch[j] == JOINT_WATCHED ? s->gain[j] : 0.0;
  }
}

void begin_bias_anew(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    s->bias[j] = s->watch[j] == JOINT_BEGINS_ANEW ? s->torque[j] - f->scratch.friction[j] : s->bias[j];
  }
}

void forget_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    if (s->watch[j] != JOINT_WATCHED) {
      s->residual[j] = s->level[j] = s->joint_contact[j] = 0.0;
    }
  }
}
