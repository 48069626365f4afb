/* A kernel of the lanes that the source asks for (quad.h): friction values at the present velocities, the tendon forces
 * behind them, and the torques they make, eqs. (6)-(10); sums over the tendons, eqs. (2) to (5). */
#pragma once

#include "band_watch.h"
#include "exponential.h"
#include "finger_memory.h"
#include "friction_elements.h"
#include "friction_law.h"
#include "kernel_choice.h"
#include "sensor_watch.h"

/* Fc + (Fs − Fc)·exp(−|v|/vs) + Fv·|v| of some laws of a view, from a lane on; exponent(v) is the smooth part of
 * eq. (1) */
HOT_INLINE quad laws_magnitude(const double rows[LAW_SIDE_NUMBERS][4], size_t lane, quad speed) {
  const quad decay = exp_of_minus(speed * quad_load(rows[LAW_RATE] + lane));
  const quad stribeck = quad_load(rows[LAW_DROP] + lane) * decay;
  return quad_load(rows[LAW_COULOMB] + lane) + stribeck + quad_load(rows[LAW_VISCOUS] + lane) * speed;
}

/* |F_B| at speed |v|: the values of the two neighbouring working points, interpolated linearly in the angle of the
 * joint before; constant outside the grid */
HOT_INLINE quad edges_magnitude(const slot_view* view, size_t lane, double angle, quad speed) {
  const quad below = laws_magnitude(view->below, lane, speed);
  if (view->blends[lane] == 0.0) {
    return below;
  }
  const quad above = laws_magnitude(view->above, lane, speed);
  const quad weight = (angle - quad_load(view->begin + lane)) * quad_load(view->inverse_length + lane);
  return below + weight * (above - below);
}

/* lanes that moved at the last sample */
HOT_INLINE quad_mask moved_before(const tendonfmu_finger* f, size_t slot) {
  return quad_greater(quad_load(f->remembered.moving + slot), quad_set(0.5));
}

/* Some slots at this sample. */
typedef struct motion {
  size_t slot, lane; /* lane: where they stand in their view */
  quad velocity, speed;
  quad_mask moving, moved; /* now; at the last sample */
} motion;

HOT_INLINE motion motion_at(const tendonfmu_finger* f, size_t slot, double threshold) {
  const quad velocity = quad_load(f->scratch.velocity + slot), speed = quad_abs(velocity);
  return (motion){.slot = slot,
                  .lane = slot % 4 / QUAD_LANES * QUAD_LANES,
                  .velocity = velocity,
                  .speed = speed,
                  .moving = quad_greater(speed, quad_set(threshold)),
                  .moved = moved_before(f, slot)};
}

HOT_INLINE int negative_bits(quad velocity) {
  return quad_bits(quad_greater(quad_set(0.0), velocity));
}

/* the view of some slots, filled anew where a moving lane is on another side or the angle has left its segment; a lane
 * that sticks keeps its side, so that noise around zero velocity costs nothing */
HOT_INLINE const slot_view* view_at(tendonfmu_finger* f, const motion* m, double angle) {
  slot_view* view = f->scratch.view + m->slot / 4;
  const int moves = quad_bits(m->moving), known = (int)view->key[m->lane];
  const int held = known < 0 || f->extensions.gripped; /* what slides may be on another side than it remembers */
  const int resting = held ? negative_bits(quad_load(f->remembered.side + m->slot)) : known;
  const int negative = (negative_bits(m->velocity) & moves) | (resting & ~moves);
  const quad q = quad_set(angle);
  const quad_mask inside =
      quad_greater(quad_load(view->high + m->lane), q) & ~quad_greater(quad_load(view->low + m->lane), q);
  if (negative != known || quad_bits(inside) != QUAD_ALL) {
    slot_view_fill(f, m->slot, QUAD_LANES, angle, negative, view);
  }
  return view;
}

/* what the friction rows make of a friction value */
HOT_INLINE quad gripped(const tendonfmu_finger* f, size_t slot, quad friction) {
  if (!f->extensions.frictions) {
    return friction;
  }
  return quad_load(f->scratch.grip + slot) * friction;
}

