/* Friction with a memory (docs/reference/semantics/presliding.md): elements that are elastic until they slip, four
 * places at a time. Which rows hold where is in friction_memory.h. */
#pragma once

#include <string.h>

#include "friction_memory.h"
#include "kinematics.h"
#include "quad.h"

#define LARGEST_LIMIT 1e15 /* of |F|, and of the friction of a joint, N·m: no product in a step overflows */

enum { EDGES, PULLEYS }; /* rows of slots of what is remembered; a joint's own friction stands among the edges */

/* lanes whose friction has a memory: they slide at all times */
HOT_INLINE quad_mask slides_at(const tendonfmu_finger* f, size_t slot) {
  const quad remembers = f->memory.elements ? quad_load(f->memory.remembers + slot) : quad_set(0.0);
  return quad_greater(remembers, quad_set(0.5));
}

/* The travel of every place in this sample, and what relaxation makes of it; needs the kinematics. */
HOT_INLINE void turn_places(tendonfmu_finger* f, double step, int first) {
  const finger_scratch* s = &f->scratch;
  const int given = (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_JOINT_VELOCITIES;
  const size_t joint_row = f->joints * f->tendon_lanes;
  for (size_t j = 0; j < f->joint_lanes; j += QUAD_LANES) {
    const quad turned = quad_sub(quad_load(s->angle + j), angle_before_step(f, f->remembered.angle, j));
    const quad travel = given ? quad_mul(quad_load(s->velocity + joint_row + j), quad_set(step)) : turned;
    quad_store(s->travelled + joint_row + j, first ? quad_set(0.0) : travel);
    quad_store(s->own_limit + j, quad_set(0.0));
  }
  relative_velocities(f, s->travelled);
  f->memory.stretch = first ? 0.0 : f->memory.compliance;
  if (f->memory.relaxes && f->memory.step != (first ? 0.0 : step)) {
    find_decay(f, first ? 0.0 : step);
  }
}

/* Four places: what is the same of all their elements. */
typedef struct places {
  size_t slot, at; /* at: in rows of edges and pulleys */
  quad limit;      /* lim */
  quad turned;     /* c0 */
  quad compliance; /* S/k_c; 0 at joints */
} places;

HOT_INLINE quad limit_of(quad friction) {
  return quad_max(quad_set(0.0), quad_min(quad_set(LARGEST_LIMIT), friction));
}

/* One of their elements before it is clipped. */
typedef struct trial {
  quad limit, rate; /* w·lim, β */
  quad kept;        /* a·F′ */
  quad held;        /* F, not clipped */
  quad_mask free;   /* it does not slip */
} trial;

HOT_INLINE quad trial_force(const trial* t, const places* p, quad other) {
  const quad turned = quad_sub(p->turned, quad_mul(other, p->compliance));
  const quad stiff = quad_add(quad_set(1.0), quad_mul(t->rate, p->compliance));
  return quad_div(quad_add(t->kept, quad_mul(t->rate, turned)), stiff);
}

HOT_INLINE quad clip_to(quad value, quad limit) {
  return quad_max(quad_sub(quad_set(0.0), limit), quad_min(limit, value));
}

HOT_INLINE trial begin_trial(const tendonfmu_finger* f, const places* p, size_t e) {
  const friction_element* element = &f->memory.element[e];
  trial t;
  t.limit = quad_mul(quad_load(element->share + p->slot), p->limit);
  t.rate = quad_add(quad_load(element->stiff + p->slot), quad_mul(quad_load(element->soft + p->slot), t.limit));
  t.kept = quad_mul(quad_load(element->kept + p->slot), quad_load(f->remembered.element + e * 2 * f->slots + p->at));
  return t;
}

HOT_INLINE void end_trial(trial* t) {
  t->free = quad_greater(t->limit, quad_abs(t->held));
}

/* both elements free: Σ F_e of the two equations together, then each with what the other holds */
HOT_INLINE void solve_pair(trial t[2], const places* p) {
  const quad rate = quad_add(t[0].rate, t[1].rate), kept = quad_add(t[0].kept, t[1].kept);
  const trial both = {.rate = rate, .kept = kept};
  const quad sum = trial_force(&both, p, quad_set(0.0));
  const quad turned = quad_sub(p->turned, quad_mul(sum, p->compliance));
  for (int e = 0; e < 2; ++e) {
    t[e].held = quad_add(t[e].kept, quad_mul(t[e].rate, turned));
    end_trial(&t[e]);
  }
  const quad clipped[2] = {clip_to(t[0].held, t[0].limit), clip_to(t[1].held, t[1].limit)};
  const quad_mask was_free[2] = {t[0].free, t[1].free};
  for (int e = 0; e < 2; ++e) {
    const quad alone = trial_force(&t[e], p, clipped[1 - e]);
    t[e].held = quad_select(quad_only_first(was_free[e], was_free[1 - e]), alone, t[e].held);
    end_trial(&t[e]);
  }
}

/* The same with one element and rigid cords: nothing is divided, and what does not wait for the force comes first. */
HOT_INLINE quad step_alone(tendonfmu_finger* f, const places* p) {
  const finger_scratch* s = &f->scratch;
  const friction_element* element = &f->memory.element[0];
  const quad held = quad_mul(quad_load(element->kept + p->slot), quad_load(f->remembered.element + p->at));
  const quad stiff = quad_load(element->stiff + p->slot), soft = quad_load(element->soft + p->slot);
  const quad fixed = quad_add(held, quad_mul(stiff, p->turned)), by_limit = quad_mul(soft, p->turned);
  const quad limit = quad_mul(quad_load(element->share + p->slot), p->limit);
  const quad trial = quad_add(fixed, quad_mul(by_limit, limit)), force = clip_to(trial, limit);
  const quad_mask free = quad_greater(limit, quad_abs(trial));
  quad_store(s->element + p->at, force);
  quad_store(s->by_turning + p->at, quad_keep(free, quad_add(stiff, quad_mul(soft, limit))));
  quad_store(s->by_limit + p->at, quad_select(free, by_limit, quad_with_sign(quad_set(1.0), trial)));
  return force;
}

/* F of four places, and what is remembered of them */
HOT_INLINE quad step_places(tendonfmu_finger* f, const places* p) {
  const finger_scratch* s = &f->scratch;
  const quad zero = quad_set(0.0);
  quad sum = zero, stiffness = zero, by_turning = zero, by_limit = zero;
  trial t[MODEL_MAX_ELEMENTS];
  for (size_t e = 0; e < f->memory.elements; ++e) {
    t[e] = begin_trial(f, p, e);
  }
  if (f->memory.elements == 2) {
    solve_pair(t, p);
  } else {
    t[0].held = trial_force(&t[0], p, zero);
    end_trial(&t[0]);
  }
  for (size_t e = 0; e < f->memory.elements; ++e) {
    const quad force = clip_to(t[e].held, t[e].limit);
    quad_store(s->element + e * 2 * f->slots + p->at, force);
    sum = quad_add(sum, force);
    by_turning = quad_add(by_turning, quad_keep(t[e].free, t[e].rate));
  }
  const quad turned = quad_sub(p->turned, quad_mul(sum, p->compliance)); /* c */
  for (size_t e = 0; e < f->memory.elements; ++e) {
    const friction_element* element = &f->memory.element[e];
    const quad slips = quad_with_sign(quad_set(1.0), t[e].held);
    const quad own = quad_select(t[e].free, quad_mul(quad_load(element->soft + p->slot), turned), slips);
    by_limit = quad_add(by_limit, quad_mul(quad_load(element->share + p->slot), own));
  }
  stiffness = quad_add(quad_set(1.0), quad_mul(by_turning, p->compliance));
  quad_store(s->by_turning + p->at, quad_div(by_turning, stiffness));
  quad_store(s->by_limit + p->at, quad_div(by_limit, stiffness));
  return sum;
}

/* What four tendons lose at their edges or pulleys at a slot, with |F| of the law and the force before them. */
HOT_INLINE quad loss_of_memory(tendonfmu_finger* f, size_t slot, size_t row, quad magnitude, quad acting, quad before) {
  const int stretches = f->memory.stretch > 0.0;
  const size_t at = row * f->slots + slot;
  places p = {.slot = slot,
              .at = at,
              .limit = quad_mul(acting, limit_of(magnitude)),
              .turned = quad_load(f->scratch.travelled + slot),
              .compliance = quad_set(0.0)};
  if (stretches) {
    p.compliance = quad_mul(quad_load(f->memory.sections + slot), quad_set(f->memory.stretch));
    const quad change = quad_sub(before, quad_load(f->remembered.tension + at));
    p.turned = quad_add(p.turned, quad_mul(change, p.compliance));
  }
  return stretches || f->memory.elements > 1 ? step_places(f, &p) : step_alone(f, &p);
}

/* The same of the joints' own friction. */
HOT_INLINE quad torque_of_memory(tendonfmu_finger* f, size_t joint, quad limit) {
  const size_t slot = f->joints * f->tendon_lanes + joint;
  const places p = {.slot = slot,
                    .at = EDGES * f->slots + slot,
                    .limit = limit,
                    .turned = quad_load(f->scratch.travelled + slot),
                    .compliance = quad_set(0.0)};
  return f->memory.elements > 1 ? step_places(f, &p) : step_alone(f, &p);
}

/* What is behind an edge or a pulley, for the stretch of the cord there at the next sample. */
HOT_INLINE void keep_tension(const tendonfmu_finger* f, size_t slot, size_t row, quad force) {
  const size_t at = row * f->slots + slot;
  if (f->memory.compliance > 0.0) {
    quad_store(f->scratch.tension + at, force);
  }
}

/* The sample is accepted. */
HOT_INLINE void remember_elements(tendonfmu_finger* f) {
  const finger_state* to = &f->remembered;
  const finger_scratch* from = &f->scratch;
  const size_t slots = f->slots;
  memcpy(to->element, from->element, f->memory.elements * 2 * slots * sizeof(double));
  memcpy(to->by_turning, from->by_turning, 2 * slots * sizeof(double));
  memcpy(to->by_limit, from->by_limit, 2 * slots * sizeof(double));
  if (f->memory.compliance > 0.0) {
    memcpy(to->tension, from->tension, 2 * slots * sizeof(double));
  }
}
