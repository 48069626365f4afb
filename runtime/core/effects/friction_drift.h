#ifndef TENDONFMU_FRICTION_DRIFT_H
#define TENDONFMU_FRICTION_DRIFT_H

#include "effect.h"

extern const effect_type effect_friction_drift;

#endif