/* F of some slots from |F| of the law: with the sign of v where |v| > v_min, 0 where the effect sticks (fig. 2b), or
 * |F| itself where it has a memory; and what the friction rows make of it */
HOT_INLINE quad acting_friction(const tendonfmu_finger* f, const motion* m, quad magnitude) {
  const quad by_motion = quad_keep(m->moving, quad_with_sign(magnitude, m->velocity));
  const quad acting = elements_of(f) ? quad_select(slides_at(f, m->slot), magnitude, by_motion) : by_motion;
  return gripped(f, m->slot, acting);
}

/* |F| of one effect at some slots for the bands, whether it acts or not */
HOT_INLINE void keep_limit(const tendonfmu_finger* f, double* limit, size_t slot, quad magnitude) {
  if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
    quad_store(limit + slot, gripped(f, slot, magnitude));
  }
}

/* whether F of some slots is 0 without a look at the laws: nothing moves, now or before, or slides; for the
 * bands, which need |F| of what sticks, only where it can hold no joint */
HOT_INLINE int nothing_acts(const tendonfmu_finger* f, const motion* m) {
  const int holds = has_option(f, MODEL_DETECTS_BY_BANDS) && f->derived.can_hold[m->slot / 4];
  return !(holds | quad_bits(m->moving | m->moved | slides_at(f, m->slot)));
}

/* F_B and F_A of some tendons at joint j, from slot `at` on; returns whether any of them comes to rest or begins to
 * move */
HOT_INLINE int friction_of_tendons(tendonfmu_finger* f, size_t j, size_t at) {
  const finger_scratch* s = &f->scratch;
  const double before = j ? s->angle[j - 1] : 0.0; /* q_0 = 0 */
  const motion m = motion_at(f, at, f->derived.settings.tendon_threshold);
  if (nothing_acts(f, &m)) {
    quad_store(s->edge + at, quad_set(0.0));
    quad_store(s->pulley + at, quad_set(0.0));
    return 0;
  }
  const slot_view* view = view_at(f, &m, before);
  const quad edge = edges_magnitude(view, m.lane, before, m.speed);
  quad_store(s->edge + at, acting_friction(f, &m, edge));
  keep_limit(f, s->edge_limit, at, edge);
  if (j > 0) { /* before the first joint there is no pulley */
    const quad pulley = laws_magnitude(view->other, m.lane, m.speed);
    quad_store(s->pulley + at, acting_friction(f, &m, pulley));
    keep_limit(f, s->pulley_limit, at, pulley);
  }
  return quad_bits(m.moving ^ m.moved);
}

