/* From tendon positions to joint angles and velocities, eqs. (2), (4), (5), and the velocity filter. */
#pragma once

#include "finger_memory.h"

/* Σ over the tendons of row[i]·x[i], still to be summed across the lanes */
HOT_INLINE quad_sums tendon_lane_sums(const double* row, const double* x, size_t lanes) {
  quad_sums sums;
  for (size_t i = 0; i < 4; i += QUAD_LANES) {
    quad_sums_begin(&sums, i, quad_mul(quad_load(row + i), quad_load(x + i)));
  }
  for (size_t i = 4; i < lanes; i += QUAD_LANES) {
    quad_sums_add(&sums, i, quad_mul(quad_load(row + i), quad_load(x + i)));
  }
  return sums;
}

HOT_INLINE double tendon_sum(const double* row, const double* x, size_t lanes) {
  const quad_sums sums = tendon_lane_sums(row, x, lanes);
  return quad_sum(&sums);
}

/* the same of the joints from j on, one a lane: matrix [n × M] times x [M] */
HOT_INLINE quad tendon_sums(const tendonfmu_finger* f, const double* matrix, const double* x, size_t j) {
  quad_sums sums[QUAD_LANES];
  for (size_t k = 0; k < QUAD_LANES; ++k) {
    if (j + k < f->joints) {
      sums[k] = tendon_lane_sums(matrix + (j + k) * f->tendon_lanes, x, f->tendon_lanes);
    } else {
      quad_sums_clear(&sums[k]);
    }
  }
  return quad_sum_rows(sums);
}

/* q = R⁺·x1 with x1 = x0 − f0/k, into angle [n]; position is overwritten by x1 */
HOT_INLINE void angles_from_tendons(const tendonfmu_finger* f, const double* force, double* position, double* angle) {
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const quad stretch = quad_mul(quad_load(force + i), quad_load(f->derived.inverse_stiffness + i));
    quad_store(position + i, quad_sub(quad_load(position + i), stretch));
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    quad_store(angle + j, tendon_sums(f, inverse_in_use(f), position, j));
  }
}

/* four joint angles of the sample before, by the rows that are in use now */
HOT_INLINE quad angle_before_step(const tendonfmu_finger* f, const double* angle, size_t j) {
  const quad before = quad_load(angle + j);
  return f->derived.settings.watches_sensors ? quad_add(before, quad_load(f->scratch.angle_shift + j)) : before;
}

/* share of the raw velocity that the filter takes in a step: 1 − exp(−2π·cutoff·Δt), 1 without a filter */
HOT_INLINE double filter_share(double cutoff_rate, double step) {
  return cutoff_rate > 0.0 ? law_one_minus_exponential(cutoff_rate * step) : 1.0;
}

/* v_k = v_{k−1} + share·((q_k − q_{k−1})/Δt − v_{k−1}) for all joints; cutoff 0: the raw velocity itself */
HOT_INLINE void filter_velocities(const tendonfmu_finger* f, const double* angle, double step, double share,
                                  double* velocity) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad raw = quad_div(quad_sub(quad_load(angle + j), angle_before_step(f, s->angle, j)), quad_set(step));
    const quad before = quad_load(s->speed + j);
    const quad filtered = quad_add(before, quad_mul(quad_set(share), quad_sub(raw, before)));
    quad_store(velocity + j, share < 1.0 ? filtered : raw);
  }
}

/* ẋ_ij = Σ_{j' >= j} r_ij'·q̇_j' (eq. 5) into rows of velocity; the joint velocities stand in its last row */
HOT_INLINE void relative_velocities(const tendonfmu_finger* f, double* velocity) {
  const size_t lanes = f->tendon_lanes;
  const double* joint_velocity = velocity + f->joints * lanes;
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad sum = quad_set(0.0);
    for (size_t j = f->joints; j-- > 0;) {
      const quad arm = quad_load(f->derived.moment_arm + j * lanes + i);
      sum = quad_add(sum, quad_mul(arm, quad_set(joint_velocity[j])));
      quad_store(velocity + j * lanes + i, sum);
    }
  }
}
