/* A kernel of the lanes that the source asks for (quad.h): sums over the tendons, eqs. (2) to (5), beside
 * force_propagation.h. */
#pragma once

#include "force_propagation.h"
#include "kernel_choice.h"

/* Σ over the tendons of row[i]·x[i], still to be summed across the lanes */
HOT_INLINE quad_sums tendon_lane_sums(const double* row, const double* x, size_t lanes) {
  quad_sums sums;
  for (size_t i = 0; i < 4; i += QUAD_LANES) {
    sums.of[i / QUAD_LANES] = quad_load(row + i) * quad_load(x + i);
  }
  for (size_t i = 4; i < lanes; i += QUAD_LANES) {
    quad_sums_add(&sums, i, quad_load(row + i) * quad_load(x + i));
  }
  return sums;
}

/* matrix [n × M] times x [M] */
static void multiply(const tendonfmu_finger* f, const double* matrix, const double* x, double* product) {
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_sums sums[QUAD_LANES];
    for (size_t k = 0; k < QUAD_LANES; ++k) {
      if (j + k < f->joints) {
        sums[k] = tendon_lane_sums(matrix + (j + k) * f->tendon_lanes, x, f->tendon_lanes);
      } else {
        memset(&sums[k], 0, sizeof sums[k]);
      }
    }
    quad_store(product + j, quad_sum_rows(sums));
  }
}

/* ẋ_ij = Σ_{j' >= j} r_ij'·q̇_j' (eq. 5) into rows of velocity; the joint velocities stand in its last row */
static void tendon_velocities(const tendonfmu_finger* f, double* velocity) {
  const size_t lanes = f->tendon_lanes;
  const double* joint_velocity = velocity + f->joints * lanes;
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad sum = quad_set(0.0);
    for (size_t j = f->joints; j-- > 0;) {
      sum += quad_load(f->derived.moment_arm + j * lanes + i) * joint_velocity[j];
      quad_store(velocity + j * lanes + i, sum);
    }
  }
}

static void one_minus_exponentials(const double* x, double* values, size_t count) {
  for (size_t i = 0; i < count; i += QUAD_LANES) {
    quad_store(values + i, one_minus_exp_of_minus(quad_load(x + i)));
  }
}

#define STEP_KERNEL(name) \
  { name, one_minus_exponentials, multiply, tendon_velocities, find_friction, remember_slots, restart_rests }
