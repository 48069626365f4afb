#include "floating_point.h"

#include "effect_facts.h"

/* Friction with a memory: numbers alone; what they do is in friction_memory.h. */
const effect_type effect_presliding = {PRESLIDING_FACTS, .kind = EFFECT_MEMORY};
const effect_type effect_cord_stretch = {CORD_STRETCH_FACTS, .kind = EFFECT_MEMORY};
