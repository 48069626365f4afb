#ifndef TENDONFMU_TENDON_NONLINEARITY_H
#define TENDONFMU_TENDON_NONLINEARITY_H

#include "effect.h"

extern const effect_type effect_tendon_nonlinearity;

#endif
