#include "effect_facts.h"

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
