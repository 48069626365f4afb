#ifndef TENDONFMU_MOMENT_ARM_VARIATION_H
#define TENDONFMU_MOMENT_ARM_VARIATION_H

#include "effect.h"

extern const effect_type effect_moment_arm_variation;

#endif
