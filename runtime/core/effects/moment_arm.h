#ifndef TENDONFMU_MOMENT_ARM_H
#define TENDONFMU_MOMENT_ARM_H

#include "effect.h"

extern const effect_type effect_moment_arm;

#endif
