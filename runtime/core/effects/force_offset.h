#ifndef TENDONFMU_FORCE_OFFSET_H
#define TENDONFMU_FORCE_OFFSET_H

#include "effect.h"

extern const effect_type effect_force_offset;

#endif
