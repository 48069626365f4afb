#ifndef TENDONFMU_LOAD_FRICTION_H
#define TENDONFMU_LOAD_FRICTION_H

#include "effect.h"

extern const effect_type effect_load_friction;

#endif
