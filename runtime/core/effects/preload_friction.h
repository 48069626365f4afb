#ifndef TENDONFMU_PRELOAD_FRICTION_H
#define TENDONFMU_PRELOAD_FRICTION_H

#include "effect.h"

extern const effect_type effect_preload_friction;

#endif