/* T_jv0 and T_jvf of some joints; the same */
HOT_INLINE int friction_of_joints(tendonfmu_finger* f, size_t j) {
  const finger_scratch* s = &f->scratch;
  const size_t at = f->joints * f->tendon_lanes + j;
  const motion m = motion_at(f, at, f->derived.settings.joint_threshold);
  const slot_view* view = view_at(f, &m, 0.0);
  const quad own = laws_magnitude(view->below, m.lane, m.speed);
  const quad load = laws_magnitude(view->other, m.lane, m.speed);
  quad_store(s->joint_friction + j, acting_friction(f, &m, own));
  quad_store(s->load_friction + j, acting_friction(f, &m, load));
  keep_limit(f, s->edge_limit, at, own);
  keep_limit(f, s->pulley_limit, at, load);
  return quad_bits(m.moving ^ m.moved);
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

/* Some tendons; any: whether one of them is bidirectional at all. */
typedef struct tendon_kinds {
  int any;
  quad_mask bidirectional;
} tendon_kinds;

/* a force that friction made negative is slack, replaced by 0; of a bidirectional tendon it is a force like any other
 */
HOT_INLINE quad without_slack(quad force, tendon_kinds kinds, quad_mask* slack) {
  const quad zero = quad_set(0.0), pulling = quad_max(zero, force);
  const quad_mask negative = quad_greater(zero, force);
  *slack |= kinds.any ? negative & ~kinds.bidirectional : negative;
  return kinds.any ? quad_select(kinds.bidirectional, force, pulling) : pulling;
}

/* the force as it multiplies an F or a b */
HOT_INLINE quad acting_force(quad force, tendon_kinds kinds) {
  return kinds.any ? quad_select(kinds.bidirectional, quad_abs(force), force) : force;
}

/* what some tendons lose at a slot: F times the force that acts there, or what is remembered of it */
HOT_INLINE quad loss_at(tendonfmu_finger* f, size_t slot, size_t row, const double* friction, quad acting,
                        quad before) {
  const quad value = quad_load(friction + slot), loss = acting * value;
  if (!elements_of(f)) {
    return loss;
  }
  const quad_mask slides = slides_at(f, slot);
  if (!quad_bits(slides)) {
    return loss;
  }
  return quad_select(slides, loss_of_memory(f, slot, row, value, acting, before), loss);
}

/* f_A and f_B along some tendons from i on, as a recursion, and what they make at each joint: the sums over the tendons
 * in eqs. (8) and (10), accumulated into tendon_friction [n] and load [n] */
HOT_INLINE void propagate_some(tendonfmu_finger* f, size_t i, tendon_kinds kinds, quad_sums* tendon_friction,
                               quad_sums* load) {
  const finger_scratch* s = &f->scratch;
  const size_t lanes = f->tendon_lanes, last = (f->joints - 1) * lanes;
  const quad zero = quad_set(0.0);
  quad_mask slack = quad_greater(zero, zero);
  quad lost = zero, force = without_slack(quad_load(s->force + i), kinds, &slack);
  for (size_t at = i, j = 0; j < f->joints; at += lanes, ++j) {
    const quad force_at = acting_force(force, kinds); /* f_A,j−1 */
    const quad edge_loss = loss_at(f, at, EDGES, s->edge, force_at, force);
    force = without_slack(force - edge_loss, kinds, &slack);
    keep_tension(f, at, EDGES, force);
    const quad force_between = acting_force(force, kinds); /* f_Bj */
    lost += edge_loss;
    if (at < last) {
      const size_t behind = at + lanes;
      const quad pulley_loss = loss_at(f, behind, PULLEYS, s->pulley, force_between, force);
      force = without_slack(force - pulley_loss, kinds, &slack);
      keep_tension(f, behind, PULLEYS, force);
      lost += pulley_loss;
    }
    quad_sums_add(&tendon_friction[j], i, quad_load(f->derived.moment_arm + at) * lost);
    quad_sums_add(&load[j], i, force_between);
    quad_store(s->force_at + at, force_at);
    quad_store(s->force_between + at, force_between);
  }
  quad_store(s->slack + i, quad_keep(slack, quad_set(1.0)));
}

/* the same of all tendons; without a bidirectional one among them, the usual case, there are fewer cases */
HOT_INLINE void propagate_forces(tendonfmu_finger* f, quad_sums* tendon_friction, quad_sums* load) {
  for (size_t i = 0; i < f->tendon_lanes; i += QUAD_LANES) {
    const quad_mask bidirectional = quad_greater(quad_load(f->derived.bidirectional + i), quad_set(0.5));
    if (quad_bits(bidirectional)) {
      propagate_some(f, i, (tendon_kinds){1, bidirectional}, tendon_friction, load);
    } else {
      propagate_some(f, i, (tendon_kinds){0, bidirectional}, tendon_friction, load);
    }
  }
}

/* the joints' own friction of eq. (8), from T_jv0 and T_jvf·Σ f_B; where it has a memory both in the same proportion */
HOT_INLINE quad own_friction(tendonfmu_finger* f, size_t j, quad sum) {
  const finger_scratch* s = &f->scratch;
  const quad joint = quad_load(s->joint_friction + j), load = quad_load(s->load_friction + j);
  const quad both = joint + load * sum;
  if (!elements_of(f)) {
    return both;
  }
  const quad_mask slides = slides_at(f, f->joints * f->tendon_lanes + j);
  const quad limit = limit_of(both + quad_load(s->own_limit + j)), held = torque_of_memory(f, j, limit);
  const quad share = held / quad_max(limit, quad_set(1e-300)); /* of a limit of 0 nothing is held */
  const quad part = quad_select(slides, share, quad_set(1.0));
  quad_store(s->joint_friction + j, part * joint);
  quad_store(s->load_friction + j, part * load);
  return quad_select(slides, held, both);
}

/* B: all that friction can hold, Σ |r_ij|·Σ f·|F| with the forces already propagated, and the joint's own; into limit
 * [n] */
HOT_INLINE void friction_limits(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, lanes = f->tendon_lanes, joint_row = n * lanes;
  quad_sums total[MODEL_MAX_JOINTS];
  memset(total, 0, f->joint_lanes * sizeof *total);
  for (size_t i = 0; i < lanes; i += QUAD_LANES) {
    quad held = quad_set(0.0);
    for (size_t at = i, j = 0; j < n; at += lanes, ++j) {
      held += quad_load(s->force_at + at) * quad_load(s->edge_limit + at);
      if (j + 1 < n) {
        held += quad_load(s->force_between + at) * quad_load(s->pulley_limit + at + lanes);
      }
      quad_sums_add(&total[j], i, quad_abs(quad_load(f->derived.moment_arm + at)) * held);
    }
  }
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad load = quad_load(s->pulley_limit + joint_row + j) * quad_load(s->load + j);
    const quad own = elements_of(f) ? quad_load(s->own_limit + j) : quad_set(0.0);
    quad_store(s->limit + j, quad_sum_rows(total + j) + (quad_load(s->edge_limit + joint_row + j) + load) + own);
  }
}

