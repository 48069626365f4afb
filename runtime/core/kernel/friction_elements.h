/* Friction with a memory (docs/reference/semantics/presliding.md): elements that are elastic until they slip, four
 * places at a time. Which rows hold where is in friction_memory.c. */
#pragma once

#include "finger_memory.h"
#include "quad.h"

#define LEAST_LIMIT   1e-150
#define LARGEST_LIMIT 1e15 /* of |F|, and of the friction of a joint, N·m: no product in a step overflows */

enum { EDGES, PULLEYS }; /* rows of slots of what is remembered; a joint's own friction stands among the edges */

/* lanes whose friction has a memory: they slide at all times */
HOT_INLINE quad_mask slides_at(const tendonfmu_finger* f, size_t slot) {
  const quad remembers = elements_of(f) ? quad_load(f->memory.remembers + slot) : quad_set(0.0);
  return quad_greater(remembers, quad_set(0.5));
}

/* Some places: what is the same of all their elements. */
typedef struct places {
  size_t slot, at; /* at: in rows of edges and pulleys */
  quad limit;      /* lim */
  quad turned;     /* c0 */
  int stretches;   /* the cords there, by the next; else everything about it drops out, to the bit */
  quad compliance; /* S/k_c */
} places;

HOT_INLINE quad limit_of(quad friction) {
  return quad_max(quad_set(0.0), quad_min(quad_set(LARGEST_LIMIT), friction));
}

/* One of their elements before it is clipped. */
typedef struct trial {
  quad limit, rate; /* w·lim, β */
  quad kept;        /* a·F′, with what of it follows the limit */
  quad by_limit;    /* slope of this by lim */
  quad held;        /* F, not clipped */
  quad_mask free;   /* it does not slip */
} trial;

HOT_INLINE quad trial_force(const trial* t, const places* p, quad other) {
  if (!p->stretches) {
    return t->kept + t->rate * p->turned;
  }
  return (t->kept + t->rate * (p->turned - other * p->compliance)) / (1.0 + t->rate * p->compliance);
}

HOT_INLINE quad clip_to(quad value, quad limit) {
  return quad_max(0.0 - limit, quad_min(limit, value));
}

/* a·F′ of an element without what follows the limit, a·F′·p, whose slope by lim it returns */
HOT_INLINE quad take_following(const tendonfmu_finger* f, size_t e, size_t slot, size_t at, quad* kept) {
  if (!f->memory.follows) {
    return quad_set(0.0);
  }
  const quad following = quad_load(f->memory.element[e].follows + slot) * *kept;
  *kept -= following;
  const quad before = quad_max(quad_set(LEAST_LIMIT), quad_load(f->remembered.held_limit + at));
  return clip_to(following / before, quad_set(1.0)); /* of a restored state, too */
}

HOT_INLINE trial begin_trial(const tendonfmu_finger* f, const places* p, size_t e) {
  const friction_element* element = &f->memory.element[e];
  trial t;
  t.limit = quad_load(element->share + p->slot) * p->limit;
  t.rate = quad_load(element->stiff + p->slot) + quad_load(element->soft + p->slot) * t.limit;
  t.kept = quad_load(element->kept + p->slot) * quad_load(f->remembered.element + e * 2 * f->slots + p->at);
  t.by_limit = take_following(f, e, p->slot, p->at, &t.kept);
  t.kept += t.by_limit * p->limit;
  return t;
}

HOT_INLINE void end_trial(trial* t) {
  t->free = quad_greater(t->limit, quad_abs(t->held));
}

/* both elements free: Σ F_e of the two equations together, then each with what the other holds */
HOT_INLINE void solve_pair(trial t[2], const places* p) {
  const trial both = {.rate = t[0].rate + t[1].rate, .kept = t[0].kept + t[1].kept};
  const quad turned = p->turned - trial_force(&both, p, quad_set(0.0)) * p->compliance;
  for (int e = 0; e < 2; ++e) {
    t[e].held = t[e].kept + t[e].rate * turned;
    end_trial(&t[e]);
  }
  const quad clipped[2] = {clip_to(t[0].held, t[0].limit), clip_to(t[1].held, t[1].limit)};
  const quad_mask was_free[2] = {t[0].free, t[1].free};
  for (int e = 0; e < 2; ++e) {
    const quad alone = trial_force(&t[e], p, clipped[1 - e]);
    t[e].held = quad_select(was_free[e] & ~was_free[1 - e], alone, t[e].held);
    end_trial(&t[e]);
  }
}

