/* Friction values at the present velocities, the tendon forces behind them, and the torques they make: eqs. (6)-(10).
 */
#pragma once

#include "friction_elements.h"
#include "slot_view.h"

/* lanes that moved at the last sample */
HOT_INLINE quad_mask moved_before(const tendonfmu_finger* f, size_t slot) {
  return quad_greater(quad_load(f->remembered.moving + slot), quad_set(0.5));
}

/* lanes that move at this one */
HOT_INLINE quad_mask moves_at(quad speed, double threshold) {
  return quad_greater(speed, quad_set(threshold));
}

/* one bit a lane: it comes to rest or begins to move */
HOT_INLINE int transition_bits(const tendonfmu_finger* f, size_t slot, quad_mask moving) {
  return quad_mask_bits(quad_differ(moving, moved_before(f, slot)));
}

/* where a slot stands in its view */
HOT_INLINE size_t view_lane(size_t slot) {
  return QUAD_LANES == 4 ? 0 : slot % 4;
}

/* the laws of a view from a lane on, one a lane */
HOT_INLINE quad laws_magnitude(const double rows[LAW_SIDE_NUMBERS][4], size_t lane, quad speed) {
  const quad side[LAW_SIDE_NUMBERS] = {quad_load(rows[0] + lane), quad_load(rows[1] + lane), quad_load(rows[2] + lane),
                                       quad_load(rows[3] + lane)};
  return law_magnitude(side, speed);
}

/* |F_B| at speed |v|: the values of the two neighbouring working points, interpolated linearly in the angle of the
 * joint before; constant outside the grid */
HOT_INLINE quad edges_magnitude(const slot_view* view, size_t lane, quad angle, quad speed) {
  const quad below = laws_magnitude(view->below, lane, speed);
  if (view->blends[lane] == 0.0) {
    return below;
  }
  const quad above = laws_magnitude(view->above, lane, speed);
  const quad begin = quad_load(view->begin + lane), inverse_length = quad_load(view->inverse_length + lane);
  const quad weight = quad_mul(quad_sub(angle, begin), inverse_length);
  return quad_add(below, quad_mul(weight, quad_sub(above, below)));
}

HOT_INLINE int negative_bits(quad velocity) {
  return quad_mask_bits(quad_greater(quad_set(0.0), velocity));
}

/* angle of the joint before joint j; q_0 = 0 */
HOT_INLINE double angle_before(const double* angle, size_t j) {
  return j ? angle[j - 1] : 0.0;
}

/* the view of four slots, filled anew where a moving lane is on another side or the angle has left its segment; a lane
 * that sticks keeps its side, so that noise around zero velocity costs nothing */
HOT_INLINE const slot_view* view_at(tendonfmu_finger* f, size_t slot, quad velocity, quad_mask moving, double angle) {
  slot_view* view = f->scratch.view + slot / 4;
  const size_t lane = view_lane(slot);
  const int moves = quad_mask_bits(moving), known = (int)view->key[lane];
  const int held = known < 0 || f->extensions.gripped; /* what slides may be on another side than it remembers */
  const int resting = held ? negative_bits(quad_load(f->remembered.side + slot)) : known;
  const int negative = (negative_bits(velocity) & moves) | (resting & ~moves);
  const quad q = quad_set(angle);
  const quad_mask inside =
      quad_both(quad_at_least(q, quad_load(view->low + lane)), quad_greater(quad_load(view->high + lane), q));
  if (negative != known || quad_mask_bits(inside) != QUAD_ALL) {
    slot_view_fill(f, slot, QUAD_LANES, angle, negative, view);
  }
  return view;
}

/* F(v) with the sign of v where |v| > v_min, 0 where the effect sticks (fig. 2b) */
HOT_INLINE quad when_moving(quad_mask moving, quad magnitude, quad velocity) {
  return quad_keep(moving, quad_with_sign(magnitude, velocity));
}

