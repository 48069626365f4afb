#ifndef TENDONFMU_INERTIA_H
#define TENDONFMU_INERTIA_H

#include "effect.h"

extern const effect_type effect_inertia;

#endif
