#ifndef TENDONFMU_BACKLASH_H
#define TENDONFMU_BACKLASH_H

#include "effect.h"

extern const effect_type effect_backlash;

#endif
