#include "effect_facts.h"

/* Friction with a memory: numbers alone; what they do is in friction_memory.h. */
const effect_type effect_presliding = {PRESLIDING_FACTS, .kind = EFFECT_MEMORY};
const effect_type effect_cord_stretch = {CORD_STRETCH_FACTS, .kind = EFFECT_MEMORY};

const effect_type* effect_at(size_t position) {
  return position < EFFECT_COUNT ? all_effects[position] : NULL;
}

const effect_type* effect_by_id(uint32_t id) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (all_effects[i]->id == id) {
      return all_effects[i];
    }
  }
  return NULL;
}
