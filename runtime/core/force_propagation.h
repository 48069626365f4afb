/* Friction values at the present velocities, the tendon forces behind them, and the torques they make: eqs. (6)-(10).
 */
#ifndef TENDONFMU_FORCE_PROPAGATION_H
#define TENDONFMU_FORCE_PROPAGATION_H

#include "finger_memory.h"

/* four laws, one a lane: the side that the bits choose (1: negative) */
static inline void load_sides(const double* laws, int negative, quad side[LAW_SIDE_NUMBERS]) {
  const double* const record[4] = {
      laws + (negative & 1) * LAW_SIDE_NUMBERS,
      laws + LAW_NUMBERS + (negative >> 1 & 1) * LAW_SIDE_NUMBERS,
      laws + 2 * LAW_NUMBERS + (negative >> 2 & 1) * LAW_SIDE_NUMBERS,
      laws + 3 * LAW_NUMBERS + (negative >> 3 & 1) * LAW_SIDE_NUMBERS,
  };
  quad_load_records(record, side);
}

/* |F| of four neighbouring laws at speed |v| */
static inline quad laws_magnitude(const double* laws, int negative, quad speed) {
  quad side[LAW_SIDE_NUMBERS];
  load_sides(laws, negative, side);
  return law_magnitude(side, speed);
}

/* |F_B| before joint j of the tendons from `lane` on, at speed |v|: the values of the two neighbouring working points,
 * interpolated linearly in the angle of the joint before; constant outside the grid */
static inline quad edges_magnitude(const tendonfmu_finger* f, size_t j, size_t lane, double angle_before, int negative,
                                   quad speed) {
  const derived_numbers* d = &f->derived;
  const size_t lanes = f->tendon_lanes, points = f->shape.most_points[j];
  const uint32_t* record = d->edge_record + j * lanes + lane;
  const quad angle = quad_set(angle_before);
  quad passed = quad_set(0.0); /* number of working points at or below the angle: the segment */
  for (size_t k = 0; k < points; ++k) {
    const quad point = quad_load(d->edge_angle + d->edge_angle_row[j] + k * lanes + lane);
    passed = quad_add(passed, quad_keep(quad_at_least(angle, point), quad_set(1.0)));
  }
  _Alignas(32) double segment[4];
  quad_store(segment, passed);
  const double *lower[4], *upper[4], *begin[4];
  for (int i = 0; i < 4; ++i) {
    const size_t at = record[i] + (size_t)(int)segment[i];
    lower[i] = d->edge_law + at * LAW_NUMBERS + (negative >> i & 1) * LAW_SIDE_NUMBERS;
    upper[i] = lower[i] + LAW_NUMBERS;
    begin[i] = d->edge_segment + at * 2;
  }
  quad side[LAW_SIDE_NUMBERS];
  quad_load_records(lower, side);
  const quad below = law_magnitude(side, speed);
  if (points == 0) {
    return below;
  }
  quad_load_records(upper, side);
  const quad above = law_magnitude(side, speed);
  quad where[2];
  quad_load_pairs(begin, where);
  const quad weight = quad_mul(quad_sub(angle, where[0]), where[1]);
  return quad_add(below, quad_mul(weight, quad_sub(above, below)));
}

/* F(v) with the sign of v where |v| > v_min, 0 where the effect sticks (fig. 2b) */
static inline quad when_moving(quad magnitude, quad velocity, quad speed, quad threshold) {
  return quad_keep(quad_greater(speed, threshold), quad_with_sign(magnitude, velocity));
}

static inline int negative_bits(quad velocity) {
  return quad_mask_bits(quad_greater(quad_set(0.0), velocity));
}

/* angle of the joint before joint j; q_0 = 0 */
static inline double angle_before(const double* angle, size_t j) {
  return j ? angle[j - 1] : 0.0;
}

