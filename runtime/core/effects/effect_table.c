#include <string.h>

#include "cover_hardening.h"
#include "effect.h"

static const effect_type* const table[] = {&cover_hardening};

const effect_type* effect_at(size_t position) {
  return position < sizeof table / sizeof table[0] ? table[position] : NULL;
}

const effect_type* effect_by_id(uint32_t id) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (table[i]->id == id) {
      return table[i];
    }
  }
  return NULL;
}

const effect_type* effect_by_name(const char* name) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (strcmp(table[i]->name, name) == 0) {
      return table[i];
    }
  }
  return NULL;
}
