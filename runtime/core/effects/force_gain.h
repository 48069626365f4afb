#ifndef TENDONFMU_FORCE_GAIN_H
#define TENDONFMU_FORCE_GAIN_H

#include "effect.h"

extern const effect_type effect_force_gain;

#endif
