/* Joint angles with known noise: a Kalman filter over angle, velocity and acceleration of each joint, driven by white
 * jerk, and a gate that holds the angle while the velocity cannot be distinguished from 0
 * (docs/reference/semantics/position_filter.md). */
#pragma once

#include "kinematics.h"

/* what is taken to be known at the first sample: 1 rad/s and 10 rad/s², one standard deviation */
#define FIRST_VELOCITY_VARIANCE     1.0
#define FIRST_ACCELERATION_VARIANCE 100.0

HOT_INLINE quad filter_row(const double* filter, filter_row_kind row, size_t lanes, size_t j) {
  return quad_load(filter + (size_t)row * lanes + j);
}

HOT_INLINE void set_filter_row(double* filter, filter_row_kind row, size_t lanes, size_t j, quad value) {
  quad_store(filter + (size_t)row * lanes + j, value);
}

HOT_INLINE quad not_below_zero(quad a) {
  return quad_keep(quad_greater(a, quad_set(0.0)), a);
}

/* the first sample, or one after a gap: at rest at the measured angle; travel [N]: to there */
HOT_INLINE void begin_position_filter(const tendonfmu_finger* f, const double* angle, double* velocity,
                                      double* travel) {
  const size_t lanes = f->joint_lanes;
  const int first = f->remembered.scalar[STATE_INITIALISED] == 0.0;
  double* to = f->scratch.filter;
  const quad zero = quad_set(0.0), follows = quad_set(first ? 0.0 : 1.0);
  for (size_t j = 0; j < lanes; j += 4) {
    const quad q = quad_load(angle + j),
               held = angle_before_step(f, filter_memory(f, f->remembered.filter, FILTER_HELD_ANGLE), j);
    for (int row = 0; row < FILTER_ROWS; ++row) {
      set_filter_row(to, (filter_row_kind)row, lanes, j, zero);
    }
    set_filter_row(to, FILTER_ANGLE, lanes, j, q);
    set_filter_row(to, FILTER_HELD_ANGLE, lanes, j, q);
    set_filter_row(to, FILTER_P00, lanes, j, quad_load(f->derived.position_variance + j));
    set_filter_row(to, FILTER_P11, lanes, j, quad_set(FIRST_VELOCITY_VARIANCE));
    set_filter_row(to, FILTER_P22, lanes, j, quad_set(FIRST_ACCELERATION_VARIANCE));
    set_filter_row(to, FILTER_GAIN_0, lanes, j, follows);
    set_filter_row(to, FILTER_CARRIES, lanes, j, follows);
    quad_store(velocity + j, zero);
    quad_store(travel + j, quad_sub(q, held));
  }
}

/* four joints of a later sample, angle [4]; velocity [4] receives that of the filter, travel [4] how far the held angle
 * moves */