/* The same with one element and rigid cords: what does not wait for the force comes first. */
HOT_INLINE quad step_alone(tendonfmu_finger* f, const places* p) {
  const finger_scratch* s = &f->scratch;
  const friction_element* element = &f->memory.element[0];
  quad held = quad_load(element->kept + p->slot) * quad_load(f->remembered.element + p->at);
  const quad following = take_following(f, 0, p->slot, p->at, &held);
  const quad stiff = quad_load(element->stiff + p->slot), soft = quad_load(element->soft + p->slot);
  const quad fixed = held + stiff * p->turned, by_limit = soft * p->turned;
  const quad share = quad_load(element->share + p->slot), limit = share * p->limit;
  const quad trial = fixed + by_limit * limit + following * p->limit, force = clip_to(trial, limit);
  const quad_mask free = quad_greater(limit, quad_abs(trial));
  quad_store(s->element + p->at, force);
  quad_store(s->by_turning + p->at, quad_keep(free, stiff + soft * limit));
  const quad slips = quad_with_sign(quad_set(1.0), trial);
  quad_store(s->by_limit + p->at, share * quad_select(free, by_limit, slips) + quad_keep(free, following));
  quad_store(s->held_limit + p->at, quad_keep(slides_at(f, p->slot), p->limit));
  return force;
}

/* F of some places, and what is remembered of them */
HOT_INLINE quad step_places(tendonfmu_finger* f, const places* p) {
  const finger_scratch* s = &f->scratch;
  const quad zero = quad_set(0.0);
  quad sum = zero, by_turning = zero, by_limit = zero;
  trial t[MODEL_MAX_ELEMENTS];
  for (size_t e = 0; e < elements_of(f); ++e) {
    t[e] = begin_trial(f, p, e);
  }
  if (p->stretches && elements_of(f) == 2) {
    solve_pair(t, p);
  } else {
    for (size_t e = 0; e < elements_of(f); ++e) {
      t[e].held = trial_force(&t[e], p, zero);
      end_trial(&t[e]);
    }
  }
  for (size_t e = 0; e < elements_of(f); ++e) {
    const quad force = clip_to(t[e].held, t[e].limit);
    quad_store(s->element + e * 2 * f->slots + p->at, force);
    sum += force;
    by_turning += quad_keep(t[e].free, t[e].rate);
  }
  quad turned = p->turned; /* c */
  if (p->stretches) {
    turned -= sum * p->compliance;
  }
  for (size_t e = 0; e < elements_of(f); ++e) {
    const friction_element* element = &f->memory.element[e];
    const quad slips = quad_with_sign(quad_set(1.0), t[e].held);
    const quad own = quad_select(t[e].free, quad_load(element->soft + p->slot) * turned, slips);
    by_limit += quad_load(element->share + p->slot) * own + quad_keep(t[e].free, t[e].by_limit);
  }
  if (p->stretches) {
    const quad stiffness = 1.0 + by_turning * p->compliance;
    by_turning = by_turning / stiffness;
    by_limit = by_limit / stiffness;
  }
  quad_store(s->by_turning + p->at, by_turning);
  quad_store(s->by_limit + p->at, by_limit);
  quad_store(s->held_limit + p->at, quad_keep(slides_at(f, p->slot), p->limit));
  return sum;
}

/* F of places on rigid cords. */
HOT_INLINE quad step_rigid(tendonfmu_finger* f, size_t slot, size_t row, quad limit) {
  const places p = {
      .slot = slot, .at = row * f->slots + slot, .limit = limit, .turned = quad_load(f->scratch.travelled + slot)};
  return elements_of(f) > 1 ? step_places(f, &p) : step_alone(f, &p);
}

/* What some tendons lose at their edges or pulleys at a slot, with |F| of the law and the force before them. */
HOT_INLINE quad loss_of_memory(tendonfmu_finger* f, size_t slot, size_t row, quad magnitude, quad acting, quad before) {
  const quad limit = acting * limit_of(magnitude);
  if (!(f->memory.stretch > 0.0)) {
    return step_rigid(f, slot, row, limit);
  }
  places p = {.slot = slot, .at = row * f->slots + slot, .limit = limit, .stretches = 1};
  p.compliance = quad_load(f->memory.sections + slot) * f->memory.stretch;
  const quad tension = quad_load(f->remembered.tension + p.at);
  p.turned = quad_load(f->scratch.travelled + slot) + (before - tension) * p.compliance;
  return step_places(f, &p);
}

/* The same of the joints' own friction. */
HOT_INLINE quad torque_of_memory(tendonfmu_finger* f, size_t joint, quad limit) {
  return step_rigid(f, f->joints * f->tendon_lanes + joint, EDGES, limit);
}

/* What is behind an edge or a pulley, for the stretch of the cord there at the next sample. */
HOT_INLINE void keep_tension(const tendonfmu_finger* f, size_t slot, size_t row, quad force) {
  if (f->memory.compliance > 0.0) {
    quad_store(f->scratch.tension + row * f->slots + slot, force);
  }
}
