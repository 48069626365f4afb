#ifndef TENDONFMU_TIME_DELAY_H
#define TENDONFMU_TIME_DELAY_H

#include "effect.h"

extern const effect_type effect_time_delay;

#endif