/* T_j of eq. (10), with the joint's own friction and cover of eq. (8); returns whether any slot comes to rest or begins
 * to move */
static int find_friction(tendonfmu_finger* f) {
  const finger_scratch* s = &f->scratch;
  const derived_numbers* d = &f->derived;
  const int transitions = friction_values(f);
  quad_sums tendon_friction[MODEL_MAX_JOINTS], load[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    memset(&tendon_friction[j], 0, sizeof tendon_friction[j]);
    memset(&load[j], 0, sizeof load[j]);
  }
  propagate_forces(f, tendon_friction, load);
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad cover = quad_load(d->cover_stiffness + j) * (quad_load(s->angle + j) - quad_load(d->cover_rest + j));
    const quad sum = quad_sum_rows(load + j), joint_friction = own_friction(f, j, sum);
    quad_store(s->load + j, sum);
    const quad slips = quad_sum_rows(tendon_friction + j) + joint_friction;
    if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
      quad_store(s->slip_torque + j, slips);
    }
    quad_store(s->friction + j, slips + cover);
  }
  if (has_option(f, MODEL_DETECTS_BY_BANDS)) {
    friction_limits(f);
  }
  return transitions;
}

static void remember_slots(tendonfmu_finger* f, double time) {
  const finger_state* s = &f->remembered;
  for (size_t slot = 0; slot < f->slots; slot += QUAD_LANES) {
    const quad_mask moves = moved_before(f, slot); /* brought up to date already */
    const quad side = quad_with_sign(quad_set(1.0), quad_load(f->scratch.velocity + slot));
    quad_store(s->side + slot, quad_select(moves, side, quad_load(s->side + slot)));
    quad_store(s->last_stuck + slot, quad_select(moves, quad_load(s->last_stuck + slot), quad_set(time)));
  }
}

/* --- sums over the tendons ---------------------------------------------------------------------------------------- */

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

#define LINKED_WITH(option, function) ((TENDONFMU_OPTIONS) & (option) ? (function) : NULL)
#define STEP_KERNEL(name)                                                                                          \
  {                                                                                                                \
    name, one_minus_exponentials, multiply, tendon_velocities, LINKED_WITH(MODEL_HAS_SENSOR_FAULT, watch_tendons), \
        LINKED_WITH(MODEL_DETECTS_BY_BANDS, follow_bands), LINKED_WITH(MODEL_DETECTS_BY_BANDS, weigh_bands),       \
        find_friction, remember_slots                                                                              \
  }