/* F of four slots from |F| of the law: as fig. 5 has it, or |F| itself where it has a memory, and what the friction
 * rows make of it */
HOT_INLINE quad acting_friction(const tendonfmu_finger* f, size_t slot, quad_mask moving, quad magnitude,
                                quad velocity) {
  const quad by_motion = when_moving(moving, magnitude, velocity);
  if (!f->extensions.gripped) {
    return by_motion;
  }
  return quad_mul(quad_load(f->scratch.grip + slot), quad_select(slides_at(f, slot), magnitude, by_motion));
}

/* |F| of one effect at four slots for the bands, whether it acts or not */
HOT_INLINE void keep_limit(const tendonfmu_finger* f, double* limit, size_t slot, quad magnitude) {
  if (f->derived.settings.has_bands) {
    const int gripped = f->extensions.gripped;
    quad_store(limit + slot, gripped ? quad_mul(quad_load(f->scratch.grip + slot), magnitude) : magnitude);
  }
}

/* whether F of four slots is 0 without a look at the laws: nothing moves, now or before, or slides; for the
 * bands, which need |F| of what sticks, only where it can hold no joint */
HOT_INLINE int nothing_acts(const tendonfmu_finger* f, size_t slot, quad_mask moving) {
  int acts = quad_mask_bits(quad_either(moving, moved_before(f, slot)));
  if (f->derived.settings.has_bands) {
    acts |= f->derived.can_hold[slot / 4];
  }
  return !(acts | quad_mask_bits(slides_at(f, slot)));
}

/* F_B and F_A of four tendons at joint j, from slot `at` on; returns whether any of them comes to rest or begins to
 * move */
HOT_INLINE int friction_of_tendons(tendonfmu_finger* f, size_t j, size_t at) {
  const finger_scratch* s = &f->scratch;
  const double before = angle_before(s->angle, j);
  const quad v = quad_load(s->velocity + at), speed = quad_abs(v);
  const quad_mask moving = moves_at(speed, f->derived.settings.tendon_threshold);
  if (nothing_acts(f, at, moving)) {
    quad_store(s->edge + at, quad_set(0.0));
    quad_store(s->pulley + at, quad_set(0.0));
    return 0;
  }
  const slot_view* view = view_at(f, at, v, moving, before);
  const quad edge = edges_magnitude(view, view_lane(at), quad_set(before), speed);
  quad_store(s->edge + at, acting_friction(f, at, moving, edge, v));
  keep_limit(f, s->edge_limit, at, edge);
  if (j > 0) { /* before the first joint there is no pulley */
    const quad pulley = laws_magnitude(view->other, view_lane(at), speed);
    quad_store(s->pulley + at, acting_friction(f, at, moving, pulley, v));
    keep_limit(f, s->pulley_limit, at, pulley);
  }
  return transition_bits(f, at, moving);
}

/* T_jv0 and T_jvf of four joints; the same */
HOT_INLINE int friction_of_joints(tendonfmu_finger* f, size_t j) {
  const finger_scratch* s = &f->scratch;
  const size_t at = f->joints * f->tendon_lanes + j;
  const quad v = quad_load(s->velocity + at), speed = quad_abs(v);
  const quad_mask moving = moves_at(speed, f->derived.settings.joint_threshold);
  const slot_view* view = view_at(f, at, v, moving, 0.0);
  const quad own = laws_magnitude(view->below, view_lane(at), speed);
  const quad load = laws_magnitude(view->other, view_lane(at), speed);
  quad_store(s->joint_friction + j, acting_friction(f, at, moving, own, v));
  quad_store(s->load_friction + j, acting_friction(f, at, moving, load, v));
  keep_limit(f, s->edge_limit, at, own);
  keep_limit(f, s->pulley_limit, at, load);
  return transition_bits(f, at, moving);
}