HOT_INLINE void filter_four_joints(const tendonfmu_finger* f, size_t j, const double* angle, double step,
                                   double* velocity, double* travel) {
  const size_t lanes = f->joint_lanes;
  const double* from = f->remembered.filter;
  double* to = f->scratch.filter;
  const double jerk = f->derived.settings.jerk_density * step, square = step * step;
  const quad h = quad_set(step), half = quad_set(0.5 * square);
  const quad p00 = filter_row(from, FILTER_P00, lanes, j), p01 = filter_row(from, FILTER_P01, lanes, j);
  const quad p02 = filter_row(from, FILTER_P02, lanes, j), p11 = filter_row(from, FILTER_P11, lanes, j);
  const quad p12 = filter_row(from, FILTER_P12, lanes, j), p22 = filter_row(from, FILTER_P22, lanes, j);

  /* x⁻ = F x, P⁻ = F P Fᵀ + J·Q */
  const quad acceleration = filter_row(from, FILTER_ACCELERATION, lanes, j);
  const quad speed = quad_add(quad_load(f->remembered.speed + j), quad_mul(h, acceleration));
  const quad moved = quad_sub(quad_mul(h, speed), quad_mul(half, acceleration));
  const quad ahead = quad_add(angle_before_step(f, filter_memory(f, from, FILTER_ANGLE), j), moved);
  const quad m01 = quad_add(p01, quad_add(quad_mul(h, p11), quad_mul(half, p12)));
  const quad m02 = quad_add(p02, quad_add(quad_mul(h, p12), quad_mul(half, p22)));
  const quad m12 = quad_add(p12, quad_mul(h, p22));
  const quad m00 = quad_add(p00, quad_add(quad_mul(h, p01), quad_mul(half, p02)));
  const quad m11 = quad_add(p11, quad_mul(h, p12));
  const quad g00 = quad_add(quad_add(m00, quad_add(quad_mul(h, m01), quad_mul(half, m02))),
                            quad_set(jerk * square * square * (1.0 / 20.0)));
  const quad g01 = quad_add(quad_add(m01, quad_mul(h, m02)), quad_set(jerk * square * step * (1.0 / 8.0)));
  const quad g02 = quad_add(m02, quad_set(jerk * square * (1.0 / 6.0)));
  const quad g11 = quad_add(quad_add(m11, quad_mul(h, m12)), quad_set(jerk * square * (1.0 / 3.0)));
  const quad g12 = quad_add(m12, quad_set(jerk * step * 0.5));
  const quad g22 = quad_add(p22, quad_set(jerk));

  /* the measured angle */
  const quad noise = quad_load(f->derived.position_variance + j);
  const quad inverse = quad_div(quad_set(1.0), quad_add(not_below_zero(g00), noise));
  const quad k0 = quad_mul(not_below_zero(g00), inverse), k1 = quad_mul(g01, inverse), k2 = quad_mul(g02, inverse);
  const quad innovation = quad_sub(quad_load(angle), ahead);
  const quad x = quad_add(ahead, quad_mul(k0, innovation)), v = quad_add(speed, quad_mul(k1, innovation));
  const quad q00 = quad_mul(noise, k0), q11 = not_below_zero(quad_sub(g11, quad_mul(k1, g01)));
  set_filter_row(to, FILTER_ANGLE, lanes, j, x);
  set_filter_row(to, FILTER_ACCELERATION, lanes, j, quad_add(acceleration, quad_mul(k2, innovation)));
  set_filter_row(to, FILTER_P00, lanes, j, q00);
  set_filter_row(to, FILTER_P01, lanes, j, quad_mul(noise, k1));
  set_filter_row(to, FILTER_P02, lanes, j, quad_mul(noise, k2));
  set_filter_row(to, FILTER_P11, lanes, j, q11);
  set_filter_row(to, FILTER_P12, lanes, j, quad_sub(g12, quad_mul(k1, g02)));
  set_filter_row(to, FILTER_P22, lanes, j, not_below_zero(quad_sub(g22, quad_mul(k2, g02))));
  set_filter_row(to, FILTER_GAIN_0, lanes, j, k0);
  set_filter_row(to, FILTER_GAIN_1, lanes, j, k1);
  set_filter_row(to, FILTER_GAIN_2, lanes, j, k2);
  quad_store(velocity, v);

  /* the gate: two standard deviations of velocity and angle */
  const quad held = angle_before_step(f, filter_memory(f, from, FILTER_HELD_ANGLE), j),
             width = quad_mul(quad_set(2.0), quad_sqrt(q00));
  const quad low = quad_sub(x, width), high = quad_add(x, width);
  const quad_mask moves = quad_greater(quad_mul(v, v), quad_mul(quad_set(4.0), q11));
  const quad_mask above = quad_greater(held, high), below = quad_greater(low, held);
  const quad gated = quad_select(above, high, quad_select(below, low, held)), next = quad_select(moves, x, gated);
  set_filter_row(to, FILTER_HELD_ANGLE, lanes, j, next);
  set_filter_row(to, FILTER_CARRIES, lanes, j, quad_keep(quad_either(moves, quad_either(above, below)), quad_set(1.0)));
  quad_store(travel, quad_sub(next, held));
}

/* velocities and travels of all joints, and what the filter will remember, into scratch */
HOT_INLINE void filter_positions(const tendonfmu_finger* f, const double* angle, double step, double* velocity,
                                 double* travel) {
  if (f->remembered.scalar[STATE_INITIALISED] == 0.0 || step > LONGEST_FILTER_STEP) {
    begin_position_filter(f, angle, velocity, travel);
    return;
  }
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    filter_four_joints(f, j, angle + j, step, velocity + j, travel + j);
  }
}

/* 0 unless all that the filter will remember is finite */
HOT_INLINE int filter_is_finite(const tendonfmu_finger* f) {
  quad probe = quad_set(0.0);
  for (size_t i = 0; i < FILTER_ROWS * f->joint_lanes; i += 4) {
    probe = quad_add(probe, quad_mul(quad_set(0.0), quad_load(f->scratch.filter + i)));
  }
  return quad_sum(probe) == 0.0;
}
