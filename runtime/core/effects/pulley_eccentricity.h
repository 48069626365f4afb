#ifndef TENDONFMU_PULLEY_ECCENTRICITY_H
#define TENDONFMU_PULLEY_ECCENTRICITY_H

#include "effect.h"

extern const effect_type effect_pulley_eccentricity;

#endif