/* F of every slot at the velocities in scratch; returns whether any comes to rest or begins to move */
HOT_INLINE int friction_values(tendonfmu_finger* f) {
  const size_t lanes = f->tendon_lanes;
  int transitions = 0;
  for (size_t j = 0; j < f->joints; ++j) {
    for (size_t at = j * lanes; at < (j + 1) * lanes; at += QUAD_LANES) {
      transitions |= friction_of_tendons(f, j, at);
    }
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    transitions |= friction_of_joints(f, j);
  }
  return transitions != 0;
}

/* Four tendons; any: whether one of them is bidirectional at all. */
typedef struct tendon_kinds {
  int any;
  quad_mask bidirectional;
} tendon_kinds;

/* a force that friction made negative is slack, replaced by 0; of a bidirectional tendon it is a force like any other
 */
HOT_INLINE quad without_slack(quad force, tendon_kinds kinds, quad_mask* slack) {
  const quad zero = quad_set(0.0), pulling = quad_max(zero, force);
  const quad_mask negative = quad_greater(zero, force);
  *slack = quad_either(*slack, kinds.any ? quad_only_first(negative, kinds.bidirectional) : negative);
  return kinds.any ? quad_select(kinds.bidirectional, force, pulling) : pulling;
}

/* the force as it multiplies an F or a b */
HOT_INLINE quad acting_force(quad force, tendon_kinds kinds) {
  return kinds.any ? quad_select(kinds.bidirectional, quad_abs(force), force) : force;
}

/* what four tendons lose at a slot: F times the force that acts there, or what is remembered of it */
HOT_INLINE quad loss_at(tendonfmu_finger* f, size_t slot, size_t row, const double* friction, quad acting,
                        quad before) {
  const quad value = quad_load(friction + slot), loss = quad_mul(acting, value);
  if (!f->memory.elements) {
    return loss;
  }
  return quad_select(slides_at(f, slot), loss_of_memory(f, slot, row, value, acting, before), loss);
}

/* f_A and f_B along four tendons from i on, as a recursion, and what they make at each joint: the sums over the tendons
 * in eqs. (8) and (10), accumulated into tendon_friction [n] and load [n] */
HOT_INLINE void propagate_four(tendonfmu_finger* f, size_t i, tendon_kinds kinds, quad_sums* tendon_friction,
                               quad_sums* load) {
  const finger_scratch* s = &f->scratch;
  const size_t lanes = f->tendon_lanes, last = (f->joints - 1) * lanes;
  const quad zero = quad_set(0.0);
  quad_mask slack = quad_greater(zero, zero);
  quad lost = zero, force = without_slack(quad_load(s->force + i), kinds, &slack);
  for (size_t at = i, j = 0; j < f->joints; at += lanes, ++j) {
    const quad force_at = acting_force(force, kinds); /* f_A,j−1 */
    const quad edge_loss = loss_at(f, at, EDGES, s->edge, force_at, force);
    force = without_slack(quad_sub(force, edge_loss), kinds, &slack);
    keep_tension(f, at, EDGES, force);
    const quad force_between = acting_force(force, kinds); /* f_Bj */
    lost = quad_add(lost, edge_loss);
    if (at < last) {
      const size_t behind = at + lanes;
      const quad pulley_loss = loss_at(f, behind, PULLEYS, s->pulley, force_between, force);
      force = without_slack(quad_sub(force, pulley_loss), kinds, &slack);
      keep_tension(f, behind, PULLEYS, force);
      lost = quad_add(lost, pulley_loss);
    }
    quad_sums_add(&tendon_friction[j], i, quad_mul(quad_load(f->derived.moment_arm + at), lost));
    quad_sums_add(&load[j], i, force_between);
    quad_store(s->force_at + at, force_at);
    quad_store(s->force_between + at, force_between);
  }
  quad_store(s->slack + i, quad_keep(slack, quad_set(1.0)));
}

