#ifndef TENDONFMU_PRESLIDING_H
#define TENDONFMU_PRESLIDING_H

#include "effect.h"

extern const effect_type effect_presliding;

#endif
