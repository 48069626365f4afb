/* Friction that slides at all times (presliding): what every place remembers, and the share of |F| that acts. */
#pragma once

#include "finger_memory.h"
#include "presliding_step.h"

/* lanes that slide at all times */
HOT_INLINE quad_mask slides_at(const tendonfmu_finger* f, size_t slot) {
  return quad_greater(quad_load(f->scratch.slides + slot), quad_set(0.5));
}

/* the places of one layer, four slots at a time; their shares into scratch where the layer acts */
HOT_INLINE void advance_layer(tendonfmu_finger* f, const sliding_layer* layer, double step, int first, int acts) {
  const finger_scratch* s = &f->scratch;
  const double *before = f->remembered.extension, *travel = filters_position(f) ? s->travel : NULL;
  const quad zero = quad_set(0.0), later = quad_set(first ? 0.0 : 1.0), by_motion = quad_set(travel ? 1.0 : step);
  for (size_t slot = 0; slot < f->slots; slot += 4) {
    if (!layer->taken[slot / 4]) {
      continue;
    }
    const uint32_t* at = layer->offset + slot;
    const double* const from[4] = {before + at[0], before + at[1], before + at[2], before + at[3]};
    double* const to[4] = {s->extension + at[0], s->extension + at[1], s->extension + at[2], s->extension + at[3]};
    const quad moved = travel ? quad_load(travel + slot) : quad_mul(quad_load(s->velocity + slot), quad_set(step));
    const presliding_places places = {.displacement = quad_load(layer->displacement + slot),
                                      .distance = quad_load(layer->distance + slot),
                                      .travel = first ? zero : moved,
                                      .by_motion = by_motion,
                                      .has_slopes = quad_greater(later, zero)};
    quad share, by_displacement, after[PRESLIDING_NUMBERS];
    quad_load_pairs(from, &share, &by_displacement);
    presliding_step(&places, share, by_displacement, after);
    quad_store_lanes(to, after);
    if (acts) {
      quad_store(s->grip + slot, quad_select(slides_at(f, slot), after[PRESLIDING_SHARE], quad_set(1.0)));
      quad_store(s->kept + slot, after[PRESLIDING_KEPT]);
    }
  }
}

/* Needs the kinematics of the sample; the friction values need its result. */
HOT_INLINE void advance_sliding_places(tendonfmu_finger* f, double step, int first) {
  if (f->extensions.sliding) {
    advance_layer(f, &f->extensions.acting, step, first, 1);
  }
  if (f->extensions.yielding) {
    advance_layer(f, &f->extensions.overruled, step, first, 0);
  }
}
