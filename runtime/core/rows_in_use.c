#include "floating_point.h"

#include "rows_in_use.h"

#include <string.h>

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
  const int by_tendons = (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_TENDON_POSITIONS;
  memcpy(s->inverse_routing, f->derived.inverse_routing, f->joints * f->tendon_lanes * sizeof(double));
  f->scratch.angles_determined = 1;
  for (size_t i = 0; i < f->tendons; ++i) {
    const double freedom = 1.0 - leverage_of(f, i);
    s->row_in_use[i] = 1.0;
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

void recall_rows(tendonfmu_finger* f) {
  if (f->derived.settings.watches_sensors) {
    use_rows(f, sensor_row(f, f->remembered.sensor, SENSOR_FAULT));
  }
}

/* whether the torque of joint j, or its friction, reads the force of tendon i; joints with load friction read all */
static int joint_reads(const tendonfmu_finger* f, size_t j, size_t i) {
  const int has_load_friction = (f->shape.words[j] >> 3 & 3) != LAW_ABSENT;
  int reads = has_load_friction || f->derived.moment_arm[j * f->tendon_lanes + i] != 0.0;
  for (size_t r = 0; r < f->shape.extension_count; ++r) {
    const effect_place place = f->extensions.row[r].place;
    reads |= place.joint == j && place.tendon == i;
  }
  return reads;
}

void find_blind_joints(tendonfmu_finger* f, const double* fault, double* watch) {
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
  for (size_t j = 0; f->derived.settings.watches_sensors && j < f->joints; ++j) {
    if (f->remembered.watch[j] == JOINT_BLIND) {
      return 1;
    }
  }
  return 0;
}
