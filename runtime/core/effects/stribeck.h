#ifndef TENDONFMU_STRIBECK_H
#define TENDONFMU_STRIBECK_H

#include "effect.h"

extern const effect_type effect_stribeck;

#endif