/* F_B and F_A of every tendon, T_jv0 and T_jvf of every joint, at the velocities in scratch */
static inline void friction_values(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const derived_numbers* d = &f->derived;
  const size_t lanes = f->tendon_lanes, joint_row = f->joints * lanes;
  quad threshold = quad_set(d->settings.tendon_threshold);
  for (size_t j = 0; j < f->joints; ++j) {
    for (size_t i = 0; i < lanes; i += 4) {
      const size_t at = j * lanes + i;
      const quad v = quad_load(s->velocity + at), speed = quad_abs(v);
      const int negative = negative_bits(v);
      const quad edge = edges_magnitude(f, j, i, angle_before(s->angle, j), negative, speed);
      quad_store(s->edge + at, when_moving(edge, v, speed, threshold));
      if (j > 0) {
        const quad pulley = laws_magnitude(d->pulley_law + at * LAW_NUMBERS, negative, speed);
        quad_store(s->pulley + at, when_moving(pulley, v, speed, threshold));
      }
    }
  }
  threshold = quad_set(d->settings.joint_threshold);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad v = quad_load(s->velocity + joint_row + j), speed = quad_abs(v);
    const int negative = negative_bits(v);
    const quad joint = laws_magnitude(d->joint_law + j * LAW_NUMBERS, negative, speed);
    const quad load = laws_magnitude(d->load_law + j * LAW_NUMBERS, negative, speed);
    quad_store(s->joint_friction + j, when_moving(joint, v, speed, threshold));
    quad_store(s->load_friction + j, when_moving(load, v, speed, threshold));
  }
}

/* a force that friction made negative is slack, replaced by 0; of a bidirectional tendon it is a force like any other
 */
static inline quad without_slack(quad force, quad_mask bidirectional, quad* slack) {
  const quad_mask negative = quad_only_first(quad_greater(quad_set(0.0), force), bidirectional);
  *slack = quad_select(negative, quad_set(1.0), *slack);
  return quad_select(negative, quad_set(0.0), force);
}

/* f_A and f_B along every tendon, as a recursion, and the friction they make at each joint: the sums over the tendons
 * in eqs. (8) and (10). sum [n] of each is accumulated over the tendons. */
static inline void propagate_forces(tendonfmu_finger* f, quad* tendon_friction, quad* load) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  for (size_t i = 0; i < lanes; i += 4) {
    const quad_mask bidirectional = quad_greater(quad_load(f->derived.bidirectional + i), quad_set(0.5));
    quad slack = quad_set(0.0), lost = quad_set(0.0);
    quad force = without_slack(quad_load(s->force + i), bidirectional, &slack);
    for (size_t j = 0; j < n; ++j) {
      const size_t at = j * lanes + i;
      const quad force_at = quad_select(bidirectional, quad_abs(force), force); /* f_A,j−1 */
      const quad edge_loss = quad_mul(force_at, quad_load(s->edge + at));
      force = without_slack(quad_sub(force, edge_loss), bidirectional, &slack);
      const quad force_between = quad_select(bidirectional, quad_abs(force), force); /* f_Bj */
      lost = quad_add(lost, edge_loss);
      if (j + 1 < n) {
        const quad pulley_loss = quad_mul(force_between, quad_load(s->pulley + at + lanes));
        force = without_slack(quad_sub(force, pulley_loss), bidirectional, &slack);
        lost = quad_add(lost, pulley_loss);
      }
      const quad arm = quad_load(f->derived.moment_arm + at);
      tendon_friction[j] = quad_add(tendon_friction[j], quad_mul(arm, lost));
      load[j] = quad_add(load[j], force_between);
      quad_store(s->force_at + at, force_at);
      quad_store(s->force_between + at, force_between);
    }
    quad_store(s->slack + i, slack);
  }
}

/* T_j of eq. (10), with the joint's own friction and cover of eq. (8) */
static inline void total_friction(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const derived_numbers* d = &f->derived;
  quad tendon_friction[MODEL_MAX_JOINTS], load[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < f->joints; ++j) {
    tendon_friction[j] = load[j] = quad_set(0.0);
  }
  propagate_forces(f, tendon_friction, load);
  for (size_t j = 0; j < f->joints; ++j) {
    s->friction[j] = quad_sum(tendon_friction[j]);
    s->load[j] = quad_sum(load[j]);
  }
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad bend = quad_sub(quad_load(s->angle + j), quad_load(d->cover_rest + j));
    const quad cover = quad_mul(quad_load(d->cover_stiffness + j), bend);
    const quad load_friction = quad_mul(quad_load(s->load_friction + j), quad_load(s->load + j));
    const quad joint_friction = quad_add(quad_load(s->joint_friction + j), load_friction);
    quad_store(s->friction + j, quad_add(quad_add(quad_load(s->friction + j), joint_friction), cover));
  }
}

#endif
