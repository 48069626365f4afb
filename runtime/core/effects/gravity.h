#ifndef TENDONFMU_GRAVITY_H
#define TENDONFMU_GRAVITY_H

#include "effect.h"

extern const effect_type effect_gravity;

#endif
