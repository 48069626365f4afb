#ifndef TENDONFMU_JOINT_COUPLING_H
#define TENDONFMU_JOINT_COUPLING_H

#include "effect.h"

extern const effect_type effect_joint_coupling;

#endif