/* the same of all tendons; without a bidirectional one among four, the usual case, there are fewer cases */
HOT_INLINE void propagate_forces(tendonfmu_finger* f, quad_sums* tendon_friction, quad_sums* load) {
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const quad_mask bidirectional = quad_greater(quad_load(f->derived.bidirectional + i), quad_set(0.5));
    if (quad_mask_bits(bidirectional)) {
      propagate_four(f, i, (tendon_kinds){1, bidirectional}, tendon_friction, load);
    } else {
      propagate_four(f, i, (tendon_kinds){0, bidirectional}, tendon_friction, load);
    }
  }
}

/* the joints' own friction of eq. (8), from T_jv0 and T_jvf·Σ f_B; where it has a memory both in the same proportion */
HOT_INLINE quad own_friction(tendonfmu_finger* f, size_t j, quad sum) {
  const finger_scratch* s = &f->scratch;
  const quad joint = quad_load(s->joint_friction + j), load = quad_mul(quad_load(s->load_friction + j), sum);
  const quad both = quad_add(joint, load);
  if (!f->memory.elements) {
    return both;
  }
  const quad_mask slides = slides_at(f, f->joints * f->tendon_lanes + j);
  const quad limit = limit_of(quad_add(both, quad_load(s->own_limit + j))), held = torque_of_memory(f, j, limit);
  const quad share = quad_div(held, quad_max(limit, quad_set(1e-300))); /* of a limit of 0 nothing is held */
  const quad part = quad_select(slides, share, quad_set(1.0));
  quad_store(s->joint_friction + j, quad_mul(part, joint));
  quad_store(s->load_friction + j, quad_mul(part, quad_load(s->load_friction + j)));
  return quad_select(slides, held, both);
}

/* T_j of eq. (10), with the joint's own friction and cover of eq. (8) */
HOT_INLINE void total_friction(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const derived_numbers* d = &f->derived;
  quad_sums tendon_friction[MODEL_MAX_JOINTS], load[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    quad_sums_clear(&tendon_friction[j]);
    quad_sums_clear(&load[j]);
  }
  propagate_forces(f, tendon_friction, load);
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad bend = quad_sub(quad_load(s->angle + j), quad_load(d->cover_rest + j));
    const quad cover = quad_mul(quad_load(d->cover_stiffness + j), bend);
    const quad sum = quad_sum_rows(load + j), joint_friction = own_friction(f, j, sum);
    quad_store(s->load + j, sum);
    const quad slips = quad_add(quad_sum_rows(tendon_friction + j), joint_friction);
    if (f->derived.settings.has_bands) {
      quad_store(s->slip_torque + j, slips);
    }
    quad_store(s->friction + j, quad_add(slips, cover));
  }
}

/* B: all that friction can hold, Σ |r_ij|·Σ f·|F| with the forces already propagated, and the joint's own; into limit
 * [n] */
HOT_INLINE void friction_limits(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes, joint_row = n * lanes;
  quad_sums total[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    quad_sums_clear(&total[j]);
  }
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad held = quad_set(0.0);
    for (size_t at = i, j = 0; j < n; at += lanes, ++j) {
      held = quad_add(held, quad_mul(quad_load(s->force_at + at), quad_load(s->edge_limit + at)));
      if (j + 1 < n) {
        held = quad_add(held, quad_mul(quad_load(s->force_between + at), quad_load(s->pulley_limit + at + lanes)));
      }
      quad_sums_add(&total[j], i, quad_mul(quad_abs(quad_load(f->derived.moment_arm + at)), held));
    }
  }
  for (size_t j = 0; j < n; ++j) {
    const double own = f->memory.elements ? s->own_limit[j] : 0.0;
    const double limit =
        quad_sum(&total[j]) + (s->edge_limit[joint_row + j] + s->pulley_limit[joint_row + j] * s->load[j]);
    s->limit[j] = limit + own;
  }
}
