/* How far the friction may be from what is modelled: what stiction can hold, and what the errors of the parameters make
 * (docs/reference/semantics/detection.md#friction-bounds). */
#pragma once

#include "force_propagation.h"

#include <math.h>

/* |r_ij|·Σ f·|F| of every tendon, with the forces already propagated, and the joint's own to it, from |F| of both
 * effects of each slot [n × M + N]; to [n] */
HOT_INLINE void held_torque(const tendonfmu_finger* f, const double* edge, const double* pulley, double* to) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes, joint_row = n * lanes;
  quad total[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    total[j] = quad_set(0.0);
  }
  for (size_t i = 0; i < lanes; i += 4) {
    quad held = quad_set(0.0);
    for (size_t at = i, j = 0; j < n; at += lanes, ++j) {
      held = quad_add(held, quad_mul(quad_load(s->force_at + at), quad_load(edge + at)));
      if (j + 1 < n) {
        held = quad_add(held, quad_mul(quad_load(s->force_between + at), quad_load(pulley + at + lanes)));
      }
      total[j] = quad_add(total[j], quad_mul(quad_abs(quad_load(f->derived.moment_arm + at)), held));
    }
  }
  for (size_t j = 0; j < n; ++j) {
    to[j] = quad_sum(total[j]) + (edge[joint_row + j] + pulley[joint_row + j] * s->load[j]);
  }
}

/* the torques of eq. (10) by what makes them: tendons, T_jv0, T_jvf·Σ f_B, T_jq */
HOT_INLINE void torque_parts(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes;
  for (size_t i = 0; i < lanes; i += 4) {
    quad lost = quad_set(0.0);
    for (size_t at = i, j = 0; j < n; at += lanes, ++j) {
      lost = quad_add(lost, quad_load(s->edge_loss + at));
      if (j + 1 < n) {
        lost = quad_add(lost, quad_load(s->pulley_loss + at + lanes));
      }
      quad_store(s->part + at, quad_mul(quad_load(f->derived.moment_arm + at), lost));
    }
  }
  double* own = s->part + n * lanes;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad bend = quad_sub(quad_load(s->angle + j), quad_load(f->derived.cover_rest + j));
    quad_store(own + j, quad_load(s->joint_friction + j));
    quad_store(own + f->joint_lanes + j, quad_mul(quad_load(s->load_friction + j), quad_load(s->load + j)));
    quad_store(own + 2 * f->joint_lanes + j, quad_mul(quad_load(f->derived.cover_stiffness + j), bend));
  }
}

/* u: one standard deviation of the modelled torque, four directions at once */
HOT_INLINE void parameter_uncertainty(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, m = f->tendons;
  if (!model_direction_count(&f->shape)) {
    return; /* u stays 0 */
  }
  const double* direction = f->derived.direction;
  for (size_t j = 0; j < n; ++j) {
    const double* tendon = s->part + j * f->tendon_lanes;
    quad error = quad_set(0.0);
    for (size_t i = 0; i < m; ++i, direction += MODEL_MAX_DIRECTIONS) {
      error = quad_add(error, quad_mul(quad_load(direction), quad_set(tendon[i])));
    }
    for (size_t k = 0; k < MODEL_DIRECTION_SHARES; ++k, direction += MODEL_MAX_DIRECTIONS) {
      error = quad_add(error,
                       quad_mul(quad_load(direction), quad_set(s->part[n * f->tendon_lanes + k * f->joint_lanes + j])));
    }
    s->uncertainty[j] = sqrt(quad_sum(quad_mul(error, error)));
  }
}

/* after the forces are known, before anything is remembered */
HOT_INLINE void bound_friction(tendonfmu_finger* f) {
  if (f->derived.settings.bounds_friction) {
    held_torque(f, f->scratch.edge_stuck, f->scratch.pulley_stuck, f->scratch.stuck_friction); /* S */
  }
  if (f->derived.settings.knows_uncertainty) {
    torque_parts(f);
    parameter_uncertainty(f);
  }
}

/* H: what sticks now, or what is left of what stuck a while ago: real friction goes on turning over for some tens of
 * milliseconds after the model has let go */
HOT_INLINE void remember_stuck(tendonfmu_finger* f, double step) {
  const double rate = f->derived.settings.stuck_rate;
  const quad kept = rate < 0.0 ? quad_set(0.0) : exp_of_minus(quad_set(rate * step));
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    double* stuck = f->remembered.stuck_friction + j;
    const quad now = quad_load(f->scratch.stuck_friction + j), left = quad_mul(quad_load(stuck), kept);
    quad_store(stuck, quad_select(quad_greater(left, now), left, now));
  }
}

/* J: how much the modelled torque has jumped of late: from `before`, the output of the sample before, to T_eff ahead of
 * this sample's update of the bias */
HOT_INLINE void remember_jumps(tendonfmu_finger* f, const double* before, double step) {
  const quad kept = exp_of_minus(quad_set(f->derived.settings.jump_rate * step));
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad friction = quad_add(quad_load(f->remembered.bias + j), quad_load(f->scratch.friction + j));
    const quad jump = quad_abs(quad_sub(friction, quad_load(before + j)));
    double* sum = f->remembered.friction_jump + j;
    const quad larger = quad_add(quad_mul(quad_load(sum), kept), jump);
    quad_store(sum, quad_min(larger, quad_set(LARGEST_SUM))); /* however many jumps pile up */
  }
}
